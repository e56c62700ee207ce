# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every program with every form of a scene: what it draws, records, replays and answers is right.

The forms are those of docs/reference/scenes.md, as a file, by bare name or as text. One contact
node, `markers` and `view` are switched from form to form. `scene_driver` moves the boxes, so what
is right is known at every stamp. All nodes share a context and the client's executor: nothing has
to be discovered, and an exception of a callback fails the test.
"""
from __future__ import annotations

import gc
import os
import re
import signal
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from ros_client import Client, stamp_of
from visualization_msgs.msg import Marker, MarkerArray

pytest.importorskip('rosbags')
pytest.importorskip('fcl')

from rosbags.rosbag2 import Reader
from test_bench import bench, rows_of

from box_contact_ros.demo.processes import parameters
from box_contact_ros.demo.ros_client import ANSWERS
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import read_contacts
from box_contact_ros.node.runtime import spin_for
from box_contact_ros.scene.files.scene_check import meaning
from box_contact_ros.scene.files.scene_file import read_scene
from box_contact_ros.scene.scene_solver import Scene, SceneSolver, two_boxes
from box_contact_ros.soup.soup_node import SoupNode
from box_contact_ros.view import scene_driver
from box_contact_ros.view.listener import ViewNode
from box_contact_ros.view.markers import MarkersNode
from box_contact_ros.view.recording import bag_player
from box_contact_ros.view.recording.bag_file import POSE, POSES, read_recording, read_replay
from box_contact_ros.view.recording.record import node_of
from box_contact_ros.view.scene_driver import SceneDriver
from box_contact_ros.view.view_log import Snapshot

PAGE = (Path(__file__).resolve().parents[2] / 'docs/reference/scenes.md').read_text('utf-8')
SHORTER = {'rows: 10, columns: 20, tiers: 5': 'rows: 1, columns: 2, tiers: 2',
           'count: 1000': 'count: 5'}
"""What the page shows for yards is cut to what a test can wait for."""
SIZE_A, SIZE_B = (2.0, 2.0, 1.0), (2.0, 1.0, 1.0)
RATE = 50.0  # Hz
TICKS = 20  # that are recorded and answered at least
VISIT = 1.6  # time [s] in which the driver's boxes go round


def shown_forms() -> dict[str, str]:
    """Return the scenes that the page shows, by form."""
    blocks = re.findall(r'```yaml\n(.*?)```', PAGE, re.DOTALL)
    inline, = re.findall(r"scene:='(\{.*\})'", PAGE)
    for old, new in SHORTER.items():
        assert any(old in block for block in blocks), f'{old!r} is shown no more'
        blocks = [block.replace(old, new) for block in blocks]
    listed, short, _, array = blocks  # frames in /tf are in test_tf_poses.py
    return {'listed': listed, 'short': short, 'array': array, 'inline': inline,
            'inline array': array, 'bare name': 'spreader_container_stack', 'two sizes': ''}


FORMS = shown_forms()


def test_the_page_shows_what_is_tested():
    """Fixed boxes, own topics, named pairs; stacks and patterns; an array; text."""
    assert 'pose_topic:' in FORMS['listed'] and 'name: on_truck' in FORMS['listed']
    assert 'stack:' in FORMS['short'] and "'s*'" in FORMS['short']
    assert read_scene(FORMS['array']).pose_array and read_scene(FORMS['inline']).moving


@dataclass
class Played:
    """A form of a scene after all programs have met a contact in it, and what they have of it."""

    form: str
    scene: Scene
    driver: SceneDriver
    clouds: dict[int, np.ndarray]  # contacts of the contact node, by stamp
    soups: dict[int, np.ndarray]  # of the soup node
    drawn: MarkerArray  # the first of `markers` with a contact
    seen: Snapshot  # of `view`, with a contact
    bag: Path  # of `record`

    def poses(self, stamp: int) -> dict[str, np.ndarray]:
        """Return where the boxes are at a stamp [ns]; moving ones only if they are listened to."""
        seconds = 1e-9 * (stamp - self.driver._start)
        fixed = {name: np.array(box.pose) for name, box in self.scene.boxes.items() if box.pose}
        return fixed | {name: self.driver._motions[name](seconds) for name in self.scene.moving}

    def answer(self, stamp: int) -> dict[int, np.ndarray]:
        """Return the points of all contacts at a stamp [ns], by the id of their pair."""
        poses = self.poses(stamp)
        answer = SceneSolver(self.scene, model='exact')([poses[box] for box in self.scene.moving])
        return {pair.id: contact.point for pair, contact in answer.touching}


@pytest.fixture(scope='module', autouse=True)
def quick_driver() -> Iterator[None]:
    """Let the driver's boxes go round in `VISIT`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scene_driver, 'VISIT', VISIT)
        yield


@pytest.fixture(scope='module')
def nodes(tmp_path_factory: pytest.TempPathFactory,
          ) -> Iterator[tuple[ContactNode, SoupNode, ViewNode, MarkersNode, Client]]:
    """Give nodes, view and markers of two boxes; a client that keeps what they publish."""
    sizes = [Parameter('size_a', value=SIZE_A), Parameter('size_b', value=SIZE_B)]
    client = Client()
    client.drawn, client.soups = [], {}
    client.node.create_subscription(
        ANSWERS['cloud'][0], f'soup/{ANSWERS["cloud"][1]}',
        lambda soup: client.soups.update({stamp_of(soup): soup}), 10)
    client.node.create_subscription(MarkerArray, 'markers', client.drawn.append,
                                    QoSProfile(depth=1000))
    folder = Parameter('files_from', value=str(tmp_path_factory.getbasetemp()))
    with (served(client, ContactNode(client.context, parameter_overrides=[
              *sizes, folder, Parameter('model', value='exact')])) as contact,
          served(client, SoupNode(client.context, parameter_overrides=[
              *sizes, folder, Parameter('divisions', value=1)])) as soup,
          served(client, ViewNode(client.context, 'contact_node')) as view,
          served(client, MarkersNode(client.context, parameter_overrides=[
              *sizes, folder])) as markers):
        yield contact, soup, view, markers, client
    client.close()
    gc.unfreeze()  # what the contact node keeps from being collected


@contextmanager
def served(client: Client, node: Node) -> Iterator[Node]:
    """Let a client's executor serve a node of its context."""
    client.executor.add_node(node)
    yield node
    client.executor.remove_node(node)
    spin_for(node, client.executor, 0.05)  # what it was given before, or asked
    node.destroy_node()


def added(drawn: MarkerArray, namespace: str) -> list[Marker]:
    return [marker for marker in drawn.markers
            if (marker.ns, marker.action) == (namespace, Marker.ADD)]


def with_contact(arrays: list[MarkerArray], stamps: Collection[int], boxes: int,
                 ) -> MarkerArray | None:
    """Return what first draws a contact and all boxes, of one of some stamps [ns]."""
    return next((drawn for drawn in arrays if added(drawn, 'points')
                 and len(added(drawn, 'boxes')) == boxes
                 and stamp_of(drawn.markers[0]) in stamps), None)


def is_whole(seen: Snapshot | None) -> bool:
    """Return whether a snapshot shows an answer to poses of all boxes at its stamp."""
    return (seen is not None and seen.answer is not None and not len(seen.answer.stale)
            and bool((seen.answer.stamps == seen.stamp).all()))


def whole(messages: dict[int, Any], start: int, scene: Scene) -> dict[int, np.ndarray]:
    """Return contacts from a stamp [ns] on of which no pair is stale: all boxes have matched."""
    found = {stamp: read_contacts(message, scene.ids)
             for stamp, message in messages.items() if stamp >= start}
    return {stamp: rows for stamp, rows in found.items() if not np.isnan(rows['depth']).any()}


@pytest.fixture(scope='module', params=FORMS)
def played(request: pytest.FixtureRequest, nodes: tuple,
           tmp_path_factory: pytest.TempPathFactory) -> Played:
    """Switch the programs to a form, move its boxes until all have met a contact, end `record`."""
    contact, soup, view, markers, client = nodes
    form, source, folder = request.param, FORMS[request.param], tmp_path_factory.mktemp('scene')
    if '\n' in source and form != 'inline array':
        (folder / 'scene.yaml').write_text(source)
        source = str(folder / 'scene.yaml')
    scene = read_scene(source) if source else two_boxes(SIZE_A, SIZE_B)
    for node in (contact, soup, markers):
        result, = node.set_parameters([Parameter('scene', value=source)])
        assert result.successful, result.reason
    client.drawn.clear()
    client.clouds.clear()
    client.soups.clear()
    client.ids = scene.ids
    told = (['--scene', source] if source else
            [word for option, size in (('--size-a', SIZE_A), ('--size-b', SIZE_B))
             for word in (option, *map(str, size))])
    with (served(client, node_of(['--out', str(folder / 'run'), *told])(client.context)) as record,
          served(client, SceneDriver(client.context, scene, RATE)) as driver):
        counts = record.recorder.counts
        wanted = [record.resolve_topic_name(topic)
                  for topic in (*scene.sources.values(), ANSWERS['cloud'][1])]
        seen: list[Snapshot] = []

        def met() -> bool:
            """Return whether each program has what its test needs."""
            if view.log and view.log.scene.scene == scene and not seen:
                now = view.log.snapshot()
                if is_whole(now) and now.stamp >= start and len(now.answer.pairs):
                    seen.append(now)
            clouds = whole(client.clouds, start, scene)
            return (bool(seen) and with_contact(client.drawn, clouds, boxes) is not None
                    and len(clouds) > TICKS and bool(whole(client.soups, start, scene))
                    and all(counts[topic] > TICKS for topic in wanted))

        start = driver._start
        boxes = len(scene.moving) + sum(box.pose is not None for box in scene.boxes.values())
        assert client.spin(met), (seen, client.drawn[-1:], counts)
    clouds = whole(client.clouds, start, scene)
    return Played(form, scene, driver, clouds, whole(client.soups, start, scene),
                  with_contact(client.drawn, clouds, boxes), seen[0], folder / 'run')


def test_contact_node(played):
    """Every tick of the driver has the contacts that its poses give."""
    met = 0
    for stamp, rows in played.clouds.items():
        found = {int(row['pair']): (row['point_x'], row['point_y'], row['point_z'])
                 for row in rows}
        wanted = played.answer(stamp)
        assert found.keys() == wanted.keys()
        assert all(found[pair] == tuple(wanted[pair]) for pair in found)
        met += len(found)
    assert met


def test_soup_node(played):
    """Its triangles meet where the boxes do."""
    for stamp, rows in played.soups.items():
        assert set(rows['pair'].tolist()) == set(played.answer(stamp))


def test_check(played):
    """`contact_node --check` tells every box, pair and topic."""
    lines = '\n'.join(meaning(played.scene))
    for name in (*played.scene.boxes, *(pair.name for pair in played.scene.pairs)):
        assert f' {name}:' in lines
    assert f'topics in: {len(played.scene.sources)} (' in lines


def test_view(played):
    """All boxes stand where they are at the stamp, the contact where it is."""
    seen, poses = played.seen, played.poses(played.seen.stamp)
    assert {name: tuple(pose) for name, pose in zip(seen.scene.names, seen.poses)} == {
        name: tuple(pose) for name, pose in poses.items()}
    wanted = played.answer(seen.stamp)
    ids = [played.scene.pairs[row].id for row in seen.answer.pairs]
    assert sorted(ids) == sorted(wanted)
    assert np.array_equal(seen.answer.points, [wanted[pair] for pair in ids])
    assert not seen.stale_boxes.any()


def test_markers(played):
    """A cube of every box at its pose, a point of every contact."""
    stamp = stamp_of(played.drawn.markers[0])
    poses, names = played.poses(stamp), list(played.scene.boxes)
    cubes = {names[marker.id]: marker for marker in added(played.drawn, 'boxes')}
    assert cubes.keys() == poses.keys()
    for name, cube in cubes.items():
        assert (cube.scale.x, cube.scale.y, cube.scale.z) == played.scene.boxes[name].size
        assert place(cube.pose.position) == tuple(poses[name][:3])
    points, = added(played.drawn, 'points')
    assert sorted(map(place, points.points)) == sorted(map(tuple, played.answer(stamp).values()))


def place(xyz) -> tuple[float, float, float]:
    return xyz.x, xyz.y, xyz.z


def test_record(played):
    """The scene, its pose topics with their type, and what came on them."""
    recording = read_recording(played.bag)
    assert recording.scene == played.scene
    topics = {topic for _, topic, _ in recording.messages}
    assert {name.lstrip('/') for name in played.scene.sources.values()} | {'contacts'} <= topics
    with Reader(played.bag) as reader:
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
    for topic in played.scene.sources.values():
        assert kinds[f'/{topic.lstrip("/")}'] == (POSES if played.scene.pose_array else POSE)


def test_view_replay(played):
    """The recording draws what the view drew while it was made."""
    player = bag_player.BagPlayer(played.bag)
    compared = 0
    for at, topic, data in player._messages:
        player._take[topic](at, data)
        shown = player.log.snapshot()
        if topic == 'contacts' and is_whole(shown) and shown.stamp >= played.driver._start:
            poses = played.poses(shown.stamp)
            assert np.array_equal(shown.poses, [poses[name] for name in shown.scene.names])
            wanted = played.answer(shown.stamp).values()
            assert sorted(map(tuple, shown.answer.points)) == sorted(map(tuple, wanted))
            compared += 1
    assert compared > TICKS / 2  # of the first ticks a pose may be missing


def test_bench_replay(played):
    """Poses of each pair, whether they come from topics, arrays or do not move."""
    for pair in played.scene.pairs:
        replay = read_replay(played.bag, pair=pair.name) if pair.name else read_replay(played.bag)
        assert replay.sizes == (played.scene.boxes[pair.a].size, played.scene.boxes[pair.b].size)
        for stamp, pose_a, pose_b in zip(replay.stamps.tolist(), replay.pose_a, replay.pose_b):
            poses = played.poses(stamp)
            assert np.array_equal((pose_a, pose_b), (poses[pair.a], poses[pair.b]))
        assert len(replay) > TICKS / 2


# --- the programs themselves ----------------------------------------------------------------------


def test_the_programs_with_an_array(program, tmp_path):
    """All at once, with the scene as text: nobody dies, all is drawn. Then both replays of that.

    `view --scene` starts contact node and driver.
    """
    pytest.importorskip('viser')
    text, out = FORMS['inline array'], tmp_path / 'run'
    domain = ('--no-browser', '--domain', os.environ['ROS_DOMAIN_ID'])
    running = [program('view', *domain, '--port', '8310', '--scene', text),
               program('view', *domain, '--port', '8320', '--attach'),
               program('markers', '--ros-args', *parameters(scene=text)),
               program('record', '--out', str(out), '--scene', text)]
    record = running[-1]
    for topic in ('poses', 'contacts', 'markers'):
        record.wait_for_output(f'receiving /{topic}\n', 60)
    time.sleep(1.0)
    for one in reversed(running):
        assert one.process.poll() is None, one.output
        one.process.send_signal(signal.SIGINT)
    for one in running:
        assert one.wait() == 0 and 'Traceback' not in one.output, one.output
    recording = read_recording(out)
    drawn = [deserialize_message(data, MarkerArray)
             for _, topic, data in recording.messages if topic == 'markers']
    assert any(len(added(one, 'boxes')) == len(recording.scene.boxes) and added(one, 'points')
               for one in drawn)

    replay = program('view', '--no-browser', '--port', '8330', '--replay', str(out))
    replay.wait_for_output('Ctrl-C', 60)
    running = bench(program, tmp_path,
                    f'--duration 0.2 --nodes contact --replay {out} --pair crate01_floor')
    assert running.wait(240) == 0, running.output
    row, = rows_of(tmp_path).values()
    assert row['sent'] == row['answered'] != '0' and row['wrong_verdicts'] == '0'
    replay.process.send_signal(signal.SIGINT)
    assert replay.wait() == 0 and 'Traceback' not in replay.output, replay.output
