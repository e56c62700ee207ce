# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The fuzz, a short run of it; and its judge, which finds every fault that is planted."""
from __future__ import annotations

import csv

import numpy as np
import oracle
import pytest
from gmpy2 import mpfr

from box_contact_ros import ContactSolver
from box_contact_ros.output import write_csv
from box_contact_ros.solver.models import gated_models
from box_contact_ros.verification import fuzz, judge

SEED = 20260


def drawn(name, n=400):
    return fuzz.draw(name, np.random.default_rng([SEED, 7]), n)


def answers(pairs, model='exact'):
    a, b, size_a, size_b = pairs
    return [part.copy() for part in ContactSolver((1, 1, 1), (1, 1, 1), model=model).batch(
        a, b, size_a=size_a, size_b=size_b)]


def test_gates_are_at_zero(tmp_path):
    """60,000 pairs, ten thousand a class; the CSV has a row for each class and model."""
    tallies = fuzz.fuzz(60_000, seed=SEED)
    for tally in tallies.values():
        assert tally.broken == 0, '\n'.join([str(tally), *tally.poses])
        assert tally.contacts > tally.pairs / 3
        assert 0 < tally.near_touch < 0.05 * tally.pairs
        assert tally.worst_depth <= 1.0
    write_csv(tmp_path / 'fuzz.csv', fuzz.csv_rows(tallies.values()))
    with (tmp_path / 'fuzz.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [(row['class'], row['model']) for row in rows] == list(tallies)
    assert all(row[gate] == '0' for row in rows for gate in judge.GATES.values())


@pytest.mark.parametrize('name', fuzz.CLASSES)
def test_the_judges_gap_is_the_oracles(name):
    """In 60 digits to the bit; in float64 to its tolerance, or it says that it is not sure."""
    pairs = drawn(name, 60)
    found = answers(pairs)
    verdict = judge.judge(*pairs, found)
    for row, (a, b, size_a, size_b) in enumerate(zip(*pairs)):
        exact = oracle.separation(oracle.make_box(a, size_a), oracle.make_box(b, size_b))
        assert judge.exact_gap(a, b, size_a, size_b) == float(exact)
        if found[0][row] and not verdict.doubtful[row]:
            off = abs(mpfr(float(found[1][row])) - exact) / verdict.tolerance[row]
            assert off <= 2.0


def settled(pairs, found):
    """Return the faults of a row each, by name."""
    verdict = judge.judge(*pairs, found)
    verdict.settle(found, lambda row: judge.exact_gap(*(part[row] for part in pairs)))
    return [{text for bit, text in judge.GATES.items() if faults & bit}
            for faults in verdict.faults]


@pytest.mark.parametrize('name', fuzz.CLASSES)
def test_planted_faults_are_found(name):
    """Every gate, each on a row of its own."""
    pairs = drawn(name)
    found = answers(pairs)
    size = np.maximum(pairs[2], pairs[3]).max(axis=1)
    deep = np.flatnonzero(found[0] & (found[1] < -1e-6 * size)
                          & (np.abs(pairs[0][:, :3]).max(axis=1) < 20.0))[:7]
    apart = np.flatnonzero(~found[0] & (found[1] > 1e-6 * size))[0]
    assert all(not faults for faults in settled(pairs, found))
    found[0][deep[0]] = False
    found[1][deep[0]] = 1.0
    found[0][apart], found[2][apart], found[3][apart] = True, (0.0, 0.0, 1.0), pairs[0][apart, :3]
    found[1][apart] = -1e-3 * size[apart]
    found[1][deep[1]] *= 1.0 + 1e-3
    found[1][deep[2]] *= 1.0 - 1e-3
    found[2][deep[3]] *= -1.0
    found[2][deep[4]] *= 1.0 + 1e-9
    found[3][deep[5]] += 2.0 * size[deep[5]]
    found[3][deep[6], 1] = np.nan
    faults = settled(pairs, found)
    for row, expected in ((deep[0], 'missed contact'), (apart, 'phantom contact'),
                          (deep[1], 'too deep'), (deep[2], 'too shallow'),
                          (deep[3], 'wrong axis'), (deep[4], 'normal not unit'),
                          (deep[5], 'point outside'), (deep[6], 'NaN')):
        assert expected in faults[row]
    assert sum(map(bool, faults)) == 8


def test_a_fault_is_printed_so_that_it_can_be_pasted(monkeypatch):
    """The code that is printed, run, gives the answer that was judged."""
    pairs = drawn('container', 50)

    class Wrong:
        exact_answers = 0

        def batch(self, *poses, **sizes):
            found = ContactSolver((1, 1, 1), (1, 1, 1), model='exact').batch(*poses, **sizes)
            found.separation[found.colliding] *= 1.01
            return found

    tally = fuzz.examine(pairs, 'container', {'exact': Wrong()})[0]
    assert tally.broken > 10 and len(tally.poses) == fuzz.SHOWN
    comment, code = tally.poses[0].split('\n', 1)
    contact = eval(code, {'ContactSolver': ContactSolver})
    assert comment == '# too deep' and contact.colliding


def test_an_exception_is_a_fault():
    class Broken:
        exact_answers = 0

        def batch(self, *poses, **sizes):
            raise ZeroDivisionError('planted')

    tally = fuzz.examine(drawn('cube', 5), 'cube', {'exact': Broken()})[0]
    assert tally.faults['exception'] == 1 and 'planted' in tally.poses[0]


def test_the_program(capsys):
    """A line for each class and model, and 0 at the end of a run without faults."""
    assert fuzz.main(['--pairs', '600', '--workers', '1', '--seed', '3']) == 0
    out = capsys.readouterr().out
    assert out.count('no fault') == len(fuzz.CLASSES) * len(gated_models())
    assert 'all gates at zero' in out


def test_pieces_do_not_depend_on_who_draws_them():
    """One worker or two: the same tallies."""
    one, two = (fuzz.fuzz(2000, seed=5, classes=['cube', 'card'], workers=workers)
                for workers in (1, 2))
    assert one == two
