# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The output `wrench` of a contact node over DDS, and contacts that a client holds as patches."""
from __future__ import annotations

import math
from functools import partial

import numpy as np
import poses
import pytest
from geometry_msgs.msg import PoseArray, PoseStamped, WrenchStamped
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from ros_client import Client, serving, stamp_of

from box_contact_ros import Body, PatchLaw, SceneLaw, SceneSolver
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import (
    ContactsMessage,
    Refused,
    contacts_by_pair,
    make_cloud,
    make_contacts,
    make_header,
    read_answer,
)
from box_contact_ros.scene.files.scene_check import meaning
from box_contact_ros.scene.files.scene_file import SceneError, parse_scene, scene_text
from box_contact_ros.scene.scene_solver import Answer, Pair, two_boxes
from box_contact_ros.solver.contact import Contact

RATE, MASS = 200.0, 20_000.0
PERIOD = round(1e9 / RATE)
WEIGHT = 9.81 * MASS
STACK = np.array(poses.IDENTITY)
HEIGHT = poses.CONTAINER[2]
LANDING = {'wrench': True, 'rate': RATE, 'mass_a': MASS, 'model': 'exact'}
SCENE = """\
frame_id: yard
boxes:
  load: {size: [2, 2, 2], mass: 1000}
  lid: {size: [2, 2, 1], mass: 500}
  lorry: {size: [2, 2, 2]}
  floor: {size: [20, 20, 1], pose: [0, 0, -0.5, 0, 0, 0, 1]}
pairs:
  - {a: load, b: floor}
  - {a: lid, b: load}
  - {a: lorry, b: floor}
"""


class WrenchClient(Client):
    """Keeps the wrenches too, by topic and stamp."""

    def __init__(self, namespace='', wrenches=('contact/wrench',), boxes=()):
        super().__init__(namespace)
        self.wrenches = {topic: {} for topic in wrenches}
        for topic, kept in self.wrenches.items():
            self.node.create_subscription(WrenchStamped, topic, self._keep(topic, kept),
                                          QoSProfile(depth=10_000))
        self.boxes = {box: self.node.create_publisher(PoseStamped, f'{box}/pose', 100)
                      for box in boxes}

    def tick(self, stamp, **where):
        for box, pose in where.items():
            message = PoseStamped(header=make_header(stamp, 'yard'))
            p, q = message.pose.position, message.pose.orientation
            p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, pose)
            self.boxes[box].publish(message)

    def wrench(self, pose_a, pose_b, stamp):
        """Send two poses and return the wrench of their stamp, in lockstep."""
        kept = self.wrenches['contact/wrench']
        for _ in range(20):
            self.send(pose_a, pose_b, stamps=(stamp, stamp))
            if self.spin(lambda: stamp in kept, 0.5):
                return numbers(kept[stamp])
        raise AssertionError('no wrench')


def numbers(message):
    force, torque = message.wrench.force, message.wrench.torque
    return np.array([force.x, force.y, force.z, torque.x, torque.y, torque.z])


def node_with(**parameters):
    return serving(lambda context: ContactNode(context, parameter_overrides=[
        Parameter(name, value=value) for name, value in parameters.items()]))


def refusal(**parameters):
    """Return why a node does not start with these parameters."""
    with pytest.raises(ValueError) as refused:
        with node_with(**parameters):
            pass
    return str(refused.value)


@pytest.fixture
def client():
    client = WrenchClient()
    yield client
    client.close()


@pytest.mark.parametrize('serialization', ['raw', 'typed'])
def test_a_container_lands_on_wrenches_alone(client, serialization):
    """Lowered by 30 mm in lockstep at 200 Hz: it rests. Every wrench is that of the law.

    The simulator moves the container up and down, and knows nothing of contacts.
    """
    with node_with(**LANDING, serialization=serialization, friction=0.3, latency=0.001):
        client.offer_until_answered([0, 0, 9, 0, 0, 0, 1], STACK)
        law = PatchLaw.for_loop(Body.of_box(poses.CONTAINER, MASS), rate_hz=RATE,
                                latency=0.001 + 0.5 / RATE, friction=0.3)
        solver = SceneSolver(two_boxes(poses.CONTAINER, poses.CONTAINER), model='exact')
        height, speed, before, start = HEIGHT + 0.03, 0.0, None, client.next_stamp()
        touched = 0
        for tick in range(400):
            pose = np.array([0.3, 0.1, height, 0.0, 0.0, 0.0, 1.0])
            wrench = client.wrench(pose, STACK, start + tick * PERIOD)
            answer = solver([pose, STACK])
            velocity = np.zeros(6) if before is None else np.append(
                RATE * (pose - before)[:3], np.zeros(3))
            expected = np.zeros(6)
            if answer.touching:
                touched += 1
                expected = law.wrench(answer.touching[0][1], pose, velocity)
            else:
                law.reset()
            assert wrench == pytest.approx(expected, rel=1e-6, abs=1e-3)
            before = pose
            for _ in range(5):
                speed += 0.001 * (wrench[2] / MASS - 9.81)
                height += 0.001 * speed
        assert touched > 300
        assert abs(speed) < 1e-4 and wrench[2] == pytest.approx(WEIGHT, rel=1e-3)
        message = client.wrenches['contact/wrench'][start]
        assert message.header.frame_id == 'map' and stamp_of(message) == start


def test_wrenches_of_a_scene():
    """One topic per pair with a body, in every evaluation of that pair."""
    topics = ('load_floor/wrench', 'lid_load/wrench', 'lorry_floor/wrench')
    client = WrenchClient(wrenches=topics, boxes=('load', 'lid', 'lorry'))
    down, apart = (0, 0, 0.999, 0, 0, 0, 1), (0, 0, 8, 0, 0, 0, 1)
    try:
        with node_with(scene=SCENE, model='exact', wrench=True, rate=RATE,
                       pair_topics=False) as node:
            names = {publisher.topic_name for publisher in node.publishers}
            assert {name for name in names if 'wrench' in name} == {
                '/load_floor/wrench', '/lid_load/wrench'}
            kept = client.wrenches['load_floor/wrench']
            stamp = client.next_stamp()
            for _ in range(200):
                stamp += PERIOD
                client.tick(stamp, load=down, lid=apart, lorry=apart)
                if client.spin(partial(kept.__contains__, stamp), 0.1):
                    break
            force = kept[stamp].wrench.force
            assert kept[stamp].header.frame_id == 'yard'
            assert force.z > 0.0 and force.x == force.y == 0.0
            lid = client.wrenches['lid_load/wrench']
            assert client.spin(lambda: stamp in lid) and not numbers(lid[stamp]).any()
            stamp += PERIOD
            client.tick(stamp, load=down, lid=(0, 0, 2.498, 0, 0, 0, 1), lorry=down)
            assert client.spin(lambda: stamp in lid) and lid[stamp].wrench.force.z > 0.0
            result, = node.set_parameters([Parameter('wrench', value=False)])
            assert result.successful
            assert not any('wrench' in one.topic_name for one in node.publishers)
            assert not client.wrenches['lorry_floor/wrench']
    finally:
        client.close()


def test_time_that_goes_back_begins_anew(client):
    """A simulator that starts again at time zero gets wrenches from its first tick."""
    with node_with(**LANDING):
        deep = [0, 0, HEIGHT - 0.001, 0, 0, 0, 1]
        client.offer_until_answered([0, 0, 9, 0, 0, 0, 1], STACK)
        start = client.next_stamp()
        first = client.wrench(deep, STACK, start)
        for tick in range(1, 4):
            pose = [1e-4 * tick, *deep[1:]]
            dragged = client.wrench(pose, STACK, start + tick * PERIOD)
        assert dragged[0] < -1e3
        again = client.wrench(deep, STACK, 2_000_000_000)
        assert again == pytest.approx(first, rel=1e-9, abs=1e-6)


BARE = SCENE.replace(', mass: 1000', '').replace(', mass: 500', '')


@pytest.mark.parametrize('change, words', [
    ({'rate': 0.0}, 'set rate:=200.0'), ({'mass_a': -1.0}, 'mass_a must lie within 0 and 1e'),
    ({'mass_a': 0.0}, 'no box has a mass, so no force moves one: set mass_a or mass_b'),
    ({'pairing': 'latest'}, 'set pairing:=stamp'), ({'latency': 2.0}, 'latency must lie within'),
    ({'model': 'fcl'}, "model 'fcl' gives the point alone: set model:=mlp or model:=exact"),
    ({'model': 'soup-2'}, 'gives the point alone'),
    ({'model': 'paper', 'size_a': poses.CUBE, 'size_b': poses.CUBE}, 'gives the point alone'),
    ({'mass_a': 0.0, 'scene': BARE}, 'give a box that moves a mass'),
    ({'scene': SCENE}, 'write masses into the scene file')])
def test_wrong_use_is_refused_with_the_remedy(change, words):
    pytest.importorskip('fcl')
    assert words in refusal(**LANDING | change)


def test_masses_of_a_scene_file():
    """Of moving boxes alone; a scene that is written has them."""
    scene = parse_scene(SCENE)
    assert [box.mass for box in scene.boxes.values()] == [1000.0, 500.0, 0.0, 0.0]
    assert parse_scene(scene_text(scene)) == scene
    assert 'box load: 2 x 2 x 2 m, 1000 kg, moves: load/pose' in meaning(scene)
    for wrong, words in (('mass: 0}', ':3: boxes.load.mass: 0 is not positive'),
                         ('mass: .nan}', 'boxes.load.mass: nan is outside 0 to 1e'),
                         ('mass: heavy}', "'heavy' is not a number"),
                         ('mass: 1, pose: [0, 0, 0, 0, 0, 0, 1]}', 'has both mass and pose')):
        with pytest.raises(SceneError, match=words):
            parse_scene(SCENE.replace('mass: 1000}', wrong))


def answered():
    """Return an answer with a contact, a close pair and a stale one, and ids of all three."""
    scene = parse_scene(SCENE + '  - {a: lid, b: floor}\n')
    where = [np.array([0.1, 0.2, 0.99, 0.01, 0.02, 0.03, 1.0]), STACK + [0, 0, 5, 0, 0, 0, 0], None]
    return SceneSolver(scene, model='exact', margin=10.0)(where), scene.ids


@pytest.mark.parametrize('cloud', [False, True])
def test_contacts_by_pair_are_those_of_the_solver(cloud):
    """To the bit, by the names of their pairs, from either message."""
    if not cloud and ContactsMessage is None:
        pytest.skip('box_contact_msgs is not installed')
    answer, ids = answered()
    assert answer.close and answer.stale and answer.touching
    message = (make_cloud if cloud else make_contacts)(make_header(0, 'yard'), answer)
    found = contacts_by_pair(message, ids)
    assert list(found) == [pair.label for pair, _ in answer.listed]
    for pair, contact in answer.listed:
        # Messages do not tell the winning axis.
        for one, other in zip(found[pair.label][:-1], contact[:-1]):
            assert np.array_equal(one, other, equal_nan=True), pair
    if cloud:
        with pytest.raises(Refused, match='hand over `Scene.ids`'):
            contacts_by_pair(message)


@pytest.mark.parametrize('cloud', [False, True])
def test_a_scene_law_holds_messages(cloud):
    """The wrenches of all bodies are those of the solver's own answer."""
    if not cloud and ContactsMessage is None:
        pytest.skip('box_contact_msgs is not installed')
    scene = parse_scene(SCENE)
    where = np.array([(0, 0, 0.999, 0, 0, 0, 1), (0.1, 0, 2.497, 0, 0, 0, 1),
                      (5, 0, 0.9, 0, 0, 0, 1)])
    answer = SceneSolver(scene, model='exact')(where)
    message = (make_cloud if cloud else make_contacts)(make_header(0, 'yard'), answer)
    found = []
    for one in (answer, read_answer(message, scene)):
        law = SceneLaw.for_loop(scene, {'load': 1000.0, 'lid': 500.0}, rate_hz=RATE)
        law.hold(one, where)
        found.append(law.wrenches(where, np.zeros((3, 6))))
    assert np.array_equal(*found) and found[0][0, 2] != 0.0 and found[0][1, 2] > 0.0
    other = parse_scene(BARE.replace('  - {a: lid, b: load}\n', ''))
    with pytest.raises(Refused, match='hand over|read the scene that the node has'):
        read_answer(message, other)


def test_contacts_without_a_patch_are_still_contacts():
    """The law refuses them; the reader does not."""
    bare = Contact(True, -0.1, np.array([0.0, 0.0, -1.0]), np.zeros(3), math.nan,
                   np.full((3, 3), math.nan))
    answer = Answer([(Pair(0, '', 'box_a', 'box_b'), bare)], [], 1)
    found = contacts_by_pair(make_cloud(make_header(0, 'map'), answer))['box_a_box_b']
    assert found.colliding and math.isnan(found.volume) and np.isnan(found.covariance).all()


def test_wrenches_of_poses_as_an_array():
    """The masses of boxes that come as one message."""
    scene = ('poses: array\nboxes: {b: {size: [2, 2, 2], count: 2, mass: 1000}}\n'
             'pairs: [{a: b01, b: b02}]\n')
    client = WrenchClient(wrenches=('b01_b02/wrench',))
    try:
        with node_with(scene=scene, wrench=True, rate=RATE, model='exact'):
            publisher = client.node.create_publisher(PoseArray, 'poses', 100)
            kept = client.wrenches['b01_b02/wrench']
            for _ in range(200):
                message = PoseArray(header=make_header(client.next_stamp(), 'map'))
                message.poses = [PoseStamped().pose, PoseStamped().pose]
                for pose, height in zip(message.poses, (1.999, 0.0)):
                    pose.position.z, pose.orientation.w = height, 1.0
                publisher.publish(message)
                if client.spin(lambda: bool(kept), 0.1):
                    break
            assert next(iter(kept.values())).wrench.force.z > 0.0
    finally:
        client.close()
