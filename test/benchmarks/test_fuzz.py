# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The fuzz, a short run of it; and its judge, which finds every fault that is planted."""
from __future__ import annotations

import csv

import numpy as np
import oracle
import pytest
from gmpy2 import mpfr

from benchmarks import fuzz, judge
from benchmarks.pose_sets import Pairs
from box_contact_ros import ContactSolver

pytestmark = pytest.mark.reports

SEED = 20260


def drawn(name, n=400):
    return fuzz.draw(name, np.random.default_rng([SEED, 7]), n)


def answers(pairs):
    a, b, size_a, size_b = pairs
    return ContactSolver().batch(a, b, size_a=size_a, size_b=size_b)


@pytest.mark.parametrize('amount', [
    ['--pairs', '12000', '--workers', '1'], pytest.param(['--quick'], marks=pytest.mark.reports)])
def test_gates_are_at_zero(amount, tmp_path, capsys):
    """2,000 pairs a class, or 10,000; the CSV has a row for each class and model."""
    assert fuzz.main([*amount, '--seed', str(SEED), '--out', str(tmp_path)]) == 0, (
        capsys.readouterr().out)
    assert capsys.readouterr().out.count('no fault') == len(fuzz.CLASSES) * len(fuzz.MODELS)
    with (tmp_path / 'fuzz.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [(row['class'], row['model']) for row in rows] == [
        (name, model) for name in fuzz.CLASSES for model in fuzz.MODELS]
    for row in rows:
        assert all(row[gate] == '0' for gate in fuzz.GATES.values())
        assert int(row['contacts']) > int(row['pairs']) / 3
        assert 0 < int(row['near_touch']) < 0.05 * int(row['pairs'])
        assert float(row['worst_depth_by_tolerance']) <= 1.0


FOUND = (
    ((2.174385854802605, 1.7423444865568714, 0.018359584513697198),
     (0.3285916961368096, 1.9737782818419705, 2.249013888475856),
     (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.001),
     (-0.9661190733016685, 0.7043735812224385, -0.868164791886224, 0.9379606111123887,
      -0.07905910332264629, 0.029043985626381868, -0.33635694891354684)),
    ((0.9027071194252946, 0.009173512037271597, 0.032544240127844196),
     (0.001539321248840585, 1.6685102645855436, 0.012604139436660758),
     (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
     (0.5783181994663252, -0.01304447153503672, 0.5848927855700055, 0.2653662666841818,
      0.653231693671417, 0.6584996879522708, -0.2631487409356848)),
    ((0.030564828219958404,) * 3, (0.030564828219958404,) * 3,
     (40447.70247700687, 187829.60454168968, -118208.32766634913, 0.7734375846689708,
      0.6138048268957524, 0.09548148507679807, 0.12618012168500645),
     (40447.721512345306, 187829.6003642818, -118208.28908367682, -0.5237715711153959,
      0.47986669473710386, 0.3451475039495857, 0.6150329235827783)))
"""Sizes and poses of which a fuzz of ten million found faults: a variance below zero, twice, and a
needle a thousand-millionth as wide as it is long."""


def test_found_poses_have_no_variance_below_zero():
    size_a, size_b, pose_a, pose_b = (np.array(column) for column in zip(*FOUND))
    pairs = Pairs(pose_a, pose_b, size_a, size_b)
    for model in ('exact', 'mlp'):
        found = pairs.contacts(ContactSolver(model=model))
        assert found.colliding.all()
        assert not fuzz.patch_faults(pairs, found).any()
    assert not fuzz.mlp_faults(pairs, found).any()


@pytest.mark.parametrize('name', fuzz.CLASSES)
def test_the_judges_gap_is_the_oracles(name):
    """In 60 digits to the bit; in float64 to its tolerance, or it says that it is not sure."""
    pairs = drawn(name, 60)
    found = answers(pairs)
    verdict = judge.judge(*pairs, found)
    for row, (a, b, size_a, size_b) in enumerate(zip(*pairs)):
        exact = oracle.separation(oracle.make_box(a, size_a), oracle.make_box(b, size_b))
        assert judge.exact_gap(a, b, size_a, size_b) == float(exact)
        if found.colliding[row] and not verdict.doubtful[row]:
            off = abs(mpfr(float(found.separation[row])) - exact) / verdict.tolerance[row]
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
    deep = np.flatnonzero(found.colliding & (found.separation < -1e-6 * size)
                          & (np.abs(pairs[0][:, :3]).max(axis=1) < 20.0))[:7]
    apart = np.flatnonzero(~found.colliding & (found.separation > 1e-6 * size))[0]
    assert all(not faults for faults in settled(pairs, found))
    found.colliding[deep[0]] = False
    found.separation[deep[0]] = 1.0
    found.colliding[apart], found.normal[apart] = True, (0.0, 0.0, 1.0)
    found.point[apart] = pairs[0][apart, :3]
    found.separation[apart] = -1e-3 * size[apart]
    found.separation[deep[1]] *= 1.0 + 1e-3
    found.separation[deep[2]] *= 1.0 - 1e-3
    found.normal[deep[3]] *= -1.0
    found.normal[deep[4]] *= 1.0 + 1e-9
    found.point[deep[5]] += 2.0 * size[deep[5]]
    found.point[deep[6], 1] = np.nan
    faults = settled(pairs, found)
    for row, expected in ((deep[0], 'missed contact'), (apart, 'phantom contact'),
                          (deep[1], 'too deep'), (deep[2], 'too shallow'),
                          (deep[3], 'wrong axis'), (deep[4], 'normal not unit'),
                          (deep[5], 'point outside'), (deep[6], 'NaN')):
        assert expected in faults[row]
    assert sum(map(bool, faults)) == 8


def test_planted_faults_of_patches_are_found():
    """A negative eigenvalue, a volume of 0, half a patch."""
    pairs = drawn('container')
    found = pairs.contacts()
    rows = np.flatnonzero(found.colliding)[:3]
    assert not fuzz.patch_faults(pairs, found).any()
    found.covariance[rows[0]] = np.diag([1.0, 1.0, -1e-5])
    found.volume[rows[1]] = 0.0
    found.covariance[rows[2], 1, 1] = np.nan
    faults = fuzz.patch_faults(pairs, found)
    assert faults[rows].tolist() == [judge.NEGATIVE, judge.NEGATIVE, judge.NOT_FINITE]
    assert np.count_nonzero(faults) == 3


def test_planted_answers_are_outside_their_bounds():
    """A point by a depth, a volume by its double; the rest keeps its verdict."""
    pairs, found = answered_by_mlp()
    rows = np.flatnonzero(found.colliding)[:2]
    found.point[rows[0]] += 10.0 * found.separation[rows[0]] * found.normal[rows[0]]
    found.volume[rows[1]] *= 1e3
    faults = fuzz.mlp_faults(pairs, found)
    assert (faults[rows] == judge.OUT_OF_BOUNDS).all() and np.count_nonzero(faults) == 2


def test_a_covariance_of_mlp_is_judged_to_rounding():
    pairs, found = answered_by_mlp()
    found.covariance[found.colliding] = np.diag([1.0, 1.0, -1e-13])
    assert (fuzz.mlp_faults(pairs, found)[found.colliding] == judge.NEGATIVE).all()
    assert not fuzz.patch_faults(pairs, found).any()


def answered_by_mlp():
    """Pairs and sound contacts of `mlp`."""
    pairs = drawn('container')
    found = pairs.contacts(ContactSolver(model='mlp'))
    assert found.colliding.sum() > 200 and not fuzz.mlp_faults(pairs, found).any()
    return pairs, found


def test_random_weights_break_no_gate(tmp_path, monkeypatch, capsys):
    """What model `mlp` guarantees holds for 24 networks, 1,250 pairs each."""
    monkeypatch.setattr(fuzz, 'PIECE', 1_250)
    assert fuzz.main(['--pairs', '30000', '--models', 'mlp', '--random-weights', '--workers', '1',
                      '--seed', str(SEED), '--out', str(tmp_path)]) == 0, capsys.readouterr().out
    with (tmp_path / 'fuzz_random_weights.csv').open() as file:
        assert [row['model'] for row in csv.DictReader(file)] == ['mlp'] * len(fuzz.CLASSES)


def test_a_fault_of_random_weights_names_them(monkeypatch):
    """Another network answers each piece; the one that is named gives the judged answer."""
    monkeypatch.setattr(fuzz, 'mlp_faults', lambda pairs, found: np.where(
        found.colliding, judge.NEGATIVE, 0))
    first, second = (fuzz._piece(('cube', 5, number, 50, ('mlp',), True))[0] for number in (0, 1))
    words, _, code = first.poses[0].split('\n', 2)
    assert words == '# mlp is RandomMlp(5, 0, 0)' and 'ContactSolver' in code
    assert second.poses[0].startswith('# mlp is RandomMlp(5, 0, 1)')
    pairs = fuzz.draw('cube', np.random.default_rng((5, 0, 0)), 50)
    points = [pairs.contacts(fuzz.RandomMlp(5, 0, number)).point for number in (0, 0, 1, 2, 3)]
    np.testing.assert_array_equal(points[0], points[1])
    # Some with large weights end at the same bounds.
    assert not all(np.array_equal(points[0], other, equal_nan=True) for other in points[2:])


def test_a_fault_is_printed_so_that_it_can_be_pasted(monkeypatch):
    """The code that is printed, run, gives the answer that was judged."""
    pairs = drawn('container', 50)

    class Wrong:
        def batch(self, *poses, **sizes):
            found = ContactSolver().batch(*poses, **sizes)
            found.separation[found.colliding] *= 1.01
            return found

    tally = fuzz.examine(pairs, 'container', {'exact': Wrong()})[0]
    assert tally.faults.total() > 10 and len(tally.poses) == fuzz.SHOWN
    assert tally.faults['changed by a swap'] == tally.faults['not its single call'] == 0
    comment, code = tally.poses[0].split('\n', 1)
    contact = eval(code, {'ContactSolver': ContactSolver})
    assert comment == '# too deep' and contact.colliding


def test_an_exception_is_a_fault():
    class Broken:
        def batch(self, *poses, **sizes):
            raise ZeroDivisionError('planted')

    tally = fuzz.examine(drawn('cube', 5), 'cube', {'exact': Broken()})[0]
    assert tally.faults['exception'] == 1 and 'planted' in tally.poses[0]


@pytest.mark.parametrize('fault', ['changed by a swap', 'not its single call'])
def test_planted_bits_are_found(fault):
    """The last bit of a separation, of pairs the other way round, or of batches."""
    pairs = drawn('cube', 100)

    class Wrong:
        def batch(self, pose_a, pose_b, size_a, size_b):
            found = Pairs(pose_a, pose_b, size_a, size_b).contacts()
            if fault == 'changed by a swap' and np.array_equal(pose_a, pairs.pose_b):
                found.separation[0] = np.nextafter(found.separation[0], 1.0)
            if fault == 'not its single call' and len(pose_a) == 1:
                found.separation[:] = np.nextafter(found.separation, 1.0)
            return found

    tally, = fuzz.examine(pairs, 'cube', {'exact': Wrong()})
    assert tally.faults.total() == tally.faults[fault] == (1 if 'swap' in fault else 2)


def test_pieces_do_not_depend_on_who_draws_them():
    """One worker or two: the same tallies, and digests of what they answered."""
    one, two = (fuzz.fuzz(2000, seed=5, classes=['cube', 'card'], workers=workers)
                for workers in (1, 2))
    assert one == two
    assert one['cube', 'mlp'].digest == one['cube', 'exact'].digest
