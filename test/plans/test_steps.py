# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plans as they are loaded: cases by hand, a slow loop over prefixes, and what steps cost."""
from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from box_contact_ros import Plan, inspect_plan
from box_contact_ros.plans import kept_loads, statics, steps

pytest.importorskip('clarabel')
random_orders = pytest.importorskip('benchmarks.random_orders')

LEVEL = (0.0, 0.0, 0.0, 1.0)
FLOOR = ((50, 50, 1), (0, 0, -0.5))
MOST_TIMES, MOST_MEMORY = 12.0, 500 * 2**20
"""That a plan with an order may take: times that of one without, and memory [bytes]."""


def plan_of(order, *boxes, masses=10.0, **fields):
    """Return a plan of boxes (size, place) on a floor, which is the last one."""
    sizes, places = zip(*boxes, FLOOR)
    return Plan(sizes, [(*place, *LEVEL) for place in places], masses, ground=len(boxes),
                order=[*order, 0], names=[*'abcdefgh'[:len(boxes)], 'floor'], **fields)


def falls(found):
    return [(fall.step, found.plan.names[fall.box], fall.cause, fall.until)
            for fall in found.steps]


def cube(x, z, size=(1, 1, 1)):
    return size, (x, 0, z)


PLANK = (3, 1, 0.1)
SLOW = (9, 21)  # 8 and 15 s of CPU, most of it by the loop


def test_what_falls_while_it_is_loaded_is_not_called_sound():
    """Nor is it hidden with what is; a box that falls in the whole plan has its cause."""
    found = inspect_plan(plan_of([1, 3, 2], cube(-1, 0.5), cube(1, 0.5), cube(0, 1.05, PLANK)))
    assert found.verdicts.tolist() == ['sound', 'sound', 'step', 'ground']
    found = inspect_plan(plan_of([1], cube(0, 2.5)))
    assert found.verdicts.tolist() == ['hangs', 'ground']


@pytest.mark.parametrize(('order', 'boxes', 'wanted', 'text'), [
    ([1, 2], [cube(0, 0.5), cube(0, 1.5)], [], ''),
    ([2, 1], [cube(0, 0.5), cube(0, 1.5)], [(1, 'b', 'hangs', 2)],
     'step 1: b hangs until a comes'),
    # A plank on two posts, of which one comes after it.
    ([1, 3, 2], [cube(-1, 0.5), cube(1, 0.5), cube(0, 1.05, PLANK)],
     [(2, 'c', 'unsupported', 3)], 'step 2: c is unsupported until b comes'),
    # A plank that overhangs, until 30 kg are on its inner end; a box beside them comes too.
    ([1, 2, 5, 5], [cube(0, 0.5), cube(0.6, 1.5, (2, 1, 1)), cube(-0.1, 2.5, (0.6, 1, 1)),
                    cube(9, 0.5)],
     [(2, 'b', 'unsupported', 5)], 'step 2: b is unsupported until c and 1 more come'),
    # All of a step come together, in any order; the plank never comes alone.
    ([7, 7, 7], [cube(-1, 0.5), cube(1, 0.5), cube(0, 1.05, PLANK)], [], ''),
    # What goes with another one stands again with it.
    ([1, 4, 2, 3], [cube(-1, 0.5), cube(1, 0.5), cube(0, 1.05, PLANK), cube(0, 1.6)],
     [(2, 'c', 'unsupported', 4), (3, 'd', 'goes with what falls', 4)],
     'step 3: d goes with what falls until b comes')])
def test_steps_by_hand(order, boxes, wanted, text):
    masses = [10, 10, 30, 10][:len(boxes)] + [0]
    found = inspect_plan(plan_of(order, *boxes, masses=masses))
    assert falls(found) == wanted and not found.cause.any()
    assert found.verdict == ('not sound' if wanted else 'sound')
    assert [row.kind for row in found.rows()] == ['step'] * len(wanted) and text in str(found)


def test_what_falls_in_the_whole_plan_is_told_once():
    """With the step from which on it falls, which is not the one at which it came."""
    found = inspect_plan(plan_of([1, 2, 3], cube(0, 0.5), cube(0.3, 1.5), cube(0.7, 2.5),
                                 masses=[10, 10, 30, 0]))
    assert falls(found) == [(3, 'b', 'tips under its load', None),
                            (3, 'c', 'goes with what falls', None)]
    assert [row.kind for row in found.rows()] == ['tips under its load', 'goes with what falls']
    assert str(found).count(', from step 3 on\n') == 1


def test_a_box_may_fall_twice():
    """A plank on one post; 40 kg on its inner end, then 60 on the outer one, then a post there."""
    found = inspect_plan(plan_of(
        [1, 2, 3, 4, 5], cube(0, 0.5), cube(0.6, 1.05, (2, 1, 0.1)), cube(-0.1, 1.6, (0.5, 1, 1)),
        cube(1.3, 1.6, (0.5, 1, 1)), cube(1.3, 0.5, (0.5, 1, 1)), masses=[10, 10, 40, 60, 10, 0]))
    assert [fall for fall in falls(found) if fall[1] == 'b'] == [
        (2, 'b', 'unsupported', 3), (4, 'b', 'unsupported', 5)]


def test_stacks_are_loaded_each_by_itself():
    """The lower box of each stack comes first in it; fixed boxes are there from the start."""
    boxes = [cube(0, 0.5), cube(0, 1.5), cube(5, 0.5), cube(5, 1.5)]
    plan = plan_of([3, 4, 1, 2], *boxes, stack=[0, 0, 1, 1, 7])
    assert inspect_plan(plan).sound
    # A box of another stack carries nothing: it is never there.
    beside = inspect_plan(replace(plan, stack=[0, 1, 1, 1, 7]))
    assert falls(beside) == [(4, 'b', 'hangs', None)] and beside.verdict == 'not sound'
    assert 'step 4: b hangs' in str(beside)


def test_bodies_come_as_a_whole():
    boxes = [cube(0, 0.5), cube(0.7, 1.5), cube(0.9, 2.5)]
    assert inspect_plan(plan_of([1, 1, 2], *boxes, masses=[10, 1, 1, 0], body=[0, 0, 1, 2])).sound
    for name in 'order', 'stack':
        with pytest.raises(ValueError, match=rf'^{name}\[1\] is 2, and 1 of {name}\[0\], a box of '
                                             'the same body'):
            replace(plan_of([1, 1, 2], *boxes, body=[0, 0, 1, 2]), **{name: [1, 2, 2, 2]})


def test_without_an_order_or_ground_there_are_no_steps():
    plan = plan_of([2, 1], cube(0, 0.5), cube(0, 1.5))
    assert inspect_plan(replace(plan, order=None)).steps == ()
    assert inspect_plan(replace(plan, ground=())).steps == ()


def test_a_load_on_what_falls_may_hold_it():
    """A bridge from a post to a plank that overhangs; 60 kg on the bridge hold the plank down."""
    plan = plan_of([1, 2, 1, 3, 4], cube(0, 0.5), cube(0.6, 1.05, (2, 1, 0.1)),
                   cube(-1.5, 0.55, (1, 1, 1.1)), cube(-0.8, 1.15, (1.6, 1, 0.1)),
                   cube(-0.2, 1.35, (0.3, 1, 0.3)), masses=[10, 10, 10, 1, 60, 0])
    assert falls(inspect_plan(plan)) == [(2, 'b', 'unsupported', 4),
                                         (3, 'd', 'goes with what falls', 4)]
    assert not random_orders.compare(plan, {}).faults


def test_what_overlaps_a_box_does_not_carry_it_beside_another():
    """A plank on two posts, of which one reaches 1 mm into it."""
    boxes = [cube(-1, 0.5), cube(1, 0.5005, (1, 1, 1.001)), cube(0, 1.05, PLANK)]
    found = inspect_plan(plan_of([1, 2, 3], *boxes))
    assert falls(found) == [(3, 'c', 'unsupported', None)] and found.cause[2] == 'unsupported'


@pytest.mark.parametrize(('degrees', 'cause'), [(20, []), (30, ['slides', 'slides'])])
def test_on_a_slope_boxes_stand_by_friction(degrees, cause):
    """Two cubes beside each other, in a frame that is tilted."""
    tilt = np.radians(degrees)
    found = inspect_plan(plan_of([1, 2], cube(0, 0.5), cube(5, 0.5)), friction=0.5,
                         acceleration=(9.81 * np.sin(tilt), 0, -9.81 * np.cos(tilt)))
    assert [fall.cause for fall in found.steps] == cause


def test_what_friction_holds_is_asked_anew(monkeypatch):
    """Two cubes lean over an edge by 2 cm, held by the stone across them.

    A box within the edge needs nothing of the friction. One beyond it does, though all that is on
    the cube is within the edge by then.
    """
    asked = []
    solve = steps._Loading._solve
    monkeypatch.setattr(steps._Loading, '_solve', lambda self, group, step: (
        asked.append(step), solve(self, group, step)))
    boxes = [cube(x, 0.5) for x in (-1.5, 1.5)] + [
        cube(-0.98, 1.5), cube(0.98, 1.5), cube(0, 2.5, (1.98, 1, 1)),
        cube(-1.2, 2.1, (0.3, 1, 0.2)), cube(-0.993, 2.05, (0.004, 1, 0.1))]
    sizes, places = zip(*boxes)
    plan = Plan(sizes, [(*place, *LEVEL) for place in places], [0, 0, 10, 10, 2, 5, 0.1],
                ground=[0, 1], order=[0, 0, 1, 1, 1, 2, 3])
    assert inspect_plan(plan).sound and asked == [1, 3]


def test_no_patch_pulls():
    """A plank on three posts, of which one is on a board that overhangs.

    11 kg above it tip the board. By a bed that pulls at the third post, they would not.
    """
    post = (0.02, 1, 2.1)
    plan = plan_of([*range(7)], cube(-1.75, 0.5, (0.5, 1, 1)), cube(-1.6, 1.05, (1.5, 1, 0.1)),
                   cube(-1, 1.6, (0.02, 1, 1)), cube(0, 1.05, post), cube(1, 1.05, post),
                   cube(0, 2.15, (2.5, 1, 0.1)), cube(-0.9, 2.3, (0.2, 1, 0.2)),
                   masses=[10, 50, 1, 1, 30, 1, 11, 0])
    found = inspect_plan(plan)
    assert [fall[:2] for fall in falls(found)][0] == (6, 'b')
    assert not random_orders.compare(plan, {}).faults


@pytest.mark.parametrize('number', [
    pytest.param(number, marks=pytest.mark.reports) if number in SLOW or number > 11 else number
    for number in range(30)])
def test_steps_are_those_of_a_loop(number):
    """A sample of `python -m benchmarks.fuzz --orders 500`."""
    found = random_orders.compare(*random_orders.draw(1, number))
    assert found.steps > 0 and not found.faults


def bricks(count):
    """Return layers of boxes by thirds, from below, which share their loads among up to four."""
    size, places = np.array((0.3, 0.2, 0.2)), []
    for layer in range(count):
        for row in range(10):
            places += [((column + 0.5 + layer % 2 / 3) * 0.3, (row + 0.5 + layer % 2 / 3) * 0.2,
                        (layer + 0.5) * 0.2) for column in range(10)]
    masses = np.random.default_rng(1).uniform(1, 10, len(places))
    return Plan([*[size] * len(places), (9, 9, 1)],
                [(*place, *LEVEL) for place in [*places, (1, 1, -0.5)]], [*masses, 0],
                ground=len(places), order=[*range(len(places)), 0])


def column(count):
    """Return towers, whose boxes have one carrier each."""
    plan = bricks(count)
    places = plan.poses.copy()
    layer = np.arange(len(plan) - 1) // 100
    places[:-1, :2] -= (layer % 2 / 3)[:, None] * plan.sizes[:-1, :2]
    return replace(plan, poses=places)


@pytest.mark.parametrize('make, weighed', [
    pytest.param(bricks, True, marks=pytest.mark.reports), (bricks, False), (column, True),
    (column, False)])
def test_what_stands_takes_little_more_at_each_step(make, weighed, monkeypatch):
    """Of 1,000 boxes no group is solved; a loop would take 500 times the time."""
    plan = make(10)
    plan = plan if weighed else replace(plan, masses=None)
    taken = {True: [], False: []}
    monkeypatch.setattr(steps._Loading, '_solve', None)  # a call would fail
    for order in (None, plan.order) * 4:
        started = time.process_time()
        found = inspect_plan(replace(plan, order=order))
        taken[order is None].append(time.process_time() - started)
        assert found.sound
    assert min(taken[False]) < MOST_TIMES * min(taken[True])  # others use the caches, too


def test_steps_that_take_too_much_are_not_judged(monkeypatch):
    """A post comes below a plank that stands: its group is solved. The box beside is judged."""
    posts = [cube(x, 0.5, (0.2, 1, 1)) for x in (-1, 1, 0)]
    plan = plan_of([1, 2, 4, 3, 5, 6], *posts, cube(0, 1.05, PLANK), cube(0, 1.6), cube(9, 0.5))
    assert inspect_plan(plan).sound
    judge = sys.modules['box_contact_ros.plans.inspect_plan']
    monkeypatch.setattr(judge, 'falls_of', lambda plan, meet, bodies, work: steps.falls_of(
        plan, meet, bodies, statics.Work(1.0)))
    for module, name in ((steps, 'VISIT'), (steps, 'ROW'), (kept_loads, 'VISIT')):
        monkeypatch.setattr(module, name, 0.0)
    found = inspect_plan(plan)
    assert found.verdict == 'not all judged' and not found.steps
    (fault,) = found.plan.faults
    assert fault.names == (*'abcde',) and 'at each step' in fault.text
    # What certainly falls does: the plank, until a post is below its other end, or is not known.
    found = inspect_plan(replace(plan, order=[1, 4, 3, 2, 5, 6, 0]))
    assert falls(found) == [(2, 'd', 'unsupported', None)] and found.verdict == 'not sound'
    assert 'step 2: d is unsupported\n' in str(found)
