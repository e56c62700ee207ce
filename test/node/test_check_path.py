# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""~/check_path: the solver's answers by names, guests, listed pairs, refusals, ticks beside it."""
from __future__ import annotations

import gc
import math
import time
from contextlib import closing
from functools import partial
from typing import Any

import numpy as np
import pytest
from raw_client import ORIGIN, TOUCHING
from ros_client import CUBES, Client, serving
from std_msgs.msg import Header
from typed_messages import a_box, a_pair, answered, joint_state

from box_contact_msgs.srv import CheckPath
from box_contact_ros import Box, Frame, Pair, PathCheck, Scene, SceneSolver
from box_contact_ros.node import check_path
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.scene.scene_check import SceneCheck
from box_contact_ros.solver.checks import TooMuch

CUBE = (2.0, 2.0, 2.0)
EPOCH = 7


def at(x: float, z: float) -> tuple[float, ...]:
    return (x, 0.0, z, 0.0, 0.0, 0.0, 1.0)


YARD = Scene(
    {'load': Box(CUBE), 'beam': Box((6, 2, 1), (0, 0, 1, 0, 0, 0, 1), body='spreader'),
     'foot': Box((1, 2, 1), (2.5, 0, 0, 0, 0, 0, 1), body='spreader'), 'other': Box(CUBE),
     's1': Box(CUBE, at(0, 0)), 's2': Box(CUBE, at(10, 0)), 's3': Box(CUBE, at(10, 2))},
    (Pair('landing', 'load', 's2'),), bodies={'spreader': Frame()}, frame_id='yard',
    patterns=(('load', '*'), ('spreader', 's*')), poses='named')
UP, OVER, DOWN = at(0, 2), at(0, 6), at(10, 3.5)
"""A load is lifted off s1, goes over s2 and s3, and lands on s3."""
WAYPOINTS = [{'load': place, 'spreader': (place[0], 0.0, place[2] + 2.5, *place[3:])}
             for place in (UP, OVER, at(10, 6), DOWN)]


@pytest.fixture(scope='module')
def check() -> SceneCheck:
    return SceneCheck(SceneSolver(YARD), most_near=100)


def a_request(waypoints: Any, sizes: Any = (), **fields: Any) -> CheckPath.Request:
    """Return a request of waypoints, poses by name; sizes: of guests, by name."""
    sizes = dict(sizes)
    return CheckPath.Request(**{
        'header': Header(frame_id='yard'),
        'boxes': [a_box(name, ORIGIN, sizes.get(name, (0, 0, 0))) for name in waypoints[0]],
        'waypoints': [joint_state(dict(reversed(waypoint.items())), '', 0)
                      for waypoint in waypoints], **fields})


def asked(check: SceneCheck, request: CheckPath.Request) -> CheckPath.Response:
    return answered(request, CheckPath.Response(), partial(check_path.answer, check, EPOCH))


def found(check: SceneCheck, *args: Any, **fields: Any) -> list[str]:
    """Return the names of pairs that meet, in the order of time."""
    response = asked(check, a_request(*args, **fields))
    assert response.success, response.message
    return [entry.near.pair for entry in response.impacts]


def assert_is(response: CheckPath.Response, answer: PathCheck) -> None:
    """Hold a response against the solver's answer, number by number."""
    assert response.success, response.message
    assert len(response.impacts) == len(answer.pairs) > 0
    for entry, (pair, impact) in zip(response.impacts, answer.named()):
        assert (entry.near.pair, entry.near.box_a, entry.near.box_b) == (pair.label, pair.a, pair.b)
        assert (entry.time, entry.closing_speed) == (impact.time, impact.closing_speed)
        assert entry.near.distance == impact.nearest.distance
        assert [entry.near.normal.x, entry.near.normal.z] == impact.nearest.normal[[0, 2]].tolist()
        assert entry.near.point_a.z == impact.nearest.point_a[2]
    names = answer.scene.names
    assert [(pair.box_a, pair.box_b) for pair in response.at_start] == [
        (names[a], names[b]) for a, b in answer.at_start.tolist()]
    assert response.least.near.box_a == names[answer.least_pair[0]]
    assert response.least.near.distance == answer.least.nearest.distance
    assert response.least.time == answer.least.time


@pytest.mark.parametrize('clearance', [0.0, 0.25])
def test_it_is_check_path_by_names(check: SceneCheck, clearance: float) -> None:
    """Names of waypoints come in another order than boxes; what is not named is not there."""
    response = asked(check, a_request(WAYPOINTS, clearance=clearance))
    names = check.solver.moving
    path = np.array([[waypoint.get(name, (np.nan,) * 7) for name in names]
                     for waypoint in WAYPOINTS])
    assert_is(response, check.solver.check_path(path, clearance=clearance))
    assert (response.epoch, response.revision, response.header.frame_id) == (EPOCH, 0, 'yard')
    assert [entry.near.pair for entry in response.impacts][-1] == 'load_s3'
    assert ('load', 's1') in {(pair.box_a, pair.box_b) for pair in response.at_start}


def test_nothing_is_kept_of_a_request(check: SceneCheck) -> None:
    """Sizes of its own last for one request, and a box that is not named is not there."""
    way = [{'load': at(0, 4.1)}, {'load': at(20, 4.1)}]
    assert found(check, way) == []
    assert found(check, way, {'load': (2, 2, 2.4)}) == ['load_s3']
    assert found(check, way) == []
    assert found(check, [{**way[0], 'other': at(5, 4)}, {**way[1], 'other': at(5, 4)}]) == [
        'load_other']
    assert found(check, way) == []


def test_guests_meet_all(check: SceneCheck) -> None:
    """They are box A. With listed pairs, those alone are asked for."""
    guest, size = [{'mine': at(-5, 2)}, {'mine': at(25, 2)}], {'mine': CUBE}
    assert found(check, guest, size) == ['mine_s1', 'mine_s2', 'mine_s3']
    assert found(check, guest, size, pairs=[a_pair('s3', 'mine')]) == ['s3_mine']
    both = [{**waypoint, 'spreader': at(x, 0.5)} for waypoint, x in zip(guest, (40, 20))]
    assert found(check, both, size, pairs=[a_pair('spreader', 'mine')]) == [
        'beam_mine', 'foot_mine']
    alone = asked(check, a_request([{'load': at(0, 9)}, {'load': at(0, 8)}],
                                   pairs=[a_pair('load', 's1')]))
    assert alone.least.near.pair == 'load_s1' and alone.least.near.distance == 6.0


NAN_POSE = (np.nan,) * 7
HALF = (*at(0, 9)[:3], 0.0, 0.0, 1.0, 0.0)
LOAD = {'load': at(0, 9)}


@pytest.mark.parametrize('request_, words', [
    (a_request([LOAD]), 'waypoints: a request has 2 to 1000, not 1'),
    (a_request([LOAD] * 1001), 'waypoints: a request has 2 to 1000, not 1001'),
    (a_request([{f'{n}': at(9 * n, 9) for n in range(64)}] * 65, {f'{n}': CUBE for n in range(64)}),
     'waypoints: a request has at most 4096 transforms, not 4160'),
    (a_request([LOAD, {'laod': at(0, 9)}]), "waypoints[1].joint_names must be the names of boxes, "
                                            "each once: ['laod', 'load'] differ"),
    (a_request([LOAD, LOAD], header=Header(frame_id='map')), 'header.frame_id: the scene is in'),
    (a_request([LOAD, {'load': NAN_POSE}]), 'waypoints[1] of load: it is there at some times'),
    (a_request([LOAD, {'load': (*at(0, 9)[:3], 0, 0, 0, 0)}]), 'waypoints[1] of load: quaternion'),
    (a_request([LOAD, {'load': HALF}]), 'waypoints[0] to waypoints[1] of load: a turn by 180'),
    (a_request([{'s1': at(0, 0)}] * 2), "boxes[0] 's1' is fixed in the scene"),
    (a_request([{'beam': at(0, 9)}] * 2), "boxes[0] 'beam' moves with 'spreader'"),
    (a_request([{'mine': at(0, 9)}] * 2), "boxes[0] 'mine' has no size, and is no box"),
    (a_request([LOAD, LOAD], clearance=-1.0), 'clearance must lie within 0 and 1e+50 m, not -1'),
    (a_request([LOAD, LOAD], pairs=[a_pair('load', 'other')]),
     "'other' moves, and its pose is not")
])
def test_what_is_wrong_comes_back_as_text(check: SceneCheck, request_: CheckPath.Request,
                                          words: str) -> None:
    response = asked(check, request_)
    assert not response.success and words in response.message
    assert not response.impacts and not response.at_start and not response.least.near.pair
    assert found(check, [LOAD, {'load': at(0, 1)}]) == ['load_s1']


def test_the_other_crane_stands_where_it_was_last(check: SceneCheck) -> None:
    """Or it is told that it was left out."""
    request = a_request([LOAD, {'load': at(10, 9)}], pairs=[])
    free = asked(check, request)
    assert free.success and free.left_out == 2
    assert sorted(free.left_out_names) == ['other', 'spreader']
    last = {'spreader': at(4, 9), 'other': at(4, 40)}
    met = answered(request, CheckPath.Response(),
                   partial(check_path.answer, check, EPOCH, last=last))
    named = asked(check, a_request([{**LOAD, **last}, {'load': at(10, 9), **last}]))
    assert [entry.near.pair for entry in named.impacts] == [
        entry.near.pair for entry in met.impacts]
    assert met.left_out == named.left_out == 0
    assert found(check, [LOAD, {'load': at(0, 1)}]) == ['load_s1']


def test_it_is_answered_in_steps(check: SceneCheck) -> None:
    """Boxes at one place, which part and come back: some hundred pairs."""
    names = [f'g{n}' for n in range(24)]
    heap, row = dict.fromkeys(names, at(40, 0)), {
        name: at(40 + 3 * n, 9) for n, name in enumerate(names)}
    waypoints = [heap, row, heap]
    request, response = a_request(waypoints, dict.fromkeys(names, CUBE)), CheckPath.Response()
    gc.freeze()  # what other tests left is not looked through
    longest, count, begin = 0.0, 0, time.thread_time()
    for _ in check_path.answer(check, EPOCH, request, response):
        now = time.thread_time()
        longest, count, begin = max(longest, now - begin), count + 1, now
    gc.unfreeze()
    assert len(response.at_start) == len(response.impacts) == 24 * 23 // 2
    assert count > 10 and longest < 0.03


# --- over ROS -------------------------------------------------------------------------------------


def test_ticks_come_first() -> None:
    """At 100 Hz, while a client asks one path after the other, none is lost."""
    ticks, answers, stamps = 100, [], []
    names = [f'g{n}' for n in range(20)]
    waypoints = [dict.fromkeys(names, at(5, 0)),
                 {name: at(5 + 3 * n, 0) for n, name in enumerate(names)}]
    request = a_request(waypoints, dict.fromkeys(names, CUBE), header=Header())
    with serving(ContactNode, **CUBES), closing(Client()) as client:
        client.offer_until_answered(ORIGIN, TOUCHING)
        service = client._client_of(CheckPath, 'contact_node/check_path')
        future = service.call_async(request)
        for _ in range(ticks):
            begin = time.monotonic()
            stamps.append(client.send(ORIGIN, TOUCHING))
            if future.done():
                answers.append(future.result())
                future = service.call_async(request)
            client.spin(lambda begin=begin: time.monotonic() - begin > 0.01)
        assert client.spin(future.done)
        assert client.are_answered(stamps)
    assert all(len(answer.at_start) == 190 for answer in [*answers, future.result()])


def test_a_node_that_is_not_configured_refuses() -> None:
    with serving(ContactNode, autostart=False, **CUBES), closing(Client()) as client:
        answer = client.call(CheckPath, 'contact_node/check_path', CheckPath.Request())
        assert answer.message == 'the node is not configured'


def a_long_way(guests: int, times: int, turn: float = 0.0) -> list[dict[str, tuple[float, ...]]]:
    """Return waypoints of guests side by side over the yard, which turn by an angle each time."""
    return [{f'g{guest}': (300.0 * k / times, 20.0 * guest, 5.0, 0.0, 0.0, math.sin(0.5 * turn * k),
                           math.cos(0.5 * turn * k)) for guest in range(guests)}
            for k in range(times)]


@pytest.mark.parametrize('guests, times, turn, clearance, words', [
    (4, 1000, 0.0, 1000.0, 'more than 4096 pairs come within the clearance of 1000 m'),
    (1, 1000, 0.0, 60.0, ''),
    (4, 1000, 3.0, 15.0, 'looks at pairs within the clearance of 15 m are more than 1048576'),
    (4, 1000, 3.0, 0.0, ''),
    (256, 16, 0.0, 50.0, 'more than 4096 pairs come within the clearance of 50 m')])
def test_what_asks_for_too_much_is_refused_before_the_work(
        guests: int, times: int, turn: float, clearance: float, words: str) -> None:
    """Clearances, waypoints, turns, guests: no step takes 50 ms of the processor."""
    size = (12.192, 2.438, 2.591)
    boxes = {f'c{n}': Box(size, (13.0 * (n % 50), 3.0 * (n // 50), 1.3, 0, 0, 0, 1))
             for n in range(2000)}
    scene = Scene({'load': Box(size), **boxes}, patterns=(('load', '*'),), frame_id='yard',
                  poses='named')
    checker = SceneCheck(SceneSolver(scene), most_near=2**15)
    waypoints = a_long_way(guests, times, turn)
    request = a_request(waypoints, dict.fromkeys(waypoints[0], CUBE), clearance=clearance)
    steps = check_path.answer(checker, EPOCH, request, CheckPath.Response())
    longest, used, said = 0.0, 0.0, ''
    gc.freeze()
    while True:
        begin = time.thread_time()
        try:
            next(steps)
        except (StopIteration, TooMuch) as end:
            said = str(end)
            break
        finally:
            took = time.thread_time() - begin
            longest, used = max(longest, took), used + took
    gc.unfreeze()
    assert words in said and bool(words) == bool(said), said
    assert longest < 0.05 and used < 3.0
