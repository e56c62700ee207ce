# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The soup node: beside the contact node on one input, and as a process of its own."""
from __future__ import annotations

import math
import signal
from contextlib import closing

import numpy as np
import poses
import pytest
import yaml
from geometry_msgs.msg import PointStamped, Vector3Stamped
from rclpy.parameter import Parameter
from ros_client import CUBES, Client, serving
from typed_messages import contacts_by_pair

pytest.importorskip('fcl')

from box_contact_msgs.msg import Contacts
from box_contact_ros import ContactSolver, make_model
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.soup_node import SoupNode
from box_contact_ros.resources import resource_path

ORIGIN = poses.IDENTITY
TOUCHING = np.array([0.5, 0.25, 1.875, 0.1, 0.2, 0, 1])
APART = np.array([0.5, 0.25, 4.0, 0, 0, 0, 1])
PAIR = 'box_a_box_b'
TOPICS = {'contact/point': PointStamped, 'contact/normal': Vector3Stamped, 'contacts': Contacts}


class BothClient(Client):
    """Keeps what comes back under soup/ as well."""

    def __init__(self):
        super().__init__()
        self.soup = {topic: {} for topic in TOPICS}
        for topic, message_type in TOPICS.items():
            self.keep(message_type, f'soup/{topic}', self.soup[topic])

    def ask_soup(self, *poses, **options):
        """Send a pair and wait for the contacts of the soup node; return the stamp."""
        stamp = self.send(*poses, **options)
        assert self.spin(lambda: stamp in self.soup['contacts']), 'no answer under soup/'
        return stamp


def offer_until_the_soup_answers(client):
    assert client.spin(lambda: client.soup['contacts'] or not client.send(ORIGIN, APART))


@pytest.fixture
def client():
    with closing(BothClient()) as client:
        yield client


@pytest.fixture
def soup_node(client):
    with serving(SoupNode, divisions=4, **CUBES) as node:
        offer_until_the_soup_answers(client)
        yield node


def test_both_nodes_answer_one_input(client, soup_node):
    """The same header; each with its own solver's numbers, point and normal before contacts."""
    with serving(ContactNode, **CUBES):
        client.offer_until_answered(ORIGIN, APART)
        stamp = client.ask_soup(ORIGIN, TOUCHING, frames=('yard', 'yard'))
        assert client.is_answered(stamp)
    wanted = ContactSolver(poses.CUBE, poses.CUBE, model=make_model('soup-4'))(ORIGIN, TOUCHING)
    point, normal, contacts = (client.soup[topic][stamp] for topic in TOPICS)
    assert point.header == normal.header == contacts.header == client.points[stamp].header
    assert point.header.frame_id == 'yard'
    assert (point.point.x, point.point.y, point.point.z) == tuple(wanted.point)
    assert (normal.vector.x, normal.vector.y, normal.vector.z) == tuple(wanted.normal)
    soup = contacts_by_pair(contacts)[PAIR]
    assert soup.separation == wanted.separation and np.array_equal(soup.point, wanted.point)
    assert math.isnan(soup.volume)  # a soup gives the point alone
    assert [topic for topic, at in client.order if at == stamp and topic.startswith('soup/')] == [
        f'soup/{topic}' for topic in TOPICS]
    exact = contacts_by_pair(client.contacts[stamp])[PAIR]
    assert soup.separation == exact.separation and soup.point[0] != exact.point[0]


def test_its_topics_are_the_documents(client, soup_node):
    """Those of the contact node, with soup/ before what is sent; the same QoS."""
    document = yaml.safe_load(resource_path('msg_schemas', 'asyncapi.yaml').read_text('utf-8'))
    services = {f'contact_node/{name}' for name in (
        'boxes', 'check', 'check_path', 'get_boxes', 'reset', 'set_boxes')}
    addresses = {channel['address'] for channel in document['channels'].values()} - services
    inputs = {'box_a/pose', 'box_b/pose', '/diagnostics'}
    expected = {f'/{name.lstrip("/")}' if name in inputs else f'/soup/{name}'
                for name in addresses - {'poses'}} | {'/soup_node/boxes'}
    assert {entity.topic_name for entity in (*soup_node.publishers, *soup_node.subscriptions)
            } - {'/parameter_events', '/rosout'} == expected
    with serving(ContactNode, **CUBES) as node:
        qos_of, qos_of_soup = (
            {publisher.topic_name.removeprefix('/soup'): publisher.qos_profile
             for publisher in each.publishers} for each in (node, soup_node))
        for topic in TOPICS:
            assert qos_of[f'/{topic}'] == qos_of_soup[f'/{topic}']


def test_the_contact_node_knows_the_soup_too():
    """From the start on; while it runs, it may change to a model in C++ alone."""
    with serving(ContactNode, model='soup-2', **CUBES) as node:
        for model, words in (('soup-65', 'a whole number from 1 to 64'),
                             ('soup-2', "model 'soup-2' needs a new start")):
            result, = node.set_parameters([Parameter('model', value=model)])
            assert not result.successful and words in result.reason
        assert node.set_parameters([Parameter('model', value='mlp')])[0].successful


def test_starts_at_its_worst_and_ends_cleanly(program):
    """With the most triangles it is ready in time, and ends with status 0."""
    running = program('soup_node', '--ros-args', '-p', 'divisions:=64')
    running.wait_for_output('ready')
    assert "model 'soup-64'" in running.output
    running.signal(signal.SIGINT)
    assert running.wait() == 0
    assert 'Traceback' not in running.output
