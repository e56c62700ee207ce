# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The soup node: beside the contact node on one input, and as a process of its own."""
from __future__ import annotations

import math
import signal

import numpy as np
import poses
import pytest
import yaml
from geometry_msgs.msg import PointStamped, Vector3Stamped
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from ros_client import Client, serving, stamp_of

pytest.importorskip('fcl')

from box_contact_ros import ContactSolver
from box_contact_ros.demo.ros_client import ANSWERS
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import PATCH_FIELDS, read_contacts
from box_contact_ros.resources import resource_path
from box_contact_ros.soup.soup_node import SoupNode

ORIGIN = poses.IDENTITY
TOUCHING = np.array([0.5, 0.25, 1.875, 0.1, 0.2, 0, 1])
APART = np.array([0.5, 0.25, 4.0, 0, 0, 0, 1])
SIZES = {'size_a': [2.0, 2.0, 2.0], 'size_b': [2.0, 2.0, 2.0]}


class BothClient(Client):
    """Keeps what comes back under soup/ as well."""

    def __init__(self):
        super().__init__()
        self.soup = {'point': {}, 'normal': {}, 'contacts': {}}
        for kind, topic in ((PointStamped, 'contact/point'), (Vector3Stamped, 'contact/normal'),
                            ANSWERS['cloud']):
            kept = self.soup[topic.rpartition('/')[2].removesuffix('_cloud')]
            self.node.create_subscription(
                kind, f'soup/{topic}', self._keep_soup(f'soup/{topic}', kept),
                QoSProfile(depth=10_000))

    def _keep_soup(self, topic, kept):
        def callback(message):
            kept[stamp_of(message)] = message
            self.order.append((topic, stamp_of(message)))
        return callback

    def ask_both(self, pose_a, pose_b, **options):
        """Send a pair and wait for both clouds; the stamp."""
        stamp = self.ask(pose_a, pose_b, **options)
        assert self.spin(lambda: stamp in self.soup['contacts']), 'no answer under soup/'
        return stamp


def overrides(**values):
    return [Parameter(name, value=value) for name, value in (SIZES | values).items()]


@pytest.fixture(scope='module')
def soup_node():
    with serving(lambda context: SoupNode(
            context, parameter_overrides=overrides(divisions=4))) as node:
        yield node


@pytest.fixture(scope='module')
def client(soup_node):
    """With a contact node beside the soup node; both have answered."""
    client = BothClient()
    with serving(lambda context: ContactNode(
            context, parameter_overrides=overrides(model='exact'))):
        client.offer_until_answered(ORIGIN, APART)
        assert client.spin(lambda: client.soup['contacts'] or not client.send(ORIGIN, APART))
        yield client
    client.close()


def test_both_nodes_answer_one_input(client):
    """The same header; each with its own solver's numbers, point and normal before the cloud."""
    stamp = client.ask_both(ORIGIN, TOUCHING, frames=('yard', 'yard'))
    wanted = ContactSolver(poses.CUBE, poses.CUBE, model='soup-4')(ORIGIN, TOUCHING)
    point, normal, cloud = (client.soup[name][stamp] for name in ('point', 'normal', 'contacts'))
    assert point.header == normal.header == cloud.header == client.points[stamp].header
    assert point.header.frame_id == 'yard'
    assert (point.point.x, point.point.y, point.point.z) == tuple(wanted.point)
    assert (normal.vector.x, normal.vector.y, normal.vector.z) == tuple(wanted.normal)
    row, = read_contacts(cloud, client.ids)
    assert tuple(row)[3:11] == (0, *wanted.point, *wanted.normal, -wanted.separation)
    assert all(math.isnan(row[name]) for name in PATCH_FIELDS)  # a soup gives the point alone
    assert [topic for topic, at in client.order if at == stamp and topic.startswith('soup/')] == [
        'soup/contact/point', 'soup/contact/normal', f'soup/{ANSWERS["cloud"][1]}']
    exact, = client.rows(stamp)
    assert row['depth'] == exact['depth'] and row['point_x'] != exact['point_x']


def test_a_contained_box_is_answered(client, soup_node):
    """The soup's surfaces may not meet: an answer with finite numbers all the same."""
    result, = soup_node.set_parameters([Parameter('size_b', value=[0.5, 0.5, 0.5])])
    assert result.successful
    row, = read_contacts(client.soup['contacts'][client.ask_both(ORIGIN, (0.2, 0, 0, 0, 0, 0, 1))])
    assert all(math.isfinite(row[name]) for name in row.dtype.names if name not in PATCH_FIELDS)
    result, = soup_node.set_parameters([Parameter('size_b', value=[2.0, 2.0, 2.0])])
    assert result.successful


def test_its_topics_are_the_documents(client, soup_node):
    """Those of the contact node, with soup/ before what is sent; the same types and QoS."""
    document = yaml.safe_load(resource_path('msg_schemas', 'asyncapi.yaml').read_text('utf-8'))
    addresses = {channel['address'] for channel in document['channels'].values()} - {
        'poses', 'contact_node/scene', 'contact/wrench',  # a soup has no patch
        *({'contacts', 'contacts_cloud'} - {ANSWERS['cloud'][1]})}
    inputs = {'box_a/pose', 'box_b/pose', '/diagnostics'}
    expected = {f'/{name.lstrip("/")}' if name in inputs else f'/soup/{name}'
                for name in addresses}
    own = {'/parameter_events', '/rosout', '/soup_node/scene'}
    assert {entity.topic_name for entity in (*soup_node.publishers, *soup_node.subscriptions)
            } - own == expected
    for name in ('contact/point', 'contact/normal', ANSWERS['cloud'][1]):
        def publishers(topic=name):
            return [client.node.get_publishers_info_by_topic(prefix + topic)
                    for prefix in ('', 'soup/')]

        # A node of another test may still be leaving.
        assert client.spin(lambda: [len(found) for found in publishers()] == [1, 1])
        (one,), (other,) = publishers()
        assert one.topic_type == other.topic_type
        assert one.qos_profile.reliability == other.qos_profile.reliability
        assert one.qos_profile.durability == other.qos_profile.durability


def test_the_contact_node_knows_the_soup_too(client):
    """model:=soup-2 is a model like any other."""
    with serving(lambda context: ContactNode(context, parameter_overrides=overrides(
            model='soup-2'))) as node:
        result, = node.set_parameters([Parameter('model', value='soup-65')])
        assert not result.successful and 'a whole number from 1 to 64' in result.reason


def test_starts_at_its_worst_and_ends_cleanly(program):
    """With the most triangles it is ready in time, and ends with status 0."""
    running = program('soup_node', '--ros-args', '-p', 'divisions:=64')
    running.wait_for_output('ready', 120)
    assert "model 'soup-64'" in running.output
    running.signal(signal.SIGINT)
    assert running.wait() == 0
    assert 'Traceback' not in running.output
