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
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from jsonschema import Draft202012Validator
from patience import PATIENCE
from rclpy.qos import QoSProfile
from referencing import Registry, Resource
from ros_client import CUBES, Client, serving
from sensor_msgs.msg import MultiDOFJointState
from typed_messages import a_box, a_pair, joint_state, make_contacts

from box_contact_msgs.msg import Body, Boxes
from box_contact_msgs.srv import Check, CheckPath, GetBoxes, SetBoxes
from box_contact_ros.core import LENGTH_MAX, QUATERNION_MAX
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import make_header
from box_contact_ros.node.topics import LATCHED, pose_qos
from box_contact_ros.resources import resource_path
from box_contact_ros.solver.checks import MOST_NAME_BYTES, NAME
from box_contact_ros.stream.streams import ALL_BOXES

ROOT = Path(__file__).resolve().parents[2]
FOLDER = resource_path('msg_schemas')
DOCUMENT = yaml.safe_load((FOLDER / 'asyncapi.yaml').read_text(encoding='utf-8'))
SCHEMAS = {path.name: json.loads(path.read_text('utf-8')) for path in sorted(FOLDER.glob('*.json'))}
REGISTRY = Registry().with_resources(
    (name, Resource.from_contents(schema)) for name, schema in SCHEMAS.items())
SERVICES = ('answerCheck', 'answerCheckPath', 'answerSetBoxes', 'answerGetBoxes')
OPERATIONS = {name: operation for name, operation in DOCUMENT['operations'].items()
              if name not in SERVICES}  # on topics
ADDRESSES = {name: channel['address'] for name, channel in DOCUMENT['channels'].items()
             if name not in ('check', 'checkPath', 'reset', 'setBoxes', 'getBoxes')}
ORIGIN = (0, 0, 0, 0, 0, 0, 1)
TOUCHING = (0.5, 0.25, 1.875, 0.1, 0.2, 0, 1)
CLOSE = (0.5, 0.25, 2.0625, 0, 0, 0, 1)
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


def validator_at(channel: str) -> Draft202012Validator:
    """Return what checks the payloads of a topic."""
    operation, = (operation for operation in OPERATIONS.values()
                  if operation['channel']['$ref'] == f'#/channels/{channel}')
    return validator_of(message_of(operation))


def validator_of(message: dict[str, Any]) -> Draft202012Validator:
    """Return what checks the payloads of a message of the document."""
    return Draft202012Validator(follow(message['payload']['schema']['$ref']), registry=REGISTRY)


def plain(value: Any) -> Any:
    """Write a message as JSON would have it: octets are numbers, what is not finite is null."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        number, = value
        return number
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, (str, bool, int)) else [plain(entry) for entry in value]


# --- the documents --------------------------------------------------------------------------------

PARSER = '@asyncapi/parser@3.6.3'


@pytest.mark.network
def test_asyncapis_own_parser(tmp_path):
    """Its schema of the ros2 binding misspells one value, `realiable`; the text says reliable.

    Nothing else is said against the document.
    """
    fetched = subprocess.run(['npm', 'install', '--no-audit', '--no-fund', '--ignore-scripts',
                              '--prefix', tmp_path, PARSER], timeout=PATIENCE, text=True,
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert fetched.returncode == 0, fetched.stdout
    script = shutil.copy(ROOT / 'test' / 'helpers' / 'asyncapi_parser.mjs', tmp_path)
    ran = subprocess.run(['node', script, FOLDER / 'asyncapi.yaml'], capture_output=True, text=True,
                         timeout=PATIENCE)
    assert ran.returncode == 0, ran.stderr
    complaints = json.loads(ran.stdout)['complaints']
    assert complaints
    assert all('realiable' in text or 'match "then" schema' in text for text in complaints)


def test_every_reference_resolves():
    """In the document, and in each schema.

    Every schema belongs to a message of its title, but for the scene file's and what they share.
    """
    for reference in references(DOCUMENT):
        assert follow(reference)
    for schema in SCHEMAS.values():
        for reference in references(schema):
            assert follow(reference, schema)
    messages = DOCUMENT['components']['messages'].values()
    assert {message['payload']['schema']['$ref']: message['name'] for message in messages} == {
        name: schema['title'] for name, schema in SCHEMAS.items()
        if name not in ('common.json', 'inspection.json', 'plan.json', 'scene.json')}


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


def test_limits_are_the_codes():
    shared, scene = SCHEMAS['common.json']['$defs'], SCHEMAS['scene.json']
    assert shared['coordinate']['maximum'] == -shared['coordinate']['minimum'] == LENGTH_MAX
    component = shared['quaternion_component']
    assert component['maximum'] == -component['minimum'] == QUATERNION_MAX
    for text in (scene['$defs']['name'], scene['$defs']['pattern'],
                 scene['properties']['frame_id'], shared['header']['properties']['frame_id'],
                 shared['box']['properties']['name']):
        assert text['maxLength'] == MOST_NAME_BYTES
    # JavaScript's $ is the end of the text, Python's also before a last line break.
    assert scene['$defs']['name']['pattern'] == f'^{NAME.pattern}$(?![\\s\\S])'


# --- live messages --------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def node():
    with serving(ContactNode, margin=0.1, **CUBES) as node:
        yield node


@pytest.fixture(scope='module')
def client():
    with closing(Client()) as client:
        yield client


@pytest.fixture(scope='module')
def live(node, client) -> dict[str, list[Any]]:
    """Messages by topic: poses in contact, close, apart and refused, the answers, diagnostics.

    Named poses are what a client may send.
    """
    got: dict[str, list[Any]] = {channel: [] for channel in ADDRESSES}
    for channel in ('boxAPose', 'boxBPose'):
        client.node.create_subscription(PoseStamped, ADDRESSES[channel], got[channel].append, 100)
    client.node.create_subscription(Boxes, ADDRESSES['boxes'], got['boxes'].append, LATCHED)
    got['diagnostics'] = client.diagnostics
    assert client.spin(lambda: len(client.diagnostics) > 1)  # before the first pose
    client.offer_until_answered(ORIGIN, APART)
    assert client.spin(lambda: got['boxAPose'] and got['boxBPose'])
    for pose in (TOUCHING, APART, CLOSE) * 3:
        client.ask(ORIGIN, pose)
    assert client.diagnostic('contacts') == '3'
    client.send(ORIGIN, (math.nan, *APART[1:]))
    client.send(ORIGIN, TOUCHING, frames=('map', 'odom'))
    client.ask(ORIGIN, TOUCHING)
    assert client.diagnostic('refused: bad pose') == '1'
    for topic, messages in (('contactPoint', client.points), ('contactNormal', client.normals),
                            ('contacts', client.contacts)):
        got[topic] = list(messages.values())
    got['contacts'].insert(0, make_contacts(
        make_header(0, 'map'), [], ['box_a_box_b']))  # a stale pair
    for k in range(2):
        changed = client.call(SetBoxes, 'contact_node/set_boxes', SetBoxes.Request(
            fixed=[a_box(f'stand{k}', APART, (1, 1, 1))], bodies=[Body(
                name=f'body{k}', fixed=True, boxes=[a_box(f'part{k}', APART, (1, 1, 1))])]))
        newest = changed.revision  # other tests may have changed the node's scene before
        assert client.spin(lambda: got['boxes'] and got['boxes'][-1].revision == newest)  # noqa: B023
    got['poses'] = [joint_state({'a': TOUCHING, 'b': first}, 'map', 0) for first in (ORIGIN, APART)]
    return got


def test_live_messages_validate(live):
    """Everything that went over the wire, but for the one pose that was refused."""
    for address, messages in live.items():
        check = validator_at(address)
        faults = [[error.message for error in check.iter_errors(plain(m))] for m in messages]
        wrong = [fault for fault in faults if fault]
        assert len(wrong) == (address == 'boxBPose'), (address, wrong)
        assert len(messages) > 1
    texts = {message.status[0].message for message in live['diagnostics']}
    assert {'no poses', 'poses refused: bad pose'} <= {text.split(',')[0] for text in texts}
    for name, field in (('contacts', 'depth'), ('near', 'distance')):
        assert {getattr(entry, field) > 0.0 for message in live['contacts']
                for entry in getattr(message, name)} == {True}


@pytest.mark.parametrize('boxes, success', [
    ([a_box('box_a', ORIGIN), a_box('p', TOUCHING, (2, 2, 2)), a_box('q', CLOSE, (2, 2, 2))], True),
    ([a_box('box_a', ORIGIN), a_box('p', ORIGIN)], False), ([], False)])
def test_requests_and_responses_validate(node, client, boxes, success):
    """Those of ~/check: with contacts, of a guest without a size, of no box."""
    channel = DOCUMENT['channels']['check']
    request, response = (validator_of(follow(message['$ref']))
                         for message in channel['messages'].values())
    asked = Check.Request(boxes=boxes, pairs=[a_pair('box_a', box.name) for box in boxes[1:]],
                          margin=0.5)
    answer = client.call(Check, channel['address'], asked)
    assert answer.success == success and request.is_valid(plain(asked)) == bool(boxes)
    assert not [error.message for error in response.iter_errors(plain(answer))]
    assert len(answer.contacts.contacts) == len(answer.contacts.near) == success
    answer.success = not success
    assert not response.is_valid(plain(answer))


@pytest.mark.parametrize('names, end, success', [
    (('box_a', 'p'), TOUCHING, True), (('box_a', 'p'), APART, True), (('p',), APART, True),
    (('box_a', 'q'), APART, False)])
def test_paths_validate(node, client, names, end, success):
    """Those of ~/check_path: with an impact, without one, of a box alone, of an unknown one."""
    channel = DOCUMENT['channels']['checkPath']
    request, response = (validator_of(follow(message['$ref']))
                         for message in channel['messages'].values())
    sizes = {'p': (2, 2, 2)}
    asked = CheckPath.Request(
        boxes=[a_box(name, ORIGIN, sizes.get(name, (0, 0, 0))) for name in names],
        waypoints=[joint_state(dict(zip(names, (ORIGIN, place)[-len(names):])), '', 0)
                   for place in (APART, end)])
    answer = client.call(CheckPath, channel['address'], asked)
    assert answer.success == success and request.is_valid(plain(asked)), answer.message
    assert not [error.message for error in response.iter_errors(plain(answer))]
    assert [entry.near.pair for entry in answer.impacts] == ['p_box_a'] * (end == TOUCHING)
    assert answer.least.near.box_a == ('p' if success and len(names) == 2 else '')
    answer.success = not success
    assert not response.is_valid(plain(answer))
    assert int(client.diagnostic(f'paths {"answered" if success else "refused"}')) > 0
    assert validator_at('diagnostics').is_valid(plain(client.diagnostics[-1]))


@pytest.mark.parametrize('size, absent, success', [
    ((2, 2, 2), [], True), ((2, 2, 2), ['nobody'], True), ((2, 2, 1e51), [], False)])
def test_changes_of_boxes_validate(node, client, size, absent, success):
    """A box that comes, with one that was never there, and one that is too large."""
    channel = DOCUMENT['channels']['setBoxes']
    request, response = (validator_of(follow(message['$ref']))
                         for message in channel['messages'].values())
    asked = SetBoxes.Request(fixed=[a_box('stand', ORIGIN, size)], absent=absent)
    answer = client.call(SetBoxes, channel['address'], asked)
    assert ['is not there' in warning for warning in answer.warnings] == (
        [True] * len(absent) + [False] * success)  # and the box is in no pair
    assert answer.success == success and request.is_valid(plain(asked)) == (size[2] < 1e50)
    assert not [error.message for error in response.iter_errors(plain(answer))]
    answer.success = not success
    assert not response.is_valid(plain(answer))
    counted = f'changes {"answered" if success else "refused"}'
    assert int(client.diagnostic(counted)) > 0
    assert validator_at('diagnostics').is_valid(plain(client.diagnostics[-1]))


def test_listings_of_boxes_validate(node, client):
    """Of boxes that a request has brought, and of no box."""
    channel = DOCUMENT['channels']['getBoxes']
    request, response = (validator_of(follow(message['$ref']))
                         for message in channel['messages'].values())
    bodies = [Body(name='lorry', fixed=True, boxes=[a_box('bed', ORIGIN, (2, 2, 2))])]
    assert client.call(SetBoxes, 'contact_node/set_boxes', SetBoxes.Request(bodies=bodies)).success
    for first in (0, 100):
        asked = GetBoxes.Request(first=first)
        answer = client.call(GetBoxes, channel['address'], asked)
        assert answer.success and request.is_valid(plain(asked))
        assert not [error.message for error in response.iter_errors(plain(answer))]
        assert [body.name for body in answer.bodies if body.name == 'lorry'] == (
            [] if first else ['lorry'])
        answer.success = False
        assert not response.is_valid(plain(answer))


def set_in(path: str, value: Any):
    """Return a change of a message: set the attribute at a dotted path (numbers index)."""
    def change(message: Any) -> Any:
        *parts, last = path.split('.')
        for part in parts:
            message = message[int(part)] if part.isdigit() else getattr(message, part)
        setattr(message, last, value)
    return change


def test_a_node_that_answers_requests_alone_says_so(live):
    """No pose has come, but ~/check was called: a state that few listeners see first."""
    message = plain(next(message for message in live['diagnostics']
                         if message.status[0].message == 'no poses'))
    message['status'][0]['message'] = 'answering requests'
    assert validator_at('diagnostics').is_valid(message)


WRONG_MESSAGES = {
    'NaN in the normal': ('contactNormal', set_in('vector.x', math.nan)),
    'normal of length 2': ('contactNormal', set_in('vector.z', 2.0)),
    'NaN in the point': ('contactPoint', set_in('point.z', math.nan)),
    'infinite point': ('contactPoint', set_in('point.x', math.inf)),
    'nanoseconds of a second': ('contactPoint', set_in('header.stamp.nanosec', 10**9)),
    'a contact without a normal': ('contacts', set_in('contacts.0.normal.x', math.nan)),
    'a contact without a depth': ('contacts', set_in('contacts.0.depth', math.nan)),
    'a contact without half of its point': ('contacts', set_in('contacts.0.point.x', math.nan)),
    'a negative volume': ('contacts', set_in('contacts.0.volume', -1e-9)),
    'pose at 1e51 m': ('boxAPose', set_in('pose.position.x', 1e51)),
    'half a named pose': ('poses', set_in('transforms.0.translation.x', math.nan)),
    'a doubled name': ('poses', set_in('joint_names', ['a', 'a'])),
    'NaN in the quaternion': ('boxAPose', set_in('pose.orientation.w', math.nan)),
    'quaternion of zero length': ('boxAPose', set_in('pose.orientation.w', 0.0)),
    'unknown level': ('diagnostics', set_in('status.0.level', b'\x03')),
    'unknown count': ('diagnostics', set_in('status.0.values.0.key', 'guesses')),
    'a count that is no number': ('diagnostics', set_in('status.0.values.0.value', 'many'))}


@pytest.mark.parametrize('name', WRONG_MESSAGES)
def test_wrong_messages_do_not_validate(live, name):
    """Each is a live message, which is valid, with one thing made wrong."""
    address, change = WRONG_MESSAGES[name]
    check = validator_at(address)
    message = copy.deepcopy(live[address][-1 if address == 'contacts' else 0])
    assert check.is_valid(plain(message))
    change(message)
    assert not check.is_valid(plain(message))


@pytest.mark.parametrize('address', ADDRESSES)
def test_missing_and_extra_fields_do_not_validate(live, address):
    check = validator_at(address)
    message = plain(live[address][0])
    assert check.is_valid(message)
    for name in message:
        assert not check.is_valid({key: message[key] for key in message if key != name}), name
    assert not check.is_valid(message | {'extra': 1})


# --- quality of service ---------------------------------------------------------------------------


@pytest.mark.parametrize('operation', OPERATIONS.values(), ids=OPERATIONS)
def test_topics_have_the_documents_type_and_qos(node, operation):
    """Of what nothing is said, it is ROS's default: neither deadlines nor lifespans."""
    address = follow(operation['channel']['$ref'])['address']
    if address == 'poses':
        message_type, qos = MultiDOFJointState, pose_qos(ALL_BOXES)
    else:
        entities = node.publishers if operation['action'] == 'send' else node.subscriptions
        (message_type, qos), = ((entity.msg_type, entity.qos_profile) for entity in entities
                                if entity.topic_name == f'/{address.removeprefix("/")}')
    package = message_type.__module__.partition('.')[0]
    assert f'{package}/msg/{message_type.__name__}' == message_of(operation)['name']
    assert operation['x-depth'] == qos.depth
    policies = operation['bindings']['ros2']['qosPolicies']
    for name in ('history', 'reliability', 'durability'):
        assert policies[name] == getattr(qos, name).name.lower()
    assert policies['liveliness'] == 'automatic'
    assert policies['deadline'] == policies['lifespan'] == policies['leaseDuration'] == -1
    default = QoSProfile(depth=1)
    for name in ('liveliness', 'deadline', 'lifespan', 'liveliness_lease_duration'):
        assert getattr(qos, name) == getattr(default, name)


def test_node_has_no_other_topics(node):
    """The document names every topic of the node but those that rclpy gives each node."""
    own = {'/parameter_events', '/rosout'}
    names = {entity.topic_name for entity in (*node.publishers, *node.subscriptions)} - own
    assert names == {f'/{address.removeprefix("/")}' for address in ADDRESSES.values()} - {'/poses'}


# --- the page -------------------------------------------------------------------------------------


def test_docs_list_the_topics():
    """Topic, type, direction and QoS of every operation, in the document's order."""
    expected = []
    for operation in OPERATIONS.values():
        policies = operation['bindings']['ros2']['qosPolicies']
        expected.append([
            follow(operation['channel']['$ref'])['address'],
            message_of(operation)['name'].replace('/msg', ''),
            {'receive': 'in', 'send': 'out'}[operation['action']],
            f'{policies["reliability"].replace("_", " ")}, '
            f'{"kept, " if policies["durability"] == "transient_local" else ""}'
            f'{operation["x-depth"]}'])
    page = (ROOT / 'docs' / 'reference' / 'topics.md').read_text('utf-8')
    table = re.search(r'(?:^\|.*\n)+', page.split(' of the contact node\n', 1)[1], re.MULTILINE)
    assert table
    rows = [[cell.strip().replace('`', '') for cell in line.strip('|').split('|')]
            for line in table.group().splitlines()[2:]]
    assert [row[:4] for row in rows] == expected
