# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ways of boxes into their places: cases by hand, and a slow loop over each two boxes."""
from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from box_contact_ros import Plan, inspect_plan
from box_contact_ros.plans import inspect_files
from box_contact_ros.plans import inspect_plan as module
from box_contact_ros.plans.room import walls
from box_contact_ros.plans.ways import SIDES
from box_contact_ros.solver.contacts_of import TooManyNear

random_orders = pytest.importorskip('benchmarks.random_orders')

LEVEL = (0.0, 0.0, 0.0, 1.0)


def yaw(degrees):
    half = np.radians(degrees) / 2
    return 0.0, 0.0, np.sin(half), np.cos(half)


def plan_of(order, *boxes, **fields):
    """Return a plan of boxes (size, x, y, z, quaternion), without masses, on a floor: the last."""
    boxes = [(*box, LEVEL)[:5] for box in (*boxes, ((9, 9, 1), 0, 0, -0.5))]
    return Plan([size for size, *_ in boxes], [(x, y, z, *turn) for _, x, y, z, turn in boxes],
                ground=len(boxes) - 1, order=[*order, 0], **fields)


def blocked(plan, side, **options):
    return inspect_plan(plan, loaded_from=side, **options).ways.tolist()


CUBE = (1, 1, 1)
ROW = [(CUBE, x, 0, 0.5) for x in (-1, 0, 1)]
"""Three cubes, flush."""


@pytest.mark.parametrize(('order', 'side', 'wanted'), [
    ([1, 3, 2], 'above', []), ([1, 3, 2], '+y', []), ([1, 2, 3], '+x', []), ([3, 2, 1], '-x', []),
    ([3, 2, 1], '+x', [[1, 2], [0, 2], [0, 1]]), ([1, 2, 2], '-x', [[1, 0], [2, 0]]),
    ([1, 3, 2], '-x', [[2, 0], [1, 0]])])
@pytest.mark.parametrize('start', [0, 500])
def test_flush_boxes_are_no_obstacle(order, side, wanted, start):
    """By the steps of what comes; what it meets first comes first. Those of a step do not block."""
    plan = plan_of(order, *ROW)
    plan = replace(plan, poses=plan.poses + np.eye(7)[0] * start)
    assert blocked(plan, side) == wanted


def test_what_blocks_is_named():
    found = inspect_plan(plan_of([3, 2, 1], *ROW, names=['a', 'b', 'c', 'floor']),
                         loaded_from='+x')
    assert found.verdict == 'not sound' and found.loaded_from == '+x'
    assert [str(row).split(maxsplit=2) for row in found.rows()] == [
        ['way', 'b', 'step 2: the way of b from +x is blocked by c'],
        ['way', 'a', 'step 3: the way of a from +x is blocked by c and 1 more']]
    assert found.verdicts.tolist() == ['way', 'way', 'sound', 'ground']


def test_a_box_below_a_bridge_does_not_come_from_above():
    """It does from beside, unless it is as wide as the gap and deeper than tolerance in a post."""
    posts = [((1, 1, 1), x, 0, 0.5) for x in (-1, 1)]
    bridge = ((3, 1, 0.1), 0, 0, 1.05)
    for width, free in ((0.9, True), (1.0, True), (1.00015, True), (1.0005, False)):
        plan = plan_of([1, 1, 2, 3], *posts, bridge, ((width, 1, 0.9), 0, 0, 0.45))
        assert blocked(plan, 'above') == [[3, 2]]
        # What overlaps at its place is told as that, and is no obstacle.
        assert blocked(plan, '-y') == [] and len(inspect_plan(plan).overlaps) == 2 * (not free)


@pytest.mark.parametrize(('degrees', 'gap', 'wanted'), [
    (0, 0.05, []), (45, 0.05, [[1, 0]]), (45, 0.3, []), (30, 0.05, [[1, 0]])])
@pytest.mark.parametrize('side', ['+x', '-x', '+y', '-y'])
def test_a_turned_box_sweeps_more(degrees, gap, wanted, side):
    """Past a cube, by a gap beside it; in the world's frame for all four sides."""
    plan = plan_of([1, 2], (CUBE, 2, 1 + gap, 0.5), (CUBE, 0, 0, 0.5, yaw(degrees)))
    angle = {'+x': 0, '+y': 90, '-x': 180, '-y': 270}[side]
    turn = np.radians(angle)
    frame = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    poses = plan.poses.copy()
    poses[:, :3] = plan.poses[:, :3] @ frame.T
    poses[:2, 3:] = [yaw(angle), yaw(degrees + angle)]
    assert blocked(replace(plan, poses=poses), side) == wanted


def test_stacks_and_fixed_boxes():
    """Boxes of another stack are not there; fixed ones are, whatever their order is."""
    plan = plan_of([1, 1, 2], *ROW, stack=[0, 1, 0, 0])
    assert blocked(plan, '-x') == [[2, 0]]
    assert blocked(replace(plan, ground=[1, 3], order=[1, 9, 2, 0]), '-x') == [[2, 0], [2, 1]]
    # A wall beyond all boxes of the stack is not on the way, nor what is apart from a box.
    wall = ((0.1, 9, 9), 4, 0, 0)
    assert blocked(replace(plan_of([1, 1, 1, 0], *ROW, wall), ground=[3, 4]), '+x') == []
    assert blocked(replace(plan, apart=[(2, 0)]), '-x') == []


def test_boxes_of_a_body_do_not_block_each_other():
    plan = plan_of([2, 1, 2], *ROW, body=[0, 1, 0, 2])
    assert blocked(plan, '+x') == [[0, 1]]


@pytest.mark.parametrize('tolerance', [0.0, 1e-6, 1e-3, 0.5, None])
@pytest.mark.parametrize('degrees', [0, 30])
def test_any_tolerance_lets_flush_boxes_pass(tolerance, degrees):
    """Cubes in a row that is turned by itself, from above and along the row."""
    turn = yaw(degrees)
    along = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    boxes = [(CUBE, *(x * along), 0.5, turn) for x in (-1, 0, 1)]
    for side in ('above', '+y'):
        assert blocked(plan_of([1, 3, 2], *boxes), side, tolerance=tolerance) == (
            [[1, 2]] if degrees and side == '+y' and tolerance != 0.5 else [])


@pytest.mark.parametrize('number', [
    *range(12), *(pytest.param(number, marks=pytest.mark.reports) for number in range(12, 40))])
def test_ways_are_those_of_a_loop(number):
    """A sample of `python -m benchmarks.fuzz --orders 500`, every second one turned."""
    found = random_orders.examine_ways(1, number)
    assert not found.faults


def test_the_loop_has_ways_that_are_blocked():
    assert sum(random_orders.examine_ways(1, number).blocked for number in range(5)) > 50


@pytest.mark.parametrize(('plan', 'side', 'words'), [
    (plan_of([1], ROW[0]), 'below', r"loaded_from must be one of above, \+x, .*, not 'below'"),
    (Plan(CUBE, [(0, 0, 0, *LEVEL)]), '+x', r"loaded_from is '\+x', but the plan has no order")])
def test_bad_input_is_refused(plan, side, words):
    with pytest.raises(ValueError, match=f'^{words}'):
        inspect_plan(plan, loaded_from=side)


@pytest.mark.parametrize('side', SIDES)
def test_little_is_an_answer(side):
    for plan in Plan([], [], order=[]), plan_of([]), plan_of([1], ROW[0]):
        assert blocked(plan, side) == []


def test_too_many_on_the_ways_are_not_judged(monkeypatch):
    def refuse(*_):
        raise TooManyNear(0, np.zeros((0, 2), int))
    monkeypatch.setattr(module, 'blocked_ways', refuse)
    found = inspect_plan(plan_of([1, 2, 3], *ROW), loaded_from='+x')
    assert found.verdict == 'not all judged' and 'too many boxes are on the ways' in str(found)


def test_ways_of_a_file(tmp_path, capsys):
    """In text and JSON; an order is needed, and one with a fault is not judged."""
    path = tmp_path / 'p.csv'

    def judge(first, *options):
        path.write_text('name,length,width,height,x,y,z,order\n'
                        f'a,1,1,1,0,0,0.5,{first}\nb,1,1,1,1,0,0.5,1\n', 'utf-8')
        return inspect_files.main([str(path), *options]), capsys.readouterr()

    status, printed = judge(2, '--from', '+x')
    assert status == 1 and 'step 2: the way of a from +x is blocked by b' in printed.out
    assert judge(2, '--from=-x')[0] == judge(2)[0] == judge(2, '--from', 'above')[0] == 0
    document = json.loads(judge(2, '--from', '+x', '--json')[1].out)
    assert document['ways'] == [['a', 'b']] and document['loaded_from'] == '+x'
    assert judge('', '--from', '+x')[0] == 3
    path.write_text(path.read_text('utf-8').replace(',1\n', ',\n'), 'utf-8')
    assert inspect_files.main([str(path), '--from', '+x']) == 2
    assert '--from needs an order' in capsys.readouterr().err


@pytest.mark.parametrize('side', ['above', '+x', '-x', '+y', '-y'])
def test_the_side_of_a_container_that_boxes_come_from_is_open(side):
    """Its wall, or a roof, would block all of them."""
    room = np.array([(0, 0, 0), (1, 1, 1.0)])
    least = [(x, y, z) for z in (0, 0.5) for x in (0, 0.5) for y in (0, 0.5)]
    around = [(size, centre - size / 2) for _, size, centre in walls(*room)]
    around.append((np.array([1, 1, 0.1]), np.array([0, 0, 1.0])))
    order = np.argsort(np.argsort([np.dot(low, SIDES[side]) for low in least], kind='stable'))
    plan = Plan.from_corners(
        [*least, *(low for _, low in around)], [*[(0.5, 0.5, 0.5)] * 8, *(s for s, _ in around)],
        ground=range(8, 14), order=[*order, *[0] * 6], room=room)
    assert len(inspect_plan(plan, loaded_from=side).ways) == 0
    ways = inspect_plan(replace(plan, room=None), loaded_from=side).ways
    assert {*ways[:, 0].tolist()} == {*range(8)}
    assert len({*ways[:, 1].tolist()}) == 1
