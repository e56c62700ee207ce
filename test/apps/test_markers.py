"""Markers: what is drawn of poses and contacts, at what rate, and that it is taken away again."""
from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import poses
import pytest
import yaml
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from ros_client import MATCH_SECONDS, Client, serving
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from box_contact_ros import ContactSolver
from box_contact_ros.apps.viewer.markers import PARAMETERS, MarkersNode, box_marker, contact_markers
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import make_cloud, make_header
from box_contact_ros.resources import resource_path
from box_contact_ros.scene.force.patch_law import Patch
from box_contact_ros.scene.scene_solver import Answer, Pair
from box_contact_ros.scene.stamp_pairing import StampedPose
from box_contact_ros.solver.contact import Contact

SLAB, CUBE = (2.0, 4.0, 1.0), (2.0, 2.0, 2.0)
HEADER = make_header(1_500_000_000, 'yard')
TOUCH = Patch(np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.6, 0.8]), 0.0125, 0.05, np.eye(3) / 12)
NO_PATCH = replace(TOUCH, volume=math.nan, covariance=np.full((3, 3), math.nan))
TOUCHING = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])
APART = np.array([0.5, 0.25, 2.5, 0, 0, 0, 1])


def xyz(values):
    return values.x, values.y, values.z


def test_a_box_is_a_cube_of_its_full_extents_at_its_pose():
    """Stamp and frame are the pose's; a quaternion of length 2 is made one of length 1."""
    pose = StampedPose(np.array([1.0, 2.0, 3.0, 0.0, 0.0, 1.2, 1.6]), 'yard', 1_500_000_000)
    a, b = (box_marker(box, pose, SLAB) for box in (0, 1))
    assert (a.type, a.action, a.header) == (Marker.CUBE, Marker.ADD, HEADER)
    assert xyz(a.pose.position) == (1.0, 2.0, 3.0)
    q = a.pose.orientation
    assert (q.x, q.y, q.z, q.w) == pytest.approx((0.0, 0.0, 0.6, 0.8))
    assert xyz(a.scale) == SLAB
    assert 0.0 < a.color.a < 1.0
    assert (a.ns, a.color) != (b.ns, b.color)


def test_a_contact_is_point_normal_and_depth():
    """The sphere is at the point; the arrow goes from it, along the normal; the depth is in mm."""
    point, normal, depth, _ = contact_markers(HEADER, TOUCH, SLAB, CUBE)
    assert [m.type for m in (point, normal, depth)] == [
        Marker.SPHERE, Marker.ARROW, Marker.TEXT_VIEW_FACING]
    assert all(m.action == Marker.ADD and m.header == HEADER and m.color.a == 1.0
               for m in (point, normal, depth))
    assert xyz(point.pose.position) == (1.0, 2.0, 3.0)
    tail, tip = (np.array(xyz(end)) for end in normal.points)
    assert tail == pytest.approx([1.0, 2.0, 3.0])
    length = np.linalg.norm(tip - tail)
    assert (tip - tail) / length == pytest.approx([0.0, 0.6, 0.8])
    # Seen beside the smaller box, whose edge is 2 m: neither a speck nor larger than the box.
    assert 0.1 < length < 1.0 and 0.02 < point.scale.x < 0.2
    assert depth.text == 'depth 12.50 mm'


def test_a_patch_is_an_ellipse_around_the_point():
    """A line in the contact plane, closed; of a square of 1 m it is the circle in it."""
    *_, patch = contact_markers(HEADER, TOUCH, SLAB, CUBE)
    assert (patch.type, patch.action, patch.header) == (Marker.LINE_STRIP, Marker.ADD, HEADER)
    assert xyz(patch.pose.position) == (1.0, 2.0, 3.0)
    line = np.array([xyz(point) for point in patch.points])
    assert line[0] == pytest.approx(line[-1], abs=1e-12)
    assert np.abs(line @ TOUCH.normal).max() < 1e-12
    assert np.linalg.norm(line, axis=1) == pytest.approx(0.5)


def test_a_model_without_patch_has_its_ellipse_deleted():
    """The point, normal and depth are drawn all the same."""
    assert [m.action for m in contact_markers(HEADER, NO_PATCH, SLAB, CUBE)] == [
        Marker.ADD, Marker.ADD, Marker.ADD, Marker.DELETE]


def test_without_contact_the_same_markers_are_deleted():
    """A marker is known by namespace and id, so those of both must be the same."""
    drawn, deleted = (contact_markers(HEADER, touch, SLAB, CUBE) for touch in (TOUCH, None))
    assert [(m.ns, m.id) for m in deleted] == [(m.ns, m.id) for m in drawn]
    assert len({(m.ns, m.id) for m in drawn}) == 4
    assert all(m.action == Marker.DELETE for m in deleted)


def test_the_rviz_config_names_topics_and_namespaces_that_exist():
    config = yaml.safe_load(resource_path('config', 'contact.rviz').read_text('utf-8'))
    displays = {display['Class'].rpartition('/')[2]: display
                for display in config['Visualization Manager']['Displays']}
    pose = StampedPose(poses.IDENTITY, 'yard', 0)
    markers = [box_marker(0, pose, CUBE), box_marker(1, pose, CUBE),
               *contact_markers(HEADER, TOUCH, CUBE, CUBE)]
    assert set(displays['MarkerArray']['Namespaces']) == {marker.ns for marker in markers}
    assert displays['MarkerArray']['Topic']['Value'] == 'markers'
    assert displays['PointStamped']['Topic']['Value'] == 'contact/point'
    assert displays['Grid']['Enabled']


# --- the node -------------------------------------------------------------------------------------

SETTINGS = {'size_a': list(CUBE), 'size_b': list(CUBE)}


@pytest.fixture
def client():
    """With what the markers node publishes."""
    client = Client()
    client.arrays = []
    client.node.create_subscription(MarkerArray, 'markers', client.arrays.append,
                                    QoSProfile(depth=1000))
    yield client
    client.close()


@pytest.fixture
def node():
    with serving(lambda context: MarkersNode(context, parameter_overrides=[
            Parameter(name, value=value) for name, value in SETTINGS.items()])) as node:
        yield node


@pytest.fixture
def contact_node():
    with serving(lambda context: ContactNode(context, parameter_overrides=[
            Parameter(name, value=value)
            for name, value in (SETTINGS | {'model': 'exact'}).items()])) as node:
        yield node


def actions(array):
    return {marker.ns: marker.action for marker in array.markers}


def offer_until_drawn(client, count):
    """Send poses until so many markers are drawn: all that have to have matched."""
    deadline = time.monotonic() + MATCH_SECONDS
    while not (client.arrays and len(client.arrays[-1].markers) == count):
        assert time.monotonic() < deadline, 'no markers'
        client.send(poses.IDENTITY, APART)
        client.spin(lambda: False, 0.1)


def drawn(client, wanted):
    """Wait until what shows the contact has this action in the last array."""
    names = 'point', 'normal', 'depth', 'patch'
    return client.spin(lambda: [actions(client.arrays[-1]).get(name) for name in names] == [
        wanted] * len(names), 10.0)


def test_draws_what_the_contact_node_answers(client, node, contact_node):
    """In contact with its point; apart, taken away; the boxes in both cases."""
    offer_until_drawn(client, 6)
    stamp = client.ask(poses.IDENTITY, TOUCHING, frames=('yard', 'yard'))
    assert drawn(client, Marker.ADD)
    markers = {marker.ns: marker for marker in client.arrays[-1].markers}
    assert set(markers) == {'box_a', 'box_b', 'point', 'normal', 'depth', 'patch'}
    assert {marker.header.frame_id for marker in markers.values()} == {'yard'}
    assert markers['point'].header == client.clouds[stamp].header
    wanted = ContactSolver(CUBE, CUBE, model='exact')(poses.IDENTITY, TOUCHING)
    assert xyz(markers['point'].pose.position) == tuple(wanted.point)
    client.ask(poses.IDENTITY, APART)
    assert drawn(client, Marker.DELETE)
    assert actions(client.arrays[-1])['box_b'] == Marker.ADD
    assert client.spin(lambda: xyz(client.arrays[-1].markers[1].pose.position) == (0.5, 0.25, 2.5),
                       10.0)


def test_nobody_answers_any_more(client, node):
    """A contact does not stay in the air while the boxes move on."""
    with serving(lambda context: ContactNode(context, parameter_overrides=[
            Parameter(name, value=value)
            for name, value in (SETTINGS | {'model': 'exact'}).items()])):
        offer_until_drawn(client, 6)
        client.ask(poses.IDENTITY, TOUCHING)
        assert drawn(client, Marker.ADD)
    client.spin(lambda: False, 0.7)
    client.send(poses.IDENTITY, TOUCHING)
    assert drawn(client, Marker.DELETE)


def test_contacts_of_another_scene_are_not_drawn(client, node, capfd):
    """A row of a pair that is not the two boxes', and two rows: said, and no point put anywhere."""
    offer_until_drawn(client, 2)
    publisher = client.node.create_publisher(PointCloud2, 'contacts', 10)
    assert client.spin(lambda: publisher.get_subscription_count() > 1, 10.0)  # ours, and markers'
    contact = Contact(True, -0.1, np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0, np.zeros((3, 3)))
    for pairs in ([Pair(3, 'p', 'a', 'b')], [Pair(0, 'p', 'a', 'b'), Pair(1, 'q', 'a', 'c')]):
        publisher.publish(make_cloud(make_header(client.next_stamp(), 'map'), Answer(
            [(pair, contact) for pair in pairs], [], len(pairs))))
        client.spin(lambda: False, 0.2)
        client.arrays.clear()
        client.send(poses.IDENTITY, TOUCHING)
        assert client.spin(lambda: client.arrays, 5.0)
        assert not any('point' in actions(array) for array in client.arrays)
    assert 'with other pairs' in capfd.readouterr().err


def test_no_more_often_than_asked(client, node, contact_node):
    """Poses at some 500 Hz for a second: markers at the rate, and none while nothing is new."""
    result, = node.set_parameters([Parameter('rate', value=20)])
    assert result.successful
    offer_until_drawn(client, 6)
    client.arrays.clear()
    started = time.monotonic()
    while time.monotonic() - started < 1.0:
        client.send(poses.IDENTITY, TOUCHING)
        client.spin(lambda: False, 0.002)
    client.spin(lambda: False, 0.3)
    count = len(client.arrays)
    assert 2 <= count <= 28  # 1.3 s of 20 Hz, and a timer that catches up
    client.spin(lambda: False, 0.5)
    assert len(client.arrays) == count


def test_bad_poses_are_not_drawn(client, node):
    """Neither NaN nor a quaternion of zero length; the box stays where it was."""
    offer_until_drawn(client, 2)
    client.spin(lambda: False, 0.3)
    client.arrays.clear()
    for bad in ((math.nan, 0, 0, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 0)):
        client.send(poses.IDENTITY, bad)
    assert client.spin(lambda: client.arrays, 10.0)
    assert xyz(client.arrays[-1].markers[1].pose.position) == (0.5, 0.25, 2.5)


@pytest.mark.parametrize('name, value', [
    ('rate', 0.0), ('rate', 'often'), ('size_a', [1.0, 2.0]), ('size_b', [1.0, 0.0, 1.0])])
def test_bad_parameters_are_refused(node, name, value):
    """By name, and the old ones stay."""
    result, = node.set_parameters([Parameter(name, value=value)])
    assert not result.successful and name in result.reason
    assert node.get_parameter(name).value == SETTINGS.get(name, PARAMETERS[name].default)


def test_program(program, client):
    """As a process, with parameters from the command line; ends with status 0 on SIGINT."""
    running = program('markers', '--ros-args', '-p', 'rate:=10', '-p', 'size_b:=[1.0,1.0,1.0]')
    running.wait_for_output('ready', 60)
    running.signal(2)
    assert running.wait(10) == 0, running.output
    assert 'rate' in program('markers', '--help').wait_for_output('most marker arrays')
