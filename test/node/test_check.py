# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""~/check and ~/reset: questions without stamps, and episodes of a simulator in lockstep."""
from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from itertools import pairwise
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import poses
import pytest
from answers import near_pairs
from raw_client import APART, ORIGIN, TOUCHING
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.parameter import Parameter
from ros_client import CUBES, Client, serving
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from typed_messages import TOLD, a_box, a_pair, answered, contacts_by_pair

from box_contact_msgs.srv import Check
from box_contact_ros import ContactSolver, SceneSolver, make_model
from box_contact_ros.node import check as check_module
from box_contact_ros.node import paced_service
from box_contact_ros.node.check import MOST_CONTACTS, CheckAnswerer
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.paced_service import PacedService
from box_contact_ros.node.runtime import GuardedNode
from box_contact_ros.node.tick import LastPoses
from box_contact_ros.scene.boxes import Box, Frame
from box_contact_ros.scene.scene import Pair, Scene
from box_contact_ros.scene.scene_check import MOST_BOXES, MOST_PAIRS
from box_contact_ros.stream.pairing import StampedPose

CUBE = tuple(poses.CUBE)
SCENE = Scene({name: Box(CUBE) for name in ('load', 'stack', 'lorry')},
              (Pair('landing', 'load', 'stack'), Pair.between('load', 'lorry')))
# On a machine with one core, it would have one thread, and warn.
EXECUTORS = (SingleThreadedExecutor, partial(MultiThreadedExecutor, num_threads=2), EventsExecutor)
EPISODES = 1  # of each length; 50 were tried


@pytest.fixture(scope='module')
def answerer() -> CheckAnswerer:
    return CheckAnswerer(SceneSolver(SCENE, model='exact'))


def asked(answerer: CheckAnswerer, *boxes: Any, **fields: Any) -> Check.Response:
    """Return the response to boxes and further fields of a request."""
    return answered(Check.Request(boxes=list(boxes), **fields), Check.Response(), answerer.answer)


def labels(response: Check.Response) -> list[str]:
    """Return the names of the pairs in contact, in their order."""
    assert response.success, response.message
    return [entry.pair for entry in response.contacts.contacts]


def test_boxes_of_the_scene_need_no_size(answerer: CheckAnswerer) -> None:
    """They meet by the scene's pairs, and a guest meets all; a listed pair is any of the boxes."""
    response = asked(answerer, a_box('load', TOUCHING), a_box('stack', ORIGIN),
                     a_box('lorry', TOUCHING), a_box('mine', ORIGIN, CUBE))
    assert labels(response) == ['landing', 'load_lorry', 'mine_load', 'mine_stack', 'mine_lorry']
    response = asked(answerer, a_box('load', TOUCHING), a_box('stack', ORIGIN),
                     a_box('lorry', TOUCHING), pairs=[a_pair('stack', 'load')])
    entry, = response.contacts.contacts
    assert (entry.pair, entry.box_a, entry.normal.z) == ('stack_load', 'stack', 1.0)


def test_a_size_of_its_own_lasts_for_one_question(answerer: CheckAnswerer) -> None:
    """A box that moves may have another size than in the scene, whatever the margins are."""
    low, own = (2, 2, 1), (0, 0, 0)
    for size, margin, found in ((low, 0.0, []), (own, 0.0, ['landing']), (low, 0.0, []),
                                (own, 0.1, ['landing']), (own, 0.0, ['landing']), (low, 0.1, [])):
        assert labels(asked(answerer, a_box('load', TOUCHING, size), a_box('stack', ORIGIN),
                            margin=margin)) == found


FIXED = (10, 0, 1, 0, 0, 0, 1)
ABOVE_FIXED = (10, 0, 2.9, 0, 0, 0, 1)
YARD = Scene({'load': Box(CUBE), 'crane': Box(CUBE), 's1': Box(CUBE, FIXED),
              's2': Box(CUBE, (0, 0, 0, 0, 0, 0, 1))}, (Pair('landing', 'load', 's1'),),
             frame_id='yard', patterns=(('crane', '*'),))


@pytest.fixture(scope='module')
def yard() -> CheckAnswerer:
    return CheckAnswerer(SceneSolver(YARD))


def asked_yard(yard: CheckAnswerer, *boxes: Any, **fields: Any) -> Check.Response:
    return asked(yard, *boxes, **{'header': Header(frame_id='yard'), **fields})


def test_one_box_is_a_question(yard: CheckAnswerer) -> None:
    """Fixed boxes take part by the scene's pairs; of a guest, all. Nobody else is there."""
    def found(*boxes: Any, **fields: Any) -> list[str]:
        return labels(asked_yard(yard, *boxes, **fields))

    at_s2 = (0, 0, 1.9, 0, 0, 0, 1)
    assert found(a_box('load', ABOVE_FIXED)) == ['landing']
    assert found(a_box('load', at_s2)) == []  # no pair of the scene
    assert found(a_box('crane', at_s2)) == ['crane_s2']
    assert found(a_box('mine', at_s2, CUBE)) == ['mine_s2']
    assert found(a_box('mine', ABOVE_FIXED, CUBE)) == ['mine_s1']
    assert found(a_box('s1', ORIGIN)) == []  # it never moves
    assert found(a_box('mine', at_s2, CUBE), a_box('load', at_s2)) == ['mine_load', 'mine_s2']
    assert found(a_box('load', at_s2), pairs=[a_pair('s2', 'load')]) == ['s2_load']
    assert found(a_box('load', ABOVE_FIXED), pairs=[a_pair('s2', 'load')]) == []
    assert found(a_box('load', ABOVE_FIXED), pairs=[a_pair('load', 's1')]) == ['landing']
    assert found(a_box('load', ABOVE_FIXED)) == ['landing']


SPREADER = Scene(
    {'beam': Box((6, 2, 1), (0, 0, 1, 0, 0, 0, 1), body='spreader'),
     'foot': Box((1, 2, 1), (2.5, 0, 0, 0, 0, 0, 1), body='spreader'),
     'load': Box(CUBE), 'stack': Box(CUBE, ORIGIN),
     'post': Box((1, 1, 4), (0, 0, 2, 0, 0, 0, 1), body='gate')},
    (Pair.between('foot', 'stack'), Pair.between('load', 'stack')),
    bodies={'spreader': Frame(), 'gate': Frame((20, 0, 0, 0, 0, 0, 1))},
    patterns=(('spreader', 'gate'), ('spreader', 'load')))


def test_a_body_is_a_question() -> None:
    """Named by its name, with one pose: its boxes meet what the scene pairs them with."""
    answerer = CheckAnswerer(SceneSolver(SPREADER))

    def found(*boxes: Any, **fields: Any) -> list[str]:
        return labels(asked(answerer, *boxes, **fields))

    def at(x: float, z: float) -> tuple[float, ...]:
        return (x, 0, z, 0, 0, 0, 1)

    assert found(a_box('spreader', at(-2.5, 1.4))) == ['foot_stack']
    assert found(a_box('spreader', at(0, 0.4))) == []  # the beam is no pair of the stack
    assert found(a_box('spreader', at(17, 1))) == ['beam_post', 'foot_post']
    assert found(a_box('load', at(0, 1.9))) == ['load_stack']
    assert found(a_box('spreader', at(0, 9)), a_box('load', at(0, 9))) == ['beam_load']
    assert found(a_box('mine', at(20, 1), CUBE)) == ['mine_post']
    assert found(a_box('mine', at(0, 9), CUBE), a_box('spreader', at(0, 9))) == ['mine_beam']
    both = a_box('spreader', at(-2.5, 0.4))
    assert found(both, pairs=[a_pair('stack', 'spreader')]) == [
        'stack_beam', 'stack_foot']
    assert found(both, pairs=[a_pair('beam', 'stack')]) == ['beam_stack']
    assert found(a_box('mine', at(20, 1), CUBE), pairs=[a_pair('gate', 'mine')]) == ['post_mine']
    assert found(a_box('gate', ORIGIN), a_box('post', ORIGIN)) == []
    for box, words in (
            (a_box('beam', ORIGIN), "boxes[0] 'beam' moves with 'spreader': give the pose of this"),
            (a_box('spreader', ORIGIN, CUBE), "'spreader' is a body of the scene, whose boxes"),
            (a_box('gate', at(1, 0)), "'gate' is fixed in the scene with pose (20.0, 0.0, 0.0, "),
            (a_box('spreader', [0] * 7), "boxes[0] 'spreader': quaternion (x=0, y=0, z=0, w=0)")):
        assert words in asked(answerer, box).message
    assert found(a_box('load', at(0, 1.9))) == ['load_stack']
    for pair in (('spreader', 'beam'), ('foot', 'beam'), ('gate', 'post')):
        answer = asked(answerer, a_box('spreader', ORIGIN), pairs=[a_pair(*pair)])
        assert answer.message == (f'pairs[0]: {pair[0]!r} and {pair[1]!r} are of one body, whose '
                                  'boxes are never a pair')
    lost = asked(answerer, a_box('load', ORIGIN), pairs=[a_pair('load', 'beam')])
    assert lost.message == ("pairs[0].box_b: 'beam' moves, and its pose is not in the request: add "
                            "'spreader' to boxes")


def test_what_moves_and_is_not_named_is_told() -> None:
    """Or it stands where it was last: it meets what is named, and nothing else."""
    answerer = CheckAnswerer(SceneSolver(SPREADER))
    load, above = a_box('load', (0, 0, 1.9, 0, 0, 0, 1)), (0, 0, 3.4, 0, 0, 0, 1)
    left = asked(answerer, load)
    assert (labels(left), left.left_out, left.left_out_names) == (['load_stack'], 1, ['spreader'])
    assert asked(answerer, load, a_box('spreader', above)).left_out == 0

    def found(*boxes: Any, last: Any, **fields: Any) -> list[str]:
        response = answered(Check.Request(boxes=list(boxes), **fields), Check.Response(),
                            partial(answerer.answer, last=last))
        assert response.left_out == len({'load', 'spreader'} - {box.name for box in boxes}
                                        - last.keys())
        return labels(response)

    low = (0, 0, 2.1, 0, 0, 0, 1)  # the beam is 2.6 to 3.6 m high, the load up to 2.9 m
    assert found(load, last={'spreader': low}) == ['load_stack', 'beam_load']
    assert found(load, last={}) == ['load_stack']
    in_stack = (-2.5, 0, 0.4, 0, 0, 0, 1)  # the foot is, and nobody asks about it
    assert found(a_box('load', (0, 9, 9, 0, 0, 0, 1)), last={'spreader': in_stack}) == []
    assert found(load, last={'spreader': low}, pairs=[a_pair('load', 'spreader')]) == ['load_beam']
    assert found(load, a_box('spreader', above), last={'spreader': low}) == ['load_stack']
    assert found(a_box('mine', low, CUBE), last={'spreader': low, 'nobody': low}) == ['mine_beam']
    assert labels(asked(answerer, load)) == ['load_stack']


@pytest.mark.parametrize('margin', [0.0, 0.3])
def test_last_poses_answer_as_if_they_were_named(margin: float) -> None:
    """But for pairs of which neither is asked for."""
    rng = np.random.default_rng(6)
    boxes = {f'b{n}': Box(rng.uniform(0.5, 2, 3)) for n in range(80)}
    solver, count = SceneSolver(Scene(boxes, patterns=(('b*', 'b*'),), poses='named')), 0
    answerer, of_all = CheckAnswerer(solver), CheckAnswerer(solver)
    for _ in range(20):
        places = {name: (*rng.uniform(-3, 3, 3), *rng.normal(size=4)) for name in boxes}
        named = set(rng.permutation(list(boxes))[:20].tolist())
        whole = asked(of_all, *(a_box(name, place) for name, place in places.items()),
                      margin=margin)
        part = answered(Check.Request(margin=margin, boxes=[
            a_box(name, place) for name, place in places.items() if name in named]),
            Check.Response(), partial(answerer.answer, last=places))
        for kind in ('contacts', 'near'):
            wanted = [entry for entry in getattr(whole.contacts, kind)
                      if named & {entry.box_a, entry.box_b}]
            assert [(entry.box_a, entry.box_b) for entry in getattr(part.contacts, kind)] == [
                (entry.box_a, entry.box_b) for entry in wanted]
            count += len(wanted)
    assert count > 500


@pytest.mark.parametrize('margin', [0.0, 0.3])
def test_a_question_is_answered_as_a_tick_of_the_scene_that_it_makes(margin: float) -> None:
    """Guests are boxes of that scene, before its own; whoever is not named has no pose."""
    rng = np.random.default_rng(4)

    def pose(spread: float) -> np.ndarray:
        quaternion = rng.normal(size=4)
        return np.hstack((rng.uniform(-spread, spread, 3), quaternion / np.linalg.norm(quaternion)))

    boxes = {f'fixed{n}': Box(rng.uniform(0.5, 2, 3), pose(5)) for n in range(60)}
    boxes |= {f'moving{n}': Box(rng.uniform(0.5, 2, 3)) for n in range(50)}
    patterns = (('moving1*', 'fixed*'), ('fixed2*', 'moving*'), ('moving2*', 'moving3*'))
    scene = Scene(boxes, (Pair('own', 'moving4', 'moving5'),), patterns=patterns)
    answerer, count = CheckAnswerer(SceneSolver(scene)), 0
    for _ in range(6):
        guests = {f'guest{n}': (pose(4), tuple(rng.uniform(0.5, 2, 3))) for n in range(40)}
        named = {f'moving{n}': pose(4) for n in rng.permutation(50)[:40]}
        response = asked(answerer, *(a_box(name, *guest) for name, guest in guests.items()),
                         *(a_box(name, place) for name, place in named.items()), margin=margin)
        whole = Scene({**{name: Box(size) for name, (_, size) in guests.items()}, **boxes},
                      scene.pairs, patterns=(('guest*', '*'), *patterns), poses='named')
        poses_of = {name: place for name, (place, _) in guests.items()} | named
        answer = SceneSolver(whole, margin=margin)([poses_of.get(name) for name in whole.moving])
        listed, near = response.contacts.contacts, response.contacts.near
        assert [entry.pair for entry in listed] == [pair.label for pair, _ in answer.named()]
        assert [entry.depth for entry in listed] == (-answer.contacts.separation).tolist()
        assert [entry.pair for entry in near] == [pair.label for pair, _ in near_pairs(answer)]
        assert [entry.distance for entry in near] == answer.near.distance.tolist()
        count += len(listed) + len(near)
    assert count > 500


def test_boxes_of_own_sizes_are_answered_as_the_solver_does(answerer: CheckAnswerer) -> None:
    """To the bit, under their names. Messages of a long answer serve the next, and get more."""
    placed = [np.array([0, 0, 0.25 * n, 0.1 * n, 0.2, 0, 1]) for n in range(5)]
    sizes = [(2.0 + 0.5 * n, 3.0, 1.0) for n in range(5)]
    for count in (3, 1, 5):
        response = asked(answerer, *(a_box(f'p{n}', placed[n], sizes[n]) for n in range(count)))
        assert response.success and not response.message and not response.contacts.near
        found = contacts_by_pair(response.contacts)
        assert set(found) == {f'p{a}_p{b}' for b in range(count) for a in range(b)}
        for name, contact in found.items():
            a, b = (int(box[1:]) for box in name.split('_'))
            wanted = ContactSolver(sizes[a], sizes[b])(placed[a], placed[b])
            poses.assert_same_bits(contact, wanted, *TOLD)


@pytest.mark.parametrize('place, depths', [(ABOVE_FIXED, [0.1]), ((0, 5, 1.9, 0, 0, 0, 1), [])])
@pytest.mark.parametrize('s1', [ORIGIN, FIXED])
def test_a_fixed_box_is_where_the_scene_says(yard: CheckAnswerer, place: Any, depths: list[float],
                                             s1: Any) -> None:
    """Without a pose of its own, as a new message is, or with the scene's."""
    response = asked_yard(yard, a_box('load', place), a_box('s1', s1))
    assert response.success
    assert [entry.depth for entry in response.contacts.contacts] == pytest.approx(depths)


@pytest.mark.parametrize('s1, size, frame, words', [
    ((10, 0, 1.5, 0, 0, 0, 1), (0, 0, 0), 'yard',
     "boxes[1] 's1' is fixed in the scene with pose (10.0, 0.0, 1.0, "),
    ((0, 0, 0, 0, 0, 1, 0), (0, 0, 0), 'yard',
     'not (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0): leave its pose'),
    (ORIGIN, (2, 2, 3), 'yard', 'with size (2.0, 2.0, 2.0), not (2.0, 2.0, 3.0): leave its size'),
    (ORIGIN, CUBE, 'map',
     "header.frame_id: the scene is in frame 'yard', the request in 'map': send"),
    (ORIGIN, CUBE, '/yard', 'the leading slash is the difference'),
    (ORIGIN, CUBE, '', "the request in ''")])
def test_what_contradicts_the_scene_is_refused(yard: CheckAnswerer, s1: Any, size: Any, frame: str,
                                               words: str) -> None:
    response = asked(yard, a_box('load', ORIGIN), a_box('s1', s1, size),
                     header=Header(frame_id=frame))
    assert not response.success and words in response.message
    assert labels(asked_yard(yard, a_box('load', ABOVE_FIXED))) == ['landing']


def test_near_is_what_is_apart_within_the_margin(answerer: CheckAnswerer) -> None:
    """`contacts` holds what touches and nothing else."""
    boxes = (a_box('load', APART), a_box('stack', ORIGIN), a_box('lorry', APART))
    for margin, near in ((0.0, []), (0.4, []), (0.5, ['landing'])):
        answer = asked(answerer, *boxes, margin=margin).contacts
        assert [entry.pair for entry in answer.contacts] == ['load_lorry']
        assert [entry.pair for entry in answer.near] == near and not answer.stale
    near, = answer.near
    assert (near.distance, near.normal.z) == (0.5, -1.0)
    assert near.point_a.z - near.point_b.z == 0.5


NAN = math.nan
GOOD = a_box('p', ORIGIN, CUBE)


@pytest.mark.parametrize('boxes, fields, words', [
    ([], {}, 'boxes: a request has 1 to 256 boxes, not 0'),
    ([a_box(f'{n}', ORIGIN, CUBE) for n in range(257)], {}, 'not 257'),
    ([a_box('p' * 256, ORIGIN, CUBE), GOOD], {}, "boxes[0].name: 'ppp"),
    ([a_box('ö' * 128, ORIGIN, CUBE), GOOD], {}, 'has 256 bytes, more than 255'),
    ([GOOD, a_box('load', ORIGIN)], {'header': Header(frame_id='f' * 256)},
     "header.frame_id: 'fff"),
    ([GOOD, GOOD], {}, "boxes[1]: 'p' is the name of boxes[0], too"),
    ([GOOD, a_box('laod', ORIGIN)], {},
     "boxes[1] 'laod' has no size, and is no box of the scene (did you mean load?)"),
    ([GOOD, a_box('q', ORIGIN, (1, 0, 1))], {}, "boxes[1] 'q': (1, 0, 1) is not positive"),
    ([GOOD, a_box('q', ORIGIN, (1, NAN, 1))], {}, "boxes[1] 'q': (1, nan, 1) is not finite"),
    ([GOOD, a_box('q', [0] * 7, CUBE)], {}, "boxes[1] 'q': quaternion (x=0, y=0, z=0, w=0) has ze"),
    ([GOOD, a_box('q', [NAN] * 7, CUBE)], {}, "boxes[1] 'q': position (nan, nan, nan) is not fini"),
    ([GOOD, a_box('load', ORIGIN)], {'margin': -1.0},
     'margin must lie within 0 and 1e+50 m, not -1'),
    ([GOOD, a_box('load', ORIGIN)], {'margin': NAN},
     'margin must lie within 0 and 1e+50 m, not nan'),
    ([GOOD, a_box('load', ORIGIN)], {'pairs': [a_pair('p', 'laod')]},
     "pairs[0].box_b: 'laod' is neither a box of the request nor of the scene (did you mean lo"),
    ([GOOD], {'pairs': [a_pair('p', 'load')]},
     "pairs[0].box_b: 'load' moves, and its pose is not in the request: add 'load' to boxes"),
    ([GOOD, a_box('', ORIGIN, CUBE)], {}, "boxes[1] '' is an empty name: a guest needs one"),
    ([GOOD, a_box('load', ORIGIN)], {'pairs': [a_pair('p', 'p')]}, "'p' is both box_a and box_b"),
    ([GOOD, a_box('load', ORIGIN)], {'pairs': [a_pair('p', 'load')] * (MOST_PAIRS + 1)},
     'pairs: a request has at most 4096, not 4097'),
    ([a_box(f'{i}', ORIGIN, CUBE) for i in range(92)], {},
     'contacts: 4186 pairs touch or are near, and a response has at most 4096'),
    ([a_box(f'{i}', (3 * i, 0, 0, 0, 0, 0, 1), CUBE) for i in range(99)], {'margin': 1e6},
     'contacts: 4851 pairs touch or are near'),
])
def test_what_is_wrong_comes_back_as_text(answerer: CheckAnswerer, boxes: list[Any],
                                          fields: dict[str, Any], words: str) -> None:
    response = asked(answerer, *boxes, **fields)
    assert not response.success and words in response.message
    assert response.contacts == Check.Response().contacts


def test_boxes_that_are_apart_cost_no_pairs(answerer: CheckAnswerer) -> None:
    """As many as a request takes: their pairs are left out, as bounding boxes do not meet."""
    boxes = [a_box(f'{n}', (3 * n, 0, 0, 0, 0, 0, 1), CUBE) for n in range(MOST_BOXES)]
    assert MOST_BOXES * (MOST_BOXES - 1) // 2 > MOST_CONTACTS
    assert labels(asked(answerer, *boxes)) == []


def test_a_soup_answers_few_pairs() -> None:
    """Its pairs take up to a third of a second; and it knows no axis of those apart."""
    pytest.importorskip('fcl')
    answerer = CheckAnswerer(SceneSolver(SCENE, model=make_model('soup-2')), 'soup-2')
    boxes = [a_box(f'{i}', ORIGIN, CUBE) for i in range(13)]
    assert 'more than 64 are' in asked(answerer, *boxes).message
    apart = (a_box('load', APART), a_box('stack', ORIGIN))
    assert asked(answerer, *apart).success
    assert 'margin 1 has no effect' in asked(answerer, *apart, margin=1.0).message


# --- over ROS -------------------------------------------------------------------------------------


@pytest.fixture
def client() -> Any:
    with closing(Client()) as client:
        yield client


def check(client: Client, *poses_of: Any, **fields: Any) -> Check.Response:
    boxes = [a_box(f'box_{letter}', pose) for letter, pose in zip('ab', poses_of)]
    return client.call(Check, 'contact_node/check', Check.Request(boxes=boxes, **fields))


def test_a_check_leaves_the_ticks_alone(client: Client) -> None:
    """Its poses reach no tick. A new model answers the next one; before configure, none does."""
    with serving(ContactNode, autostart=False, **CUBES) as node:
        assert check(client, ORIGIN, TOUCHING).message == 'the node is not configured'
        node.start()
        client.offer_until_answered(ORIGIN, APART)
        before = {**node.counts, 'checks answered': 2}
        for model in ('exact', 'mlp'):
            assert node.set_parameters([Parameter('model', value=model)])[0].successful
            contact = contacts_by_pair(check(client, ORIGIN, TOUCHING).contacts)['box_a_box_b']
            wanted = ContactSolver(CUBE, CUBE, model=model)(ORIGIN, TOUCHING)
            assert contact.point.tolist() == wanted.point.tolist()
        assert dict(node.counts) == before
        assert client.answer(ORIGIN, APART) == {}
        assert not check(client, ORIGIN, [0] * 7).success
        client.ask(ORIGIN, TOUCHING)


def test_the_last_pose_of_each_is_kept() -> None:
    """Of one message of all, also where a later one leaves it out, and of topics of their own."""
    def message(stamp: int, *xs: float) -> StampedPose:
        return StampedPose(np.array([(x, 0, 0, 0, 0, 0, 1) for x in xs]), 'map', stamp)

    last = LastPoses()
    last.take_all(('a', 'b', 'c'), message(10, 1.0, 2.0, math.nan), np.array([2]))
    assert {name: row[0] for name, row in last.within(0).items()} == {'a': 1.0, 'b': 2.0}
    last.take_all(('c', 'b', 'd'), message(15, 3.0, math.nan, 4.0), np.array([1]))
    assert {name: row[0] for name, row in last.within(0).items()} == {'b': 2.0, 'c': 3.0, 'd': 4.0}
    assert last.within(4).keys() == {'c', 'd'} and last.within(5).keys() == {'b', 'c', 'd'}
    last.take('e', StampedPose((5.0, 0, 0, 0, 0, 0, 1), 'map', 30))
    assert last.within(0)['e'][0] == 5.0 and last.within(10).keys() == {'e'}
    last.take('e', StampedPose((6.0, 0, 0, 0, 0, 0, 1), 'map', 1))  # time went back
    assert last.within(10).keys() == {'b', 'e'} and last.within(14).keys() == {'b', 'c', 'd', 'e'}
    last.forget()
    assert last.within(0) == {}


def test_last_poses_are_those_of_the_topics(client: Client) -> None:
    """Until time begins anew."""
    with serving(ContactNode, **CUBES):
        client.offer_until_answered(ORIGIN, APART)
        client.ask(ORIGIN, TOUCHING)
        load = [a_box('box_a', ORIGIN)]
        request = Check.Request(boxes=load, last_poses=True)
        met = client.call(Check, 'contact_node/check', request)
        assert labels(met) == ['box_a_box_b'] and met.left_out == 0
        alone = client.call(Check, 'contact_node/check', Check.Request(boxes=load))
        assert labels(alone) == [] and alone.left_out_names == ['box_b']
        assert client.call(Trigger, 'contact_node/reset', Trigger.Request()).success
        forgotten = client.call(Check, 'contact_node/check', request)
        assert labels(forgotten) == [] and forgotten.left_out_names == ['box_b']


COSTLY = Check.Request(boxes=[a_box(f'{n}', ORIGIN, CUBE) for n in range(91)])
CHEAP = Check.Request(boxes=COSTLY.boxes[:2])


@pytest.mark.parametrize('executor_type', EXECUTORS)
def test_costly_requests_wait_for_ticks(client: Client, executor_type: Any) -> None:
    """For five times as long as the last one took, its sending included; a cheap one does not."""
    with serving(ContactNode, executor_type, **CUBES):
        service = client._client_of(Check, 'contact_node/check')
        order: list[str] = []
        asked = {'first': COSTLY, 'second': COSTLY, 'third': COSTLY, 'cheap': CHEAP}
        futures = [service.call_async(request) for request in asked.values()]
        for name, future in zip(asked, futures):
            future.add_done_callback(lambda _, name=name: order.append(name))
        assert client.spin(lambda: len(order) == len(asked))
    assert [len(future.result().contacts.contacts) for future in futures] == [4095] * 3 + [1]
    assert [name for name in order if name != 'cheap'] == ['first', 'second', 'third']
    assert order.index('cheap') < order.index('second')


STEP = 0.01  # time [s] of each step but the last


class Bench:
    """A `PacedService` whose requests take a time [s] of their own, by a clock that stands."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, in_turn: bool = False,
                 steps: int = 1) -> None:
        self.now, self.sent, self.steps = 0.0, [], steps
        monkeypatch.setattr(paced_service, 'time', SimpleNamespace(
            monotonic=lambda: self.now, thread_time=lambda: self.now))
        monkeypatch.setattr(paced_service, 'answer_later', lambda service, take: None)
        self.timer = Mock()
        node = Mock(create_timer=Mock(return_value=self.timer),
                    answered=lambda callback, name: callback)
        self.counts: Counter[str] = Counter()
        self.service = PacedService(node, self.counts, 'checks', (Check, '~/check'), self.answer,
                                    check_module.kind_and_size, in_turn=in_turn, is_timed=True)
        self._end_of_pause = node.create_timer.call_args.args[1]

    def end_of_pause(self) -> None:
        """Let the timer end."""
        self.now += (self.timer.timer_period_ns + 1) * 1e-9
        self._end_of_pause()

    def answer(self, request: Any, response: Check.Response) -> Iterator[None]:
        for _ in range(self.steps - 1):
            self.now += STEP
            yield
        if request.name == 'bad':
            raise ValueError('a fault')

    def ask(self, name: str, boxes: int, seconds: float, margin: float = 0.0) -> None:
        """Take a request whose answer is sent after so long."""
        def send(response: Check.Response) -> None:
            self.now += seconds
            self.sent.append(name if response.success else f'{name}: {response.message[:4]}')
        request = SimpleNamespace(name=name, boxes=range(boxes), pairs=(), margin=margin,
                                  last_poses=False)
        self.service._take(request, Check.Response(), send)


def test_a_pause_is_five_times_as_long_as_its_request(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those who wait come one after the other; each makes its own pause. The 17th is refused."""
    bench = Bench(monkeypatch)
    bench.ask('cheap', 80, 0.005)
    bench.ask('costly', 80, 0.1)
    bench.ask('one that waits', 5, 0.1)
    bench.ask('smaller', 4, 0.001)  # 80 boxes in 0.1 s are 4 boxes in 5 ms
    assert bench.sent == ['cheap', 'costly', 'smaller']
    assert bench.timer.timer_period_ns == round(0.5e9)
    for number in range(15):
        bench.ask(f'{number}', 80, 0.001)
    bench.ask('one too many', 80, 0.1)
    assert bench.sent.pop() == 'one too many: busy'
    bench.end_of_pause()
    assert bench.sent[3:] == ['one that waits'] and bench.timer.timer_period_ns == round(0.5e9)
    bench.ask('bad', 0, 0.001)
    assert bench.sent.pop() == 'bad: a fa'
    for _ in range(16):
        bench.end_of_pause()
    assert bench.sent[4:] == [f'{number}' for number in range(15)]
    bench.ask('alone', 80, 0.001)
    assert bench.sent[-1] == 'alone'
    assert bench.counts == {'checks answered': 20, 'checks refused': 2}
    times = bench.service.take_times()
    assert len(times) == 21 and max(times) > 1.0 and not bench.service.take_times()


def test_what_one_client_asks_makes_no_other_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """A box with a large margin has thousands of pairs, the same box without one has few.

    Hundreds of other margins are forgotten again.
    """
    bench = Bench(monkeypatch)
    bench.ask('cheap', 1, 0.001)
    for number in range(5):
        bench.ask('greedy', 1, 0.04, margin=1000.0)
        bench.ask(f'cheap {number}', 1, 0.001)
    assert bench.sent == ['cheap', 'greedy', *(f'cheap {number}' for number in range(5))]
    for _ in range(4):
        bench.end_of_pause()
    bench.now += 1.0
    for number in range(300):
        bench.ask('other', 1, 0.001, margin=1.0 + number)
    assert len(bench.service._cheap) == paced_service.KEPT_KINDS


def test_a_timer_that_is_served_too_early_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """EventsExecutor multiplies the events of a timer that is set while one of them waits."""
    bench = Bench(monkeypatch, steps=3)
    bench.ask('first', 80, 0.01)
    before = bench.timer.mock_calls[:]
    for _ in range(10):
        bench._end_of_pause()
    assert bench.timer.mock_calls == before and not bench.sent
    for _ in range(2):
        bench.end_of_pause()
    assert bench.sent == ['first']


def test_where_the_order_matters_none_overtakes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cheap request waits behind a costly one; alone in a pause it does not."""
    bench = Bench(monkeypatch, in_turn=True)
    bench.ask('cheap', 1, 0.001)
    bench.ask('costly', 80, 0.1)
    bench.ask('alone', 1, 0.001)
    bench.ask('next costly', 80, 0.1)
    bench.ask('behind it', 1, 0.001)
    assert bench.sent == ['cheap', 'costly', 'alone']
    for _ in range(2):
        bench.end_of_pause()
    assert bench.sent[3:] == ['next costly', 'behind it']


def test_an_answer_is_made_in_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ticks come between them; other requests wait for the last one, and for a pause after it."""
    bench = Bench(monkeypatch, in_turn=True, steps=3)
    bench.ask('first', 80, 0.01)
    bench.ask('second', 1, 0.01)
    for _ in range(2):
        assert not bench.sent and bench.timer.timer_period_ns == round(
            1e9 * paced_service.REST * STEP)
        bench.end_of_pause()
    assert bench.sent == ['first']
    assert bench.timer.timer_period_ns == round(1e9 * paced_service.PAUSE * 0.01)
    for _ in range(3):
        bench.end_of_pause()
    assert bench.sent == ['first', 'second'] and bench.counts == {'checks answered': 2}


def test_a_small_request_comes_between_the_turns_of_a_long_one(
        monkeypatch: pytest.MonkeyPatch) -> None:
    """Another client would wait for seconds, and for the pause; with in_turn it does."""
    for in_turn, order in ((False, ['small', 'long']), (True, ['long', 'small'])):
        bench = Bench(monkeypatch, steps=9, in_turn=in_turn)
        bench.ask('long', 80, 0.01)
        bench.steps = 1
        bench.ask('small', 1, 0.001)
        for _ in range(10):
            bench.end_of_pause()
        assert bench.sent == order


class Stepper(GuardedNode):
    """Answers in steps of 5 ms of the processor, each of which sends the node itself a tick."""

    def __init__(self, context: Any, *, steps: int, pause: float = 0.0) -> None:
        super().__init__('stepper', context=context)
        self.steps, self.pause = steps, pause
        self.order: list[str] = []
        self.create_subscription(Header, 'ticks', lambda _: self.order.append('tick'), 10)
        self.ticks = self.create_publisher(Header, 'ticks', 10)
        self.served = 0  # how often the timer ended
        service = PacedService(self, Counter(), 'checks', (Check, '~/check'), self.answer,
                               check_module.kind_and_size)
        go_on = service._timer.callback

        def counted() -> None:
            self.served += 1
            go_on()
        service._timer.callback = counted

    def answer(self, _: Any, response: Check.Response) -> Iterator[None]:
        for _ in range(self.steps):
            self.order.append('step')
            self.ticks.publish(Header())
            began = time.thread_time()
            while time.thread_time() < began + 0.005:
                pass
            time.sleep(self.pause)  # on a busy machine the message needs it to arrive
            yield


@pytest.mark.parametrize('executor_type', [SingleThreadedExecutor, EventsExecutor])
def test_what_comes_in_a_step_is_served_before_the_next(client: Client, executor_type: Any) -> None:
    with serving(partial(Stepper, steps=10, pause=0.02), executor_type) as node:
        assert client.spin(lambda: node.ticks.get_subscription_count())
        assert client.call(Check, 'stepper/check', Check.Request()).success
    in_a_row = sum(pair == ('step', 'step') for pair in pairwise(node.order))
    assert node.order.count('step') == 10 and in_a_row < 4, node.order


@pytest.mark.parametrize('executor_type', [SingleThreadedExecutor, EventsExecutor])
def test_many_requests_at_once_are_served_once_each(client: Client, executor_type: Any) -> None:
    """Ticks come between all of their steps, and the timer ends some times for each request."""
    with serving(partial(Stepper, steps=3), executor_type) as node:
        assert client.spin(lambda: node.ticks.get_subscription_count())
        service = client._client_of(Check, 'stepper/check')
        request = Check.Request(boxes=[a_box('p', ORIGIN, CUBE)])
        futures = [service.call_async(request) for _ in range(10)]
        assert client.spin(lambda: all(future.done() for future in futures))
    assert all(future.result().success for future in futures)
    silences = ''.join(word[0] for word in node.order).split('t')
    assert node.served <= 10 * len(futures) and max(map(len, silences)) <= 4, node.order


@pytest.mark.parametrize('by_topics', [False, True])
def test_lockstep_episodes_never_wait(client: Client, by_topics: bool) -> None:
    """Episodes of any length, each from time 0 on: by ~/check, or by topics after a ~/reset.

    Without the reset, the node takes an episode shorter than a second for repeated stamps.
    """
    with serving(ContactNode, **CUBES):
        client.offer_until_answered(ORIGIN, APART)
        for ticks in (1, 20, 100, 300) * EPISODES:
            if by_topics:
                assert client.call(Trigger, 'contact_node/reset', Trigger.Request()).success
                client.contacts.clear()
            for tick in range(ticks):
                load = (0, 0, 2.1 - 1e-3 * tick, 0, 0, 0, 1)
                if by_topics:
                    answer = client.contacts[client.ask(ORIGIN, load, stamps=(tick * 10**6,) * 2)]
                else:
                    answer = check(client, ORIGIN, load).contacts
                assert len(answer.contacts) == (tick >= 100)
