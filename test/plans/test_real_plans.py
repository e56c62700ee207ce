# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Real pallets, a real ship and random plans: an independent linear programme, and a simulation."""
from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from box_contact_ros import Body, PatchForces, Plan, contacts_of, inspect_plan

pytest.importorskip('clarabel')
random_plans = pytest.importorskip('benchmarks.random_plans')
Upright = pytest.importorskip('benchmarks.upright_statics').Upright

ROOT = Path(__file__).parents[2]
PALLETS = json.loads((ROOT / 'docs/examples/pallets/packing_plans.json').read_bytes())
G = 9.81


def upright(places):
    return np.hstack((places, np.tile([0.0, 0, 0, 1], (len(places), 1))))


def pallet(order):
    """Return the plan of an order; its floor is box 0."""
    items = PALLETS[order]
    size = np.array([[entry['item'][f'{side}/mm'] for side in ('length', 'width', 'height')]
                     for entry in items]) / 1000.0
    turned = [entry['orientation'] == 1 for entry in items]
    size[turned] = size[turned][:, [1, 0, 2]]
    place = np.array([entry['flb_coordinates'] for entry in items]) / 1000.0 + size / 2.0
    masses = [0.0, *(entry['item']['weight/kg'] for entry in items)]
    return Plan(np.vstack(((4, 4, 1), size)), upright(np.vstack(((0, 0, -0.5), place))), masses,
                ground=0)


@pytest.mark.parametrize('order, falls', [
    ('00100408', 1), ('00100001', 33), ('00100002', 26), ('00100003', 13), ('00100004', 27)])
def test_what_falls_on_real_pallets(order, falls):
    """Without neighbours that hold it, as linear programmes find."""
    plan = pallet(order)
    found = random_plans.compare(plan)
    assert found.groups > 1 and not found.faults and not found.on_rim
    assert (~inspect_plan(plan).stands).sum() == falls


@pytest.mark.parametrize('order, falls', [
    ('00100408', 1), ('00100002', 26), ('00100003', 13),
    *(pytest.param(order, falls, marks=pytest.mark.reports)  # 4 and 6 s of CPU
      for order, falls in (('00100001', 38), ('00100004', 29)))])
def test_what_falls_beside_others(order, falls):
    assert (~inspect_plan(pallet(order), sides=True).stands).sum() == falls


@pytest.mark.parametrize('number', range(40))
def test_what_falls_in_random_plans(number):
    """A sample of `python -m benchmarks.fuzz --plans 1000`."""
    found = random_plans.examine(1, number)
    assert found.groups > 0 and not found.faults


def test_a_wrong_verdict_is_found_and_a_rim_is_told():
    """A cube that overhangs by half an edge has loads, on its rim; another millimetre, none."""
    for overhang, wanted in ((0.4998, (1, 0, 0)), (0.49995, (1, 1, 1)), (0.5, (1, 1, 1)),
                             (0.5001, (1, 1, 0))):
        plan = Plan((1, 1, 1), upright([(0, 0, 0), (overhang, 0, 1)]), [0, 10], ground=0)
        assert random_plans.compare(plan) == (*wanted, ())


@pytest.mark.parametrize('stand', [True, False])
def test_planted_verdicts_are_found(stand, monkeypatch, capsys):
    """Where all boxes of all plans stand, each group that falls is a fault; and the reverse.

    Without brakes: between a cone of friction and the pyramids around and in it, both are right.
    """
    monkeypatch.setattr(random_plans, 'MOST_FELT', 0.0)
    found = [random_plans.examine(1, number) for number in range(5)]
    wrong = sum(each.falling if stand else each.groups - each.falling for each in found)
    monkeypatch.setattr(random_plans, 'inspect_plan', lambda plan, **_: SimpleNamespace(
        stands=np.full(len(plan), stand)))
    assert random_plans.fuzz(5) == wrong > 0
    printed = capsys.readouterr().out
    assert printed.count('benchmarks.random_plans.examine(1, ') == wrong
    assert ('robustly' in printed) != stand


@pytest.mark.parametrize('order, count', [
    ('00100408', 25), ('00100001', 7), ('00100002', 6), ('00100003', 16), ('00100004', 21)])
def test_unique_loads_are_those_of_a_simulation(order, count):
    """Of what stands, after a second of PatchForces; and loads are within their ranges.

    Of two pallets so much falls that no more than 7 and 6 loads are left, all unique.
    """
    plan = pallet(order)
    while not (found := inspect_plan(plan)).sound:  # what falls may have held others down
        kept = np.flatnonzero(found.stands)
        plan = Plan(plan.sizes[kept], plan.poses[kept], plan.masses[kept], ground=0)
    loads = dict(zip(map(tuple, found.carried_by.tolist()), found.loads / G))
    independent = Upright(plan.sizes, plan.poses, plan.masses, np.arange(len(plan)) == 0)
    ranges = {pair: ends for boxes in independent.groups()
              for pair, ends in independent.ranges(boxes).items()}
    assert all(low - 0.01 <= loads[pair] <= high + 0.01 for pair, (low, high) in ranges.items())

    forces = PatchForces([Body.fixed(), *(
        Body.of_box(size, mass) for size, mass in zip(plan.sizes[1:], plan.masses[1:]))])
    forces.set_boxes(plan.sizes)
    forces.hold(found.carried_by)
    poses, velocities, weights = plan.poses, np.zeros((len(plan), 6)), np.zeros((len(plan), 6))
    weights[:, 2] = -G * plan.masses
    for _ in range(1000):
        poses, velocities, *_ = forces.advance(1e-3, poses, velocities, weights)[:3]
    simulated = forces.loads()
    unique = 0
    for pair, force in zip(simulated.pairs.tolist(), simulated.pressing):
        pair = tuple(pair) if tuple(pair) in loads else tuple(pair[::-1])
        low, high = ranges.get(pair, (0.0, np.inf))
        if high - low < 0.01:
            unique += 1
            assert force / G == pytest.approx(loads[pair], abs=0.1)
    assert unique == count


@pytest.fixture(scope='module')
def ship():
    """Return 1,936 containers of 20 t, with a slab under each that has none below it.

    Where the containers of a real ship stand: msayyes-app/Baplie-Dual-Viewer (8537654).
    """
    with np.load(Path(__file__).with_name('ship.npz')) as file:  # in half millimetres
        size, place = file['sizes'] / 2000.0, file['places'] / 2000.0
    pairs, contacts = contacts_of(size, upright(place), tolerance=1e-4)
    upper = pairs[np.arange(len(pairs)), np.where(contacts.normal[:, 2] > 0, 1, 0)]
    lowest = np.setdiff1d(np.arange(len(size)), upper[np.abs(contacts.normal[:, 2]) > 0.9])
    below = place[lowest] - [0, 0, 0.05] - size[lowest] * [0, 0, 0.5]
    slab = np.column_stack((size[lowest, :2], np.full(len(lowest), 0.1)))
    return Plan(np.vstack((size, slab)), upright(np.vstack((place, below))),
                np.repeat((20e3, 0.0), (len(size), len(slab))),
                ground=len(size) + np.arange(len(slab)), limits=np.repeat(
                    (192e3, np.inf), (len(size), len(slab))))


@pytest.mark.parametrize('bears', ['faces', 'corners'])
def test_what_falls_on_a_real_ship(ship, bears):
    """18 forty-footers on one twenty-footer, whose centre is 38 mm outside, and 65 above them."""
    found = inspect_plan(ship, bears=bears)
    causes = dict(zip(*map(np.ndarray.tolist, np.unique(found.cause, return_counts=True))))
    assert causes.pop('') == len(ship) - 83
    assert causes == {'unsupported': 18, 'goes with what falls': 65}
    outside = found.cause == 'unsupported'
    if bears == 'faces':
        assert found.margin[outside] == pytest.approx(-0.038, abs=1e-6)
    assert found.load[ship.ground].sum() == pytest.approx(
        G * 20e3 * 1936, rel=0.05)  # but for what begins to fall
