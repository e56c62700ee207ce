# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""~/set_boxes: containers come, are lifted, land and leave while poses are answered."""
from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseArray
from raw_client import ORIGIN
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.parameter import Parameter
from ros_client import CUBES, DEEP, Client, serving
from std_msgs.msg import Header
from typed_messages import a_box, contacts_by_pair, pose_array

from box_contact_msgs.srv import Check, SetBoxes
from box_contact_ros import SceneSolver, read_scene
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.set_boxes import changed
from box_contact_ros.scene.scene import Box, Scene

CUBE = (2, 2, 2)
AWAY = (0, 0, 40, 0, 0, 0, 1)
GONE = (math.nan,) * 7
SERVICE = 'contact_node/set_boxes'
CHANGES = 200  # 2,000 were tried
REQUESTS = 1000  # 10,000 were tried
NAMES = [f'c{number}' for number in range(50)]
YARD = {'frame_id': 'map', 'poses': 'array', 'pairs': 'all',
        'boxes': {'ground': {'size': [200, 200, 1], 'pose': [0, 0, -0.5, 0, 0, 0, 1]},
                  'hook': {'size': [1, 1, 1]}}}
# On a machine with one core, it would have one thread, and warn.
EXECUTORS = (SingleThreadedExecutor, partial(MultiThreadedExecutor, num_threads=2), EventsExecutor)


class YardClient(Client):
    """Changes boxes of a node, and publishes the poses of all that moves as one message."""

    def __init__(self) -> None:
        super().__init__()
        self.poses = self.node.create_publisher(PoseArray, 'poses', DEEP)

    def send(self, *rows: Any) -> int:  # type: ignore[override]
        stamp = self.next_stamp()
        self.poses.publish(pose_array(rows, 'map', stamp))
        return stamp

    def set_boxes(self, **fields: Any) -> SetBoxes.Response:
        return self.call(SetBoxes, SERVICE, SetBoxes.Request(header=Header(frame_id='map'),
                                                             **fields))


@pytest.fixture
def client() -> Iterator[YardClient]:
    with closing(YardClient()) as client:
        yield client


@pytest.fixture
def scene(tmp_path: Path) -> str:
    path = tmp_path / 'yard.yaml'
    path.write_text(yaml.safe_dump(YARD))
    return str(path)


def labels(client: YardClient, *rows: Any) -> list[str]:
    """Return what touches by the answer to poses."""
    return list(contacts_by_pair(client.contacts[client.ask(*rows)]))


def test_a_lift(client: YardClient, scene: str) -> None:
    """Fixed, moving, fixed: the next poses are answered by the new scene, and its number told.

    An array of the former length, which was on its way, is answered by the former scene.
    """
    with serving(ContactNode, scene=scene, pair_topics=False):
        client.offer_until_answered(AWAY)
        answer = client.set_boxes(fixed=[a_box('c1', (0, 0, 1, 0, 0, 0, 1), CUBE)])
        assert (answer.success, answer.message, answer.revision) == (True, '', 1)
        assert labels(client, (0, 0, 2.4, 0, 0, 0, 1)) == ['hook_c1']
        checked = client.call(Check, 'contact_node/check', Check.Request(
            header=Header(frame_id='map'), boxes=[a_box('lid', (0, 0, 2.4, 0, 0, 0, 1), CUBE)]))
        assert (checked.message, checked.contacts.revision) == ('', 1)
        assert 'lid_c1' in contacts_by_pair(checked.contacts)
        assert client.set_boxes(moving=[a_box('c1', ORIGIN)]).revision == 2
        late = client.ask((0, 0, 2.4, 0, 0, 0, 1))
        assert client.contacts[late].revision == 1
        assert list(contacts_by_pair(client.contacts[late])) == ['hook_c1']
        now = client.ask((0, 0, 2.4, 0, 0, 0, 1), (9, 9, 0.9, 0, 0, 0, 1))
        assert client.contacts[now].revision == 2
        assert list(contacts_by_pair(client.contacts[now])) == ['ground_c1']
        assert not client.is_answered(client.send(AWAY), 0.5)  # whoever sent two poses knows
        assert client.set_boxes(fixed=[a_box('c1', (9, 9, 1, 0, 0, 0, 1))]).revision == 3
        assert labels(client, (9, 9, 2.4, 0, 0, 0, 1), GONE) == ['hook_c1']
        assert client.set_boxes(absent=['c1']).revision == 4
        assert labels(client, (9, 9, 2.4, 0, 0, 0, 1), GONE) == []
        refused = client.set_boxes(absent=['c1'])
        assert (refused.success, refused.revision) == (False, 4)
        assert refused.message == "absent[0]: 'c1' is none of the boxes"


def test_a_new_model_and_a_new_start(client: YardClient, scene: str) -> None:
    """Another model answers the same scene; configure reads the file again."""
    with serving(ContactNode, scene=scene, pair_topics=False) as node:
        client.offer_until_answered(AWAY)
        assert client.set_boxes(moving=[a_box('c1', ORIGIN, CUBE)]).success
        assert node.set_parameters([Parameter('model', value='mlp')])[0].successful
        stamp = client.ask(AWAY, (9, 9, 0.9, 0, 0, 0, 1))
        assert client.contacts[stamp].revision == 1
        assert list(contacts_by_pair(client.contacts[stamp])) == ['ground_c1']
        node.trigger_deactivate()
        node.trigger_cleanup()
        assert client.set_boxes().message == 'the node is not configured'
        node.start()
        client.offer_until_answered(AWAY)
        assert client.contacts[client.ask(AWAY)].revision == 0


def test_boxes_of_a_scene_of_topics(client: YardClient) -> None:
    """Fixed ones come and go; pairs that came later have no topics, and are in `contacts`."""
    with serving(ContactNode, **CUBES):
        both = partial(Client.send, client, ORIGIN, (0, 0, 1.9, 0, 0, 0, 1))
        assert client.spin(lambda: client.contacts or not both())
        assert client.set_boxes(fixed=[a_box('stand', ORIGIN, CUBE)]).success
        words = "moving[0]: 'new' has no topic: boxes come and go as moving ones in a scene with "
        assert words in client.set_boxes(moving=[a_box('new', ORIGIN, CUBE)]).message
        assert "absent[0]: 'box_a' moves by" in client.set_boxes(absent=['box_a']).message
        stamp = both()
        assert client.is_answered(stamp) and client.contacts[stamp].revision == 1
        assert stamp in client.points


class Yard:
    """Plays a yard of fifty containers: each comes, is lifted, lands and leaves."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.rng = scene, np.random.default_rng(3)
        self.boxes, self.rows = dict(scene.boxes), ['hook']
        self.poses: dict[str, Any] = {}  # of what moves

    def pose(self) -> tuple[float, ...]:
        x, y, z, turn = self.rng.uniform((-9, -9, 0, -3), (9, 9, 4, 3))
        return (x, y, z, 0, 0, math.sin(turn), math.cos(turn))

    def change(self) -> dict[str, Any]:
        """Make a change, and return the fields of its request."""
        name = str(self.rng.choice(NAMES))
        box = self.boxes.get(name)
        if box is None or (box.pose is None and self.rng.random() < 0.7):  # comes, or lands
            self.boxes[name] = Box(CUBE if box is None else box.size, self.pose())
            size = CUBE if box is None or self.rng.random() < 0.5 else (0, 0, 0)
            return {'fixed': [a_box(name, self.boxes[name].pose, size)]}
        if box.pose is not None and self.rng.random() < 0.7:  # is lifted
            self.boxes[name] = Box(box.size)
            if name not in self.rows:
                self.rows.append(name)
            return {'moving': [a_box(name, ORIGIN)]}
        del self.boxes[name]
        return {'absent': [name]}

    def tick(self) -> list[Any]:
        """Return new poses by row."""
        self.poses = {name: self.pose() for name, box in self.boxes.items() if box.pose is None}
        return [self.poses.get(name, GONE) for name in self.rows]

    def wanted(self) -> list[tuple[str, float]]:
        """Return the pairs in contact with their depths, as a new solver finds them."""
        whole = Scene(self.boxes, self.scene.pairs, 'map', True, self.scene.patterns)
        answer = SceneSolver(whole)([self.poses[name] for name in whole.moving])
        return [(pair.label, -contact.separation) for pair, contact in answer.named()]


@pytest.mark.parametrize('executor_type', EXECUTORS)
def test_every_answer_is_that_of_its_revision(client: YardClient, scene: str,
                                              executor_type: Any) -> None:
    """An independent count of what touches, after changes in a random order, in each executor."""
    yard, found = Yard(read_scene(scene)), 0
    with serving(ContactNode, executor_type, scene=scene, pair_topics=False):
        client.offer_until_answered(AWAY)
        for revision in range(1, CHANGES + 1):
            answer = client.set_boxes(**yard.change())
            assert (answer.success, answer.revision) == (True, revision), answer.message
            told = client.contacts[client.ask(*yard.tick())]
            assert told.revision == revision
            wanted = yard.wanted()
            assert [(entry.pair, entry.depth) for entry in told.contacts] == wanted
            found += len(wanted)
    assert found > CHANGES


def random_request(rng: np.random.Generator) -> SetBoxes.Request:
    """Return a request of which at least one thing is wrong."""
    def number() -> float:
        return struct.unpack('<d', rng.bytes(8))[0]

    def box(name: str) -> Any:
        return a_box(name, ORIGIN, CUBE)

    request = SetBoxes.Request(header=Header(frame_id='map'), fixed=[box('good')])
    wrong = rng.integers(8)
    if wrong == 0:
        request.fixed.append(a_box('bad', [number() for _ in range(3)] + [0.0] * 4, CUBE))
    elif wrong == 1:
        size = [-abs(number()) if rng.random() < 0.5 else math.nan for _ in range(3)]
        request.moving.append(a_box('bad', ORIGIN, size))
    elif wrong == 2:
        request.fixed.append(box('n' * 256))
    elif wrong == 3:
        request.fixed.append(box('ground'))
        request.absent.append('ground')
    elif wrong == 4:
        request.absent.append(''.join(map(chr, rng.integers(1, 1000, 20))))
    elif wrong == 5:
        request.header.frame_id = str(rng.choice(['', '/map', 'm' * 256]))
    elif wrong == 6:
        request.moving += [box('twice'), box('twice')]
    else:
        request.fixed.append(box(str(rng.choice(['', 'a/b', '1', 'a b', 'ö']))))
    return request


def test_whatever_is_wrong_is_refused_whole(scene: str) -> None:
    """With words; the solver stays as it was."""
    solver, rng, words = SceneSolver(read_scene(scene)), np.random.default_rng(5), set()
    boxes = dict(solver.scene.boxes)
    for _ in range(REQUESTS):
        with pytest.raises(ValueError) as refused:
            changed(solver, random_request(rng))
        words.add(str(refused.value).split(':')[0].partition('[')[0])
    assert words == {'fixed', 'moving', 'absent', 'header.frame_id'}
    assert (solver.scene.boxes, solver.moving, solver.revision) == (boxes, ('hook',), 0)


def test_a_request_of_too_many_boxes_is_refused(scene: str) -> None:
    """Before it looks at any of them."""
    request = SetBoxes.Request(header=Header(frame_id='map'),
                               fixed=[a_box('one', ORIGIN, CUBE)] * 100_001)
    with pytest.raises(ValueError, match='fixed: a request has at most 100000 boxes, not 100001'):
        changed(SceneSolver(read_scene(scene)), request)
