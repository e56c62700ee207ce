# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""msg_schemas/: sound documents, and what a real contact node sends and offers is what they say."""
from __future__ import annotations

import copy
import json
import math
import re
import shutil
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, Quaternion, WrenchStamped
from jsonschema import Draft202012Validator
from rclpy.duration import Infinite
from rclpy.parameter import Parameter
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from ros_client import Client, serving, stamp_of
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import String

from box_contact_ros.core import LENGTH_MAX, QUATERNION_MAX
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import (
    CLOUD_ROW,
    PATCH_FIELDS,
    ContactsMessage,
    make_cloud,
    make_contacts,
    make_header,
    read_cloud,
)
from box_contact_ros.node.runtime import LATCHED_QOS
from box_contact_ros.resources import resource_path
from box_contact_ros.scene.scene_solver import Answer, Pair
from box_contact_ros.solver.contact import Contact

ROOT = Path(__file__).resolve().parents[2]
FOLDER = resource_path('msg_schemas')
DOCUMENT = yaml.safe_load((FOLDER / 'asyncapi.yaml').read_text(encoding='utf-8'))
SCHEMAS = {path.name: json.loads(path.read_text('utf-8')) for path in sorted(FOLDER.glob('*.json'))}
OPERATIONS = DOCUMENT['operations']
ADDRESSES = {name: channel['address'] for name, channel in DOCUMENT['channels'].items()}

ROW = CLOUD_ROW.itemsize
ORIGIN = (0, 0, 0, 0, 0, 0, 1)
TOUCHING = (0.5, 0.25, 1.875, 0.1, 0.2, 0, 1)
APART = (0.5, 0.25, 4, 0, 0, 0, 1)


def follow(reference: str, inside: Any = DOCUMENT) -> Any:
    """Return what a $ref of the document (or, with `inside`, of a schema) points to."""
    file, _, pointer = reference.partition('#')
    target = SCHEMAS[file] if file else inside
    for part in pointer.split('/')[1:]:
        target = target[part.replace('~1', '/').replace('~0', '~')]
    return target


def references(value: Any) -> Iterator[str]:
    """All $refs below a value."""
    if isinstance(value, dict):
        for key, entry in value.items():
            if key == '$ref':
                yield entry
            else:
                yield from references(entry)
    elif isinstance(value, list):
        for entry in value:
            yield from references(entry)


def message_of(operation: dict[str, Any]) -> dict[str, Any]:
    message, = follow(operation['channel']['$ref'])['messages'].values()
    return follow(message['$ref'])


def schema_at(address: str) -> dict[str, Any]:
    """Return the payload schema of a topic."""
    operation, = (operation for operation in OPERATIONS.values()
                  if follow(operation['channel']['$ref'])['address'] == address)
    return follow(message_of(operation)['payload']['schema']['$ref'])


def validator(schema: dict[str, Any], part: str = '') -> Draft202012Validator:
    """Of a schema, or of one of its $defs."""
    if part:
        schema = {'$ref': f'#/$defs/{part}', '$defs': schema['$defs']}
    return Draft202012Validator(schema)


def plain(value: Any) -> Any:
    """Write a message as JSON would have it: octets are numbers, what is not finite is null."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        number, = value
        return number
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, (str, int)) else [plain(entry) for entry in value]


# --- the documents --------------------------------------------------------------------------------

# The parts of AsyncAPI 3.1 and of its ros2 bindings 0.1.0 that are used here, strictly.
NAMED = {'type': 'object', 'minProperties': 1, 'propertyNames': {'pattern': r'^[\w.-]+$'}}
REFERENCE = {'type': 'object', 'required': ['$ref'], 'additionalProperties': False,
             'properties': {'$ref': {'type': 'string'}}}
SPAN = {'type': 'integer', 'minimum': -1}
ROS2 = {
    'type': 'object', 'required': ['bindingVersion', 'role', 'node', 'qosPolicies'],
    'additionalProperties': False,
    'properties': {
        'bindingVersion': {'const': '0.1.0'},
        'role': {'enum': ['publisher', 'subscriber']},
        'node': {'const': 'contact_node'},
        'qosPolicies': {
            'type': 'object', 'additionalProperties': False,
            'required': ['history', 'reliability', 'durability', 'deadline', 'lifespan',
                         'liveliness', 'leaseDuration'],
            'properties': {
                'history': {'enum': ['keep_last', 'keep_all', 'unknown']},
                'reliability': {'enum': ['best_effort', 'reliable']},
                'durability': {'enum': ['transient_local', 'volatile']},
                'liveliness': {'enum': ['automatic', 'manual']},
                'deadline': SPAN, 'lifespan': SPAN, 'leaseDuration': SPAN}}}}
ASYNCAPI = {
    'type': 'object',
    'required': ['asyncapi', 'info', 'servers', 'channels', 'operations', 'components'],
    'additionalProperties': False,
    'properties': {
        'asyncapi': {'const': '3.1.0'},
        'info': {'type': 'object', 'required': ['title', 'version', 'description', 'license']},
        'defaultContentType': {'type': 'string'},
        'servers': NAMED | {'additionalProperties': {
            'type': 'object', 'required': ['host', 'protocol', 'bindings'],
            'properties': {'protocol': {'const': 'ros2'}}}},
        'channels': NAMED | {'additionalProperties': {
            'type': 'object', 'required': ['address', 'description', 'messages'],
            'additionalProperties': False,
            'properties': {
                'address': {'type': 'string', 'pattern': r'^/?[a-z_]+(/[a-z_]+)*$'},
                'description': {'type': 'string', 'minLength': 10},
                'messages': NAMED | {'maxProperties': 1, 'additionalProperties': REFERENCE}}}},
        'operations': NAMED | {'additionalProperties': {
            'type': 'object', 'required': ['action', 'channel', 'bindings', 'x-depth'],
            'additionalProperties': False,
            'properties': {
                'action': {'enum': ['send', 'receive']},
                'summary': {'type': 'string'},
                'channel': REFERENCE,
                'x-depth': {'type': 'integer', 'minimum': 1},
                'bindings': {'type': 'object', 'required': ['ros2'], 'additionalProperties': False,
                             'properties': {'ros2': ROS2}}}}},
        'components': {
            'type': 'object', 'required': ['messages'], 'additionalProperties': False,
            'properties': {'messages': NAMED | {'additionalProperties': {
                'type': 'object', 'required': ['name', 'summary', 'payload'],
                'additionalProperties': False,
                'properties': {
                    'name': {'type': 'string', 'pattern': r'^\w+/msg/\w+$'},
                    'summary': {'type': 'string'},
                    'payload': {
                        'type': 'object', 'required': ['schemaFormat', 'schema'],
                        'additionalProperties': False,
                        'properties': {
                            'schemaFormat': {
                                'const': 'application/schema+json;version=draft-2020-12'},
                            'schema': REFERENCE}}}}}}}}}


def test_document_has_asyncapis_structure():
    assert [error.message for error in Draft202012Validator(ASYNCAPI).iter_errors(DOCUMENT)] == []


PARSER = '@asyncapi/parser@3.6.3'


@pytest.fixture(scope='module')
def parse(tmp_path_factory):
    """Return the parser of AsyncAPI itself, from npm: takes a folder with asyncapi.yaml."""
    place = tmp_path_factory.mktemp('npm')
    if not (shutil.which('npm') and shutil.which('node')):
        pytest.skip("AsyncAPI's own parser needs npm and node")
    try:
        subprocess.run(['npm', 'install', '--no-audit', '--no-fund', '--ignore-scripts',
                        '--fetch-retries=0', '--prefix', place, PARSER], capture_output=True,
                       timeout=90, check=True)
    except subprocess.SubprocessError as error:
        pytest.skip(f'npm could not fetch {PARSER}: {error}')
    script = shutil.copy(ROOT / 'test' / 'helpers' / 'asyncapi_parser.mjs', place)

    def parse(folder: Path) -> dict[str, list[str]]:
        ran = subprocess.run(['node', script, folder / 'asyncapi.yaml'], capture_output=True,
                             text=True, timeout=120)
        assert ran.returncode == 0, ran.stderr
        return json.loads(ran.stdout)
    return parse


def test_asyncapis_own_parser(parse, tmp_path):
    """Its schema of the ros2 binding misspells one value, `realiable`.

    The binding's text says reliable. Nothing else is said against the document, and with the
    misspelt word nothing at all.
    """
    said = parse(FOLDER)['complaints']
    assert said and all('realiable' in text or 'match "then" schema' in text for text in said), said
    folder = shutil.copytree(FOLDER, tmp_path / 'msg_schemas')
    text = (folder / 'asyncapi.yaml').read_text('utf-8')
    (folder / 'asyncapi.yaml').write_text(
        text.replace('reliability: reliable', 'reliability: realiable'), 'utf-8')
    assert parse(folder) == {'complaints': [], 'channels': list(ADDRESSES)}


def test_every_reference_resolves():
    """In the document, and in each schema.

    Every schema but the scene file's belongs to a message of its title.
    """
    for reference in references(DOCUMENT):
        assert follow(reference)
    for schema in SCHEMAS.values():
        for reference in references(schema):
            assert follow(reference, schema)
    messages = DOCUMENT['components']['messages'].values()
    assert {message['payload']['schema']['$ref']: message['name'] for message in messages} == {
        name: schema['title'] for name, schema in SCHEMAS.items() if name != 'scene.json'}


def test_operations_cover_the_channels():
    """One operation per channel; what is received is subscribed to, what is sent is published."""
    assert sorted(operation['channel']['$ref'] for operation in OPERATIONS.values()) == sorted(
        f'#/channels/{name}' for name in ADDRESSES)
    roles = {'receive': 'subscriber', 'send': 'publisher'}
    for operation in OPERATIONS.values():
        assert operation['bindings']['ros2']['role'] == roles[operation['action']]


@pytest.mark.parametrize('name', SCHEMAS)
def test_schema_is_valid(name):
    schema = SCHEMAS[name]
    assert schema['$schema'] == Draft202012Validator.META_SCHEMA['$id']
    Draft202012Validator.check_schema(schema)


def test_shared_definitions_agree():
    """Files stand alone, so what they share is written out in each; the limits are the code's."""
    shared: dict[str, Any] = {}
    for schema in SCHEMAS.values():
        for name, definition in schema['$defs'].items():
            assert shared.setdefault(name, definition) == definition, name
    assert shared['coordinate']['maximum'] == -shared['coordinate']['minimum'] == LENGTH_MAX
    component = shared['quaternion_component']
    assert component['maximum'] == -component['minimum'] == QUATERNION_MAX


# --- a live node ----------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def node():
    settings = {'size_a': [2.0, 2.0, 2.0], 'size_b': [2.0, 2.0, 2.0], 'model': 'exact',
                'contacts_cloud': True, 'wrench': True, 'rate': 200.0, 'mass_a': 1000.0}
    with serving(lambda context: ContactNode(context, parameter_overrides=[
            Parameter(name, value=value) for name, value in settings.items()])) as node:
        yield node


@pytest.fixture(scope='module')
def client():
    client = Client()
    yield client
    client.close()


@pytest.fixture(scope='module')
def array_node(live):
    """Serve a node that takes all poses as one message, once the other has been looked at."""
    with serving(lambda context: ContactNode(context, namespace='/many', parameter_overrides=[
            Parameter('scene', value='poses: array\nboxes: {b: {size: [2, 2, 2], count: 3}}\n'
                                     "pairs: [{a: '*', b: '*'}]")])) as node:
        yield node


@pytest.fixture(scope='module')
def live_arrays(array_node) -> list[PoseArray]:
    """Return pose arrays that were answered: one with all boxes, one that lacks a box."""
    client = Client('/many')
    sent: list[PoseArray] = []
    publisher = client.node.create_publisher(PoseArray, 'poses', 100)
    client.node.create_subscription(PoseArray, 'poses', sent.append, 100)
    try:
        for gone in (0.0, math.nan):
            numbers = [gone + number for number in (9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)]
            message = PoseArray(poses=[_pose(numbers), _pose(ORIGIN), _pose(TOUCHING)])
            stamp = 0
            for _ in range(600):
                if stamp in client.clouds:
                    break
                stamp = client.next_stamp()
                message.header = make_header(stamp, 'map')
                publisher.publish(message)
                client.spin(partial(client.clouds.__contains__, stamp), 0.1)
            found = client.rows(stamp)
            assert np.isnan(found['depth']).sum() == 2 * math.isnan(gone)
        return sent[:1] + sent[-1:]
    finally:
        client.close()


def _pose(numbers):
    x, y, z, *turn = map(float, numbers)
    return Pose(position=Point(x=x, y=y, z=z),
                orientation=Quaternion(**dict(zip('xyzw', turn))))


@pytest.fixture(scope='module')
def everything(live, live_arrays):
    return live | {'poses': live_arrays}


@pytest.fixture(scope='module')
def live(node, client) -> dict[str, list[Any]]:
    """Messages by topic: poses in contact, apart and refused, the answers, the diagnostics."""
    got: dict[str, list[Any]] = {
        address: [] for address in ADDRESSES.values() if address != 'poses'}
    for topic in ('box_a/pose', 'box_b/pose'):
        client.node.create_subscription(PoseStamped, topic, got[topic].append, 100)
    for kind, topic in ((PointCloud2, 'contacts_cloud'), (WrenchStamped, 'contact/wrench')):
        client.node.create_subscription(kind, topic, got[topic].append, 100)
    client.node.create_subscription(String, 'contact_node/scene', got['contact_node/scene'].append,
                                    LATCHED_QOS)
    got['/diagnostics'] = client.diagnostics
    assert client.spin(lambda: len(client.diagnostics) > 1)  # before the first pose
    client.offer_until_answered(ORIGIN, APART)
    assert client.spin(lambda: got['box_a/pose'] and got['box_b/pose'])
    for _ in range(3):
        client.ask(ORIGIN, TOUCHING)
        client.ask(ORIGIN, APART)
    assert client.diagnostic('contacts') == '3'
    client.send(ORIGIN, (math.nan, *APART[1:]))
    client.send(ORIGIN, TOUCHING, frames=('map', 'odom'))
    client.ask(ORIGIN, TOUCHING)
    assert client.diagnostic('refused: bad pose') == '1'
    assert node.set_parameters([Parameter('scene', value='')])[0].successful  # sent again
    assert client.spin(lambda: len(got['contact_node/scene']) == 2)
    assert client.spin(lambda: stamp_of(got['contacts_cloud'][-1]) in client.clouds)
    for topic, messages in (('contact/point', client.points), ('contact/normal', client.normals),
                            ('contacts', client.clouds)):
        got[topic] = list(messages.values())
    if ContactsMessage is None:
        del got['contacts']
    return got


def test_live_messages_validate(everything):
    """Everything that went over the wire, but for the one pose that was refused."""
    for address, messages in everything.items():
        check = validator(schema_at(address))
        faults = [[error.message for error in check.iter_errors(plain(m))] for m in messages]
        wrong = [fault for fault in faults if fault]
        assert len(wrong) == (address == 'box_b/pose'), (address, wrong)
        assert len(messages) > 1
    texts = {message.status[0].message for message in everything['/diagnostics']}
    assert {'no poses', 'poses refused: bad pose'} <= {text.split(',')[0] for text in texts}
    assert {len(cloud.data) for cloud in everything['contacts_cloud']} == {0, ROW}


def rows(cloud):
    return [{name: plain(row[name].item()) for name in row.dtype.names}
            for row in read_cloud(cloud)]


def test_live_rows_validate(live):
    """Rows decoded; the fields as declared are how they were decoded."""
    schema = SCHEMAS['contacts_cloud.json']
    check = validator(schema, 'row')
    found = [row for cloud in live['contacts_cloud'] for row in rows(cloud)]
    assert len(found) == 4
    for row in found:
        assert [error.message for error in check.iter_errors(row)] == []
    for cloud in live['contacts_cloud']:
        assert len(cloud.data) == cloud.row_step == ROW * cloud.width
    kinds = {PointField.FLOAT32: '<f4', PointField.FLOAT64: '<f8', PointField.UINT32: '<u4'}
    declared = np.dtype([(field['name'], kinds[field['datatype']])
                         for field in schema['properties']['fields']['const']])
    assert declared.itemsize == schema['properties']['point_step']['const']
    assert list(schema['$defs']['row']['properties']) == list(declared.names)
    assert np.array_equal(np.frombuffer(bytes(live['contacts_cloud'][-1].data), declared),
                          read_cloud(live['contacts_cloud'][-1]))


def needs_messages(address: str) -> None:
    """Skip what is about `contacts` where its type is not installed."""
    if address == 'contacts' and ContactsMessage is None:
        pytest.skip('box_contact_msgs is not installed')


def set_in(path: str, value: Any):
    """Return a change of a message: set the attribute at a dotted path (numbers index)."""
    def change(message: Any) -> Any:
        *parts, last = path.split('.')
        for part in parts:
            message = message[int(part)] if part.isdigit() else getattr(message, part)
        setattr(message, last, value)
    return change


WRONG_MESSAGES = {
    'NaN in the normal': ('contact/normal', set_in('vector.x', math.nan)),
    'normal of length 2': ('contact/normal', set_in('vector.z', 2.0)),
    'NaN in the point': ('contact/point', set_in('point.z', math.nan)),
    'NaN in the torque': ('contact/wrench', set_in('wrench.torque.y', math.nan)),
    'infinite point': ('contact/point', set_in('point.x', math.inf)),
    'nanoseconds of a second': ('contact/point', set_in('header.stamp.nanosec', 10**9)),
    'depth as FLOAT32': ('contacts_cloud', set_in('fields.10.datatype', PointField.FLOAT32)),
    'a field of another name': ('contacts_cloud', set_in('fields.10.name', 'separation')),
    'a padded row': ('contacts_cloud', set_in('point_step', ROW + 4)),
    'rows of before the patch': ('contacts_cloud', set_in('point_step', 60)),
    'no covariance': ('contacts_cloud', lambda message: message.fields.pop()),
    'big-endian': ('contacts_cloud', set_in('is_bigendian', True)),
    'half a row': ('contacts_cloud', set_in('row_step', 30)),
    'a contact without a normal': ('contacts', set_in('contacts.0.normal.x', math.nan)),
    'a contact without a depth': ('contacts', set_in('contacts.0.depth', math.nan)),
    'pose at 1e51 m': ('box_a/pose', set_in('pose.position.x', 1e51)),
    'half a pose in an array': ('poses', set_in('poses.0.position.x', math.nan)),
    'half an absent pose': ('poses', set_in('poses.0.orientation.w', math.nan)),
    'NaN in the quaternion': ('box_a/pose', set_in('pose.orientation.w', math.nan)),
    'quaternion of zero length': ('box_a/pose', set_in('pose.orientation.w', 0.0)),
    'unknown level': ('/diagnostics', set_in('status.0.level', b'\x03')),
    'unknown count': ('/diagnostics', set_in('status.0.values.0.key', 'guesses')),
    'a count that is no number': ('/diagnostics', set_in('status.0.values.0.value', 'many'))}


@pytest.mark.parametrize('name', WRONG_MESSAGES)
def test_wrong_messages_do_not_validate(everything, name):
    """Each is a live message, which is valid, with one thing made wrong."""
    address, change = WRONG_MESSAGES[name]
    needs_messages(address)
    check = validator(schema_at(address))
    message = copy.deepcopy(everything[address][-1 if address == 'contacts' else 0])
    assert check.is_valid(plain(message))
    change(message)
    assert not check.is_valid(plain(message))


@pytest.mark.parametrize('address', ADDRESSES.values())
def test_missing_and_extra_fields_do_not_validate(everything, address):
    needs_messages(address)
    check = validator(schema_at(address))
    message = plain(everything[address][0])
    assert check.is_valid(message)
    for name in message:
        assert not check.is_valid({key: message[key] for key in message if key != name}), name
    assert not check.is_valid(message | {'extra': 1})


def test_pairs_that_are_close_validate():
    """Apart by no more than margin: in both messages."""
    nan = np.full(3, np.nan)
    answer = Answer([], [], 0, [(Pair(7, 'p', 'a', 'b'), Contact(
        False, 0.5, nan, nan, 0.0, np.full((3, 3), np.nan)))])
    cloud = make_cloud(make_header(0, 'map'), answer)
    row, = rows(cloud)
    check = validator(SCHEMAS['contacts_cloud.json'], 'close_row')
    assert check.is_valid(row) and not check.is_valid(row | {'depth': 0.5}) and not cloud.is_dense
    needs_messages('contacts')
    check = validator(SCHEMAS['contacts.json'])
    message = plain(make_contacts(make_header(0, 'map'), answer))
    assert check.is_valid(message)
    message['contacts'][0]['depth'] = 0.5
    assert not check.is_valid(message)


def test_stale_rows_validate():
    """All NaN but the id, or no stale row."""
    check = validator(SCHEMAS['contacts_cloud.json'], 'stale_row')
    answer = Answer([], [Pair(7, 'p', 'a', 'b')], 0)
    cloud = make_cloud(make_header(0, 'map'), answer)
    row, = rows(cloud)
    assert check.is_valid(row) and not cloud.is_dense
    assert validator(SCHEMAS['contacts_cloud.json']).is_valid(plain(cloud))
    assert not check.is_valid(row | {'depth': 0.0})
    assert not validator(SCHEMAS['contacts_cloud.json'], 'row').is_valid(row)


def test_wrong_rows_do_not_validate(live):
    check = validator(SCHEMAS['contacts_cloud.json'], 'row')
    row = rows(live['contacts_cloud'][-1])[0]
    assert check.is_valid(row)
    assert all(isinstance(row[name], float) for name in PATCH_FIELDS)
    assert check.is_valid(row | dict.fromkeys(PATCH_FIELDS))  # a model that gives none
    for name in PATCH_FIELDS:  # half a patch
        assert not check.is_valid(row | {name: None}), name
    for change in ({'volume': -1e-9}, {'normal_x': None}, {'normal_y': 1.5}, {'depth': None},
                   {'point_x': None}, {'pair': -1}, {'pair': 0.5}, {'extra': 0}):
        assert not check.is_valid(row | change), change


# --- quality of service ---------------------------------------------------------------------------


def declared_qos(operation: dict[str, Any]) -> QoSProfile:
    """Return the profile that the document describes."""
    policies = operation['bindings']['ros2']['qosPolicies']
    assert policies['deadline'] == policies['lifespan'] == policies['leaseDuration'] == -1
    return QoSProfile(
        depth=operation['x-depth'],
        history=HistoryPolicy[policies['history'].upper()],
        reliability=ReliabilityPolicy[policies['reliability'].upper()],
        durability=DurabilityPolicy[policies['durability'].upper()],
        liveliness=LivelinessPolicy[policies['liveliness'].upper()],
        deadline=Infinite, lifespan=Infinite, liveliness_lease_duration=Infinite)


@pytest.mark.parametrize('name', OPERATIONS)
def test_qos_is_the_documents(node, client, array_node, name):
    """As the ROS graph reports the node's endpoint.

    The graph knows no history and no depth, so those are taken from the endpoint itself.
    """
    operation = OPERATIONS[name]
    address = follow(operation['channel']['$ref'])['address']
    sends = operation['action'] == 'send'
    find = (client.node.get_publishers_info_by_topic if sends
            else client.node.get_subscriptions_info_by_topic)
    if address == 'poses':
        node, address = array_node, '/many/poses'

    needs_messages(address)

    def of_the_node():
        # The graph knows an endpoint before it knows the name of its node.
        return [info for info in find(address) if (info.node_name, info.node_namespace) == (
            'contact_node', node.get_namespace())]

    assert client.spin(lambda: bool(of_the_node()))
    endpoint, = of_the_node()
    assert endpoint.topic_type == message_of(operation)['name']
    declared, reported = declared_qos(operation), endpoint.qos_profile
    for policy in ('reliability', 'durability', 'liveliness', 'deadline', 'lifespan',
                   'liveliness_lease_duration'):
        assert getattr(reported, policy) == getattr(declared, policy), policy
    own, = (entity.qos_profile for entity in (node.publishers if sends else node.subscriptions)
            if entity.topic_name == f'/{address.removeprefix("/")}')
    assert (own.history, own.depth) == (declared.history, declared.depth)


def test_node_has_no_other_topics(node, live):
    """The document names every topic of the node but those that rclpy gives each node."""
    own = {'/parameter_events', '/rosout'}
    names = {entity.topic_name for entity in (*node.publishers, *node.subscriptions)} - own
    assert names == {f'/{address.removeprefix("/")}' for address in live}


# --- tables of the docs ---------------------------------------------------------------------------


def table(page: str) -> list[list[str]]:
    """Cells of the contact node's table on a page, without backticks and the head."""
    text = (ROOT / 'docs' / 'reference' / page).read_text('utf-8')
    text = text.split(' of the contact node\n', 1)[1]
    lines = re.search(r'(?:^\|.*\n)+', text, re.MULTILINE).group().splitlines()[2:]
    return [[cell.strip().replace('`', '') for cell in line.strip('|').split('|')]
            for line in lines]


def test_docs_list_the_topics():
    """Topic, type, direction and QoS of every operation, in the document's order."""
    expected = []
    for operation in OPERATIONS.values():
        policies = operation['bindings']['ros2']['qosPolicies']
        expected.append([
            follow(operation['channel']['$ref'])['address'],
            message_of(operation)['name'].replace('/msg', ''),
            {'receive': 'in', 'send': 'out'}[operation['action']],
            f'{policies["reliability"].replace("_", " ")}, {operation["x-depth"]}'])
    assert [row[:4] for row in table('topics.md')] == expected
