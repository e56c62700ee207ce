# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Markers: what is drawn of poses and contacts, and that it is taken away again."""
from __future__ import annotations

import json
import math
import time
from contextlib import closing

import numpy as np
import poses
import pytest
import yaml
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from patience import PATIENCE
from rclpy.qos import QoSProfile
from ros_client import CUBES, Client, serving
from sensor_msgs.msg import MultiDOFJointState
from typed_messages import a_box, changed, contacts_at, joint_state, read
from visualization_msgs.msg import Marker, MarkerArray

from box_contact_msgs.srv import SetBoxes
from box_contact_ros import ContactSolver
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import make_header
from box_contact_ros.resources import resource_path
from box_contact_ros.scene.boxes import Box
from box_contact_ros.scene.scene import Pair, Scene
from box_contact_ros.solver.contact import Contact
from box_contact_ros.solver.nearest import Nearest
from box_contact_ros.view.live.listener import DrawnTick, SceneRows, read_sorted
from box_contact_ros.view.live.markers import LABELLED, PERIOD, MarkersNode, scene_markers

NAMESPACES = ('boxes', 'points', 'normals', 'patches', 'depths', 'near', 'distances')
SLAB, CUBE = (2.0, 4.0, 1.0), (2.0, 2.0, 2.0)
STAMP = 1_500_000_000
CHANGES = 60  # before a listener starts; 500 were tried
HEADER = make_header(STAMP, 'yard')
YARD = Scene({'slab': Box(SLAB, pose_topic='slab/pose'),
              's1': Box(CUBE, (1.0, 2.0, 3.0, 0.0, 0.0, 1.2, 1.6)),
              's2': Box(CUBE, (9.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0))},
             (Pair.between('slab', 's1'), Pair.between('slab', 's2')))
CONTACT = Contact(True, -0.0125, np.array([0.0, 0.6, 0.8]), np.array([1.0, 2.0, 3.0]), 0.05,
                  np.eye(3) / 12)
TOUCHING = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])
APART = np.array([0.5, 0.25, 2.5, 0, 0, 0, 1])


def xyz(values):
    return values.x, values.y, values.z


def drawing(touching, scene=YARD, near=None):
    """Return the markers of a scene, and those of each namespace."""
    rows = SceneRows(scene)
    poses = np.where(np.isnan(rows.poses), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0], rows.poses)
    answer = read_sorted(read(contacts_at(STAMP, touching, near=near)), scene)
    markers = scene_markers(DrawnTick(rows, STAMP, 'yard', poses, answer, 0.0))
    return markers, {name: [m for m in markers if m.ns == name] for name in NAMESPACES}


def test_a_box_is_a_cube_of_its_full_extents_at_its_pose():
    """Of every box of the scene; a quaternion of length 2 is made one of length 1."""
    markers, found = drawing({})
    assert markers == found['boxes'] and [m.id for m in markers] == [0, 1, 2]
    assert all((m.type, m.action, m.header) == (Marker.CUBE, Marker.ADD, HEADER) for m in markers)
    assert [xyz(m.scale) for m in markers] == [SLAB, CUBE, CUBE]
    assert xyz(markers[1].pose.position) == (1.0, 2.0, 3.0)
    q = markers[1].pose.orientation
    assert (q.x, q.y, q.z, q.w) == pytest.approx((0.0, 0.0, 0.6, 0.8))
    assert all(0.0 < m.color.a < 1.0 for m in markers)
    assert markers[0].color != markers[1].color == markers[2].color  # a, and b of pairs


def test_a_contact_is_point_normal_depth_and_patch():
    """The sphere is at the point; the arrow goes from it, along the normal; the depth is in mm.

    The patch is a closed line in the contact plane: of a square of 1 m the circle in it.
    """
    _, found = drawing({Pair.between('slab', 's1'): CONTACT})
    (point,), (normal,), (depth,), (patch,) = (found[name] for name in (
        'points', 'normals', 'depths', 'patches'))
    assert [m.type for m in (point, normal, depth, patch)] == [
        Marker.SPHERE_LIST, Marker.ARROW, Marker.TEXT_VIEW_FACING, Marker.LINE_LIST]
    assert all(m.action == Marker.ADD and m.header == HEADER and m.color.a == 1.0
               for m in (point, normal, depth, patch))
    assert [xyz(place) for place in point.points] == [(1.0, 2.0, 3.0)]
    tail, tip = (np.array(xyz(end)) for end in normal.points)
    assert tail == pytest.approx([1.0, 2.0, 3.0])
    length = np.linalg.norm(tip - tail)
    assert (tip - tail) / length == pytest.approx([0.0, 0.6, 0.8])
    # Seen beside the smaller box, whose edge is 2 m: neither a speck nor larger than the box.
    assert 0.1 < length < 1.0 and 0.02 < point.scale.x < 0.2
    assert depth.text == 'depth 12.50 mm'
    ends = np.array([xyz(end) for end in patch.points]).reshape(-1, 2, 3) - CONTACT.point
    assert np.roll(ends[:, 1], 1, axis=0) == pytest.approx(ends[:, 0], abs=1e-12)
    assert np.abs(ends @ CONTACT.normal).max() < 1e-12
    assert np.linalg.norm(ends, axis=2) == pytest.approx(math.sqrt(0.5))


def test_all_contacts_are_drawn_and_the_deepest_labelled():
    """With normals of their own; ids count from the deepest on."""
    boxes = {f's{n}': Box(CUBE, (n, 0, 0, 0, 0, 0, 1)) for n in range(30)}
    boxes['load'] = Box(CUBE, pose_topic='load/pose')
    pairs = tuple(Pair(f'p{n}', 'load', f's{n}') for n in range(30))
    touching = {pair: changed(CONTACT, separation=-1e-3 * n, point=np.full(3, n))
                for n, pair in enumerate(pairs)}
    _, found = drawing(touching, Scene(boxes, pairs))
    assert [xyz(place)[0] for place in found['points'][0].points] == list(range(29, -1, -1))
    assert [m.id for m in found['normals']] == list(range(30))
    assert [m.text for m in found['depths']] == [
        f'depth {n:.2f} mm' for n in range(29, 29 - LABELLED, -1)]
    assert len(found['patches'][0].points) == 30 * 4 * 2


def test_a_pair_that_is_near_has_a_dashed_line_and_its_distance():
    """From point to point; the distance is written at its middle, the nearest first."""
    pairs = [Pair.between('slab', 's1'), Pair.between('slab', 's2')]
    near = Nearest(False, 0.5, (0.0, 0.6, 0.8), (1.0, 2.0, 3.0), (1.0, 2.3, 3.4))
    far = Nearest(False, 2.0, (0.0, 0.6, 0.8), (1.0, 2.0, 3.0), (1.0, 3.2, 4.6))
    _, found = drawing({}, near={pairs[0]: far, pairs[1]: near})
    (line,), (nearest, second) = found['near'], found['distances']
    ends = np.array([xyz(end) for end in line.points]).reshape(2, -1, 3)
    for dashes, pair in zip(ends, (near, far)):
        assert dashes[0] == pytest.approx(pair.point_a)
        assert dashes[-1] == pytest.approx(pair.point_b)
        lengths = np.linalg.norm(np.diff(dashes, axis=0), axis=1)
        assert lengths == pytest.approx(pair.distance / len(lengths))
    assert (nearest.text, second.text) == ('0.500 m', '2.000 m')
    assert xyz(nearest.pose.position) == pytest.approx((1.0, 2.15, 3.2))


def test_the_rviz_config_names_topics_and_namespaces_that_exist():
    config = yaml.safe_load(resource_path('config', 'contact.rviz').read_text('utf-8'))
    displays = config['Visualization Manager']['Displays']
    topics = {display['Topic']['Value']: display for display in displays if 'Topic' in display}
    assert set(topics) == {'markers', 'contact/point'}
    assert set(topics['markers']['Namespaces']) == set(NAMESPACES)
    assert all(display['Enabled'] for display in displays)


def leaves(layout):
    """Return the panels that a Foxglove layout places."""
    return [layout] if isinstance(layout, str) else [
        name for half in ('first', 'second') for name in leaves(layout[half])]


def test_the_foxglove_layout_names_topics_and_fields_that_exist():
    """Topics of the schema, or of markers; what is plotted is a number of the message's schema."""
    config = json.loads(resource_path('config', 'contact.foxglove.json').read_text('utf-8'))
    panels = config['configById']
    assert sorted(leaves(config['layout'])) == sorted(panels)
    channels = yaml.safe_load(resource_path('msg_schemas', 'asyncapi.yaml').read_text('utf-8'))[
        'channels']
    known = {'/' + channel['address'].lstrip('/') for channel in channels.values()}
    drawn = {topic for topic, shown in panels['3D!scene']['topics'].items() if shown['visible']}
    assert drawn == {'/markers'}
    assert set(panels['3D!scene']['topics']) - drawn < known
    assert panels['DiagnosticSummary!node']['topicToRender'] in known
    schemas = {'/contact/point': 'point_stamped.json', '/contact/normal': 'vector3_stamped.json'}
    for panel in (panels['Plot!point'], panels['Plot!normal']):
        for path in panel['paths']:
            topic, *fields = path['value'].split('.')
            found = json.loads(resource_path('msg_schemas', schemas[topic]).read_text('utf-8'))
            for field in fields:
                found = found['properties'][field]
                file, _, name = found.get('$ref', '').partition('#/$defs/')
                if file:
                    shared = json.loads(resource_path('msg_schemas', file).read_text('utf-8'))
                    found = shared['$defs'][name]
            assert topic in known and path['enabled']


# --- the node -------------------------------------------------------------------------------------

@pytest.fixture
def client():
    """With what the markers node publishes."""
    with closing(Client()) as client:
        client.arrays = []
        client.node.create_subscription(MarkerArray, 'markers', client.arrays.append,
                                        QoSProfile(depth=1000))
        yield client


@pytest.fixture
def node():
    with serving(MarkersNode, **CUBES) as node:
        yield node


@pytest.fixture
def contact_node():
    with serving(ContactNode, **CUBES) as node:
        yield node


def actions(array):
    return {(marker.ns, marker.id): marker.action for marker in array.markers}


def offer_until_drawn(client, count):
    """Send poses until so many markers are drawn: all that have to have matched."""
    deadline = time.monotonic() + PATIENCE
    while not (client.arrays and len(client.arrays[-1].markers) == count):
        assert time.monotonic() < deadline, 'no markers'
        client.send(poses.IDENTITY, TOUCHING)
        client.spin(lambda: False, 0.1)


def test_draws_what_the_contact_node_answers(client, node, contact_node):
    """In contact with its point; apart, taken away; the boxes in both cases."""
    offer_until_drawn(client, 6)
    stamp = client.ask(poses.IDENTITY, TOUCHING, frames=('yard', 'yard'))
    assert client.spin(lambda: client.arrays[-1].markers[0].header == client.contacts[stamp].header)
    markers = {marker.ns: marker for marker in client.arrays[-1].markers}
    assert set(markers) == {'boxes', 'points', 'normals', 'patches', 'depths'}
    wanted = ContactSolver(CUBE, CUBE, model='exact')(poses.IDENTITY, TOUCHING)
    assert xyz(markers['points'].points[0]) == tuple(wanted.point)
    client.arrays.clear()
    client.ask(poses.IDENTITY, APART)
    # Once taken away: the next arrays need not say so again.
    names = 'points', 'normals', 'patches', 'depths'
    assert client.spin(lambda: any(
        [actions(array).get((name, 0)) for name in names] == [Marker.DELETE] * len(names)
        for array in client.arrays))
    assert client.spin(lambda: xyz(client.arrays[-1].markers[1].pose.position) == (0.5, 0.25, 2.5))
    assert client.spin(lambda: node.quiet)
    count = len(client.arrays)
    assert not client.spin(lambda: len(client.arrays) > count + 1, 0.5)  # nothing moves any more


def test_bad_poses_are_not_drawn(client, node):
    """Neither NaN nor a quaternion of zero length; the box stays where it was."""
    offer_until_drawn(client, 2)
    client.send(poses.IDENTITY, APART)
    assert client.spin(lambda: xyz(client.arrays[-1].markers[1].pose.position) == (0.5, 0.25, 2.5))
    client.arrays.clear()
    for bad in ((math.nan, 0, 0, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 0)):
        client.send(poses.IDENTITY, bad)
    assert client.spin(lambda: client.arrays)
    assert xyz(client.arrays[-1].markers[1].pose.position) == (0.5, 0.25, 2.5)


def test_program(program):
    """As a process, with a scene from the command line; ends with status 0 on SIGINT."""
    running = program('markers', '--ros-args', '-p', 'scene:=config/scenes/two_boxes.yaml')
    running.wait_for_output('ready')
    running.signal(2)
    assert running.wait() == 0, running.output
    assert 'scene' in program('markers', '--help').wait_for_output('size_a')
    bad = program('markers', '--ros-args', '-p', 'scene:=no_such_scene')
    assert bad.wait() == 1 and 'no_such_scene' in bad.output


def test_boxes_that_come_and_go_are_drawn(tmp_path):
    """Also by a listener that starts after many changes, or misses some."""
    scene = {'poses': 'named', 'pairs': 'all', 'boxes': {
        'ground': {'size': [20, 20, 1], 'pose': [0, 0, -0.5, 0, 0, 0, 1]},
        'hook': {'size': CUBE}}}
    path = tmp_path / 'yard.yaml'
    path.write_text(yaml.safe_dump(scene))
    shown: dict[int, float] = {}  # heights of boxes by id
    poses = {'hook': (0, 0, 9, 0, 0, 0, 1)}

    def hear(message):
        for marker in message.markers:
            if marker.ns == 'boxes':
                shown.pop(marker.id, None)
                if marker.action == Marker.ADD:
                    shown[marker.id] = marker.pose.position.z

    def is_shown(*heights):
        sent = 0.0

        def send():
            nonlocal sent
            if time.monotonic() - sent > PERIOD:
                sent = time.monotonic()
                named.publish(joint_state(poses, 'map', client.next_stamp()))
        return client.spin(lambda: sorted(shown.values()) == sorted(heights) or send())

    def change(**fields):
        assert client.call(SetBoxes, 'contact_node/set_boxes', SetBoxes.Request(**fields)).success

    with closing(Client()) as client, serving(ContactNode, scene=str(path),
                                              pair_topics=False):
        named = client.node.create_publisher(MultiDOFJointState, 'poses', 10)
        client.node.create_subscription(MarkerArray, 'markers', hear, 10)
        for number in range(1, CHANGES + 1):
            change(fixed=[a_box('c1', (0, 0, number, 0, 0, 0, 1), CUBE)])
        with serving(MarkersNode, scene=str(path)) as markers:
            assert is_shown(-0.5, 9.0, CHANGES)
            change(fixed=[a_box('c1', (0, 0, 3, 0, 0, 0, 1), CUBE)])
            assert is_shown(-0.5, 9.0, 3.0)
            change(moving=[a_box('c1', (0, 0, 0, 0, 0, 0, 1))])
            poses['c1'] = (0, 0, 7, 0, 0, 0, 1)
            assert is_shown(-0.5, 9.0, 7.0)
            yard = markers._yard  # as if it had missed a change
            yard.yard = yard.yard._replace(revision=yard.yard.revision - 1)
            change(absent=['c1'])
            assert is_shown(-0.5, 9.0)
            change(fixed=[a_box(f'p{k}', (0, 0, 20 + k, 0, 0, 0, 1), CUBE) for k in range(600)])
            assert is_shown(-0.5, 9.0, *range(20, 620))
            for step in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP,
                         Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
                request = ChangeState.Request(transition=Transition(id=step))
                assert client.call(ChangeState, 'contact_node/change_state', request).success
            assert is_shown(-0.5, 9.0)


def test_fixed_boxes_are_sent_as_they_change_and_once_a_second(tmp_path):
    """A viewer that starts later sees them; 30 times a second nobody has to read them."""
    path = tmp_path / 'yard.yaml'
    path.write_text(yaml.safe_dump({'poses': 'named', 'pairs': 'all', 'boxes': {
        'ground': {'size': [20, 20, 1], 'pose': [0, 0, -0.5, 0, 0, 0, 1]},
        'hook': {'size': CUBE}}}))
    arrays: list[set[int]] = []

    def hear(message):
        arrays.append({marker.id for marker in message.markers if marker.ns == 'boxes'})

    def send():
        named.publish(joint_state({'hook': (0, 0, 9, 0, 0, 0, 1)}, 'map', client.next_stamp()))

    with closing(Client()) as client, serving(ContactNode, scene=str(path), pair_topics=False), (
            serving(MarkersNode, scene=str(path))):
        named = client.node.create_publisher(MultiDOFJointState, 'poses', 10)
        client.node.create_subscription(MarkerArray, 'markers', hear, 10)
        assert client.spin(lambda: len(arrays) >= 45 or send())
        assert all(1 in drawn for drawn in arrays)  # the hook, by its row
        assert 1 <= sum(0 in drawn for drawn in arrays) <= len(arrays) // 5
        request = SetBoxes.Request(fixed=[a_box('c1', (0, 0, 3, 0, 0, 0, 1), CUBE)])
        assert client.call(SetBoxes, 'contact_node/set_boxes', request).success
        arrays.clear()
        assert client.spin(lambda: any(2 in drawn for drawn in arrays) or send())


def test_the_log_says_while_another_yard_is_drawn(program, tmp_path):
    """Without a contact node, the file is drawn."""
    running = program('markers', '--ros-args', '-p', 'scene:=config/scenes/two_boxes.yaml')
    assert running.wait_for_output('it has not told its boxes yet')
