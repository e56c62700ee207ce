# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The view: its figures by hand, its ears over DDS, the program, the page in a real browser."""
from __future__ import annotations

import io
import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import poses
import pytest
from geometry_msgs.msg import WrenchStamped
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from ros_client import PATIENCE, Client, row_of, serving
from visualization_msgs.msg import MarkerArray

pytest.importorskip('viser')
pytest.importorskip('mujoco')

from box_contact_ros.scene.files.scene_file import read_scene
from browser import chromium, open_page
from children import children
from PIL import Image

from box_contact_ros import ContactSolver
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import (
    CLOUD_ROW,
    NANOSECONDS,
    Refused,
    make_cloud,
    make_header,
    read_cloud,
)
from box_contact_ros.node.ros_client import (
    CRANE_MARKERS,
    CRANE_WRENCH,
    array_message,
    line_marker,
    pose_topics,
)
from box_contact_ros.scene.pose import rotation_matrix
from box_contact_ros.scene.scene_solver import Box, Pair, Scene, SceneSolver, two_boxes
from box_contact_ros.view.listener import ViewNode
from box_contact_ros.view.page.read_outs import deepest_contacts, read_out
from box_contact_ros.view.page.stage import CUBE as CUBE_CORNERS
from box_contact_ros.view.page.stage import camera_position
from box_contact_ros.view.page.view_page import Page
from box_contact_ros.view.scene_driver import VISIT, motions
from box_contact_ros.view.style import (
    BOX_A,
    BOX_B,
    CONTACT,
    LEGEND,
    LISTED,
    patch_areas,
    patch_axes,
    patch_outlines,
)
from box_contact_ros.view.view_log import LOST_AFTER, OtherSceneError, ViewLog

ORIGIN = poses.IDENTITY
TOUCHING = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])
APART = np.array([0.5, 0.25, 2.5, 0, 0, 0, 1])
CUBE = (2.0, 2.0, 2.0)
EXACT = ContactSolver(CUBE, CUBE, model='exact')(ORIGIN, TOUCHING)
NO_ROWS = np.zeros(0, CLOUD_ROW)
BOTH = two_boxes(CUBE, CUBE)
START = 1_000 * NANOSECONDS
MS = 1_000_000


def rows(shift=0.0):
    """Return the row of the exact contact, its point moved by `shift` [m]."""
    return np.array([row_of(EXACT._replace(point=EXACT.point + (shift, 0, 0)))], CLOUD_ROW)


@pytest.fixture
def log():
    return ViewLog(BOTH)


def send(log, stamp, b=TOUCHING):
    log.pose('box_a', stamp, ORIGIN)
    log.pose('box_b', stamp, b)


# --- figures --------------------------------------------------------------------------------------


@pytest.mark.parametrize('cloud_at', [0, 1, 2])
def test_an_answer_belongs_to_the_poses_of_its_stamp(log, cloud_at):
    """Whichever of the three messages comes first; latency is from the stamp to the cloud."""
    news = [lambda: log.pose('box_a', START, ORIGIN), lambda: log.pose('box_b', START, TOUCHING)]
    news.insert(cloud_at, lambda: log.contacts(START, rows(), START + 3 * MS))
    for one in news:
        one()
    seen, figures = log.snapshot(), log.figures(START + 4 * MS)
    assert np.array_equal(seen.poses, (ORIGIN, TOUCHING))
    assert np.array_equal(seen.answer.points, [EXACT.point])
    assert np.array_equal(seen.answer.normals, [EXACT.normal])
    assert np.array_equal(seen.answer.covariances, [EXACT.covariance])
    assert seen.answer.contacts['depth'] == -EXACT.separation == -seen.separation
    assert figures.latency_median == pytest.approx(3e-3)
    assert (figures.answered, figures.lost) == (1, 0)


def test_point_errors_are_distances_from_the_exact_point(log):
    """99 points 3 mm off and one 40 mm off: median 3 mm, and the p99 above it."""
    for i in range(100):
        stamp = START + 5 * MS * i
        send(log, stamp)
        log.contacts(stamp, rows(0.040 if i == 50 else 0.003), stamp + MS)
    figures = log.figures(stamp + MS)
    assert figures.point_error_median == pytest.approx(3e-3)
    assert 3.1e-3 < figures.point_error_p99 < 40e-3
    assert figures.edge == 2.0
    assert figures.rate == 100


def test_a_pair_without_an_answer_is_lost_in_the_end(log):
    """Of five pairs the third has no answer: lost a second later, not before."""
    for i in range(5):
        stamp = START + 10 * MS * i
        send(log, stamp)
        if i != 2:
            log.contacts(stamp, rows(), stamp + MS)
    assert log.figures(stamp).lost == 0
    send(log, START + 20 * MS + LOST_AFTER + 1)
    assert (log.figures(stamp).answered, log.figures(stamp).lost) == (4, 1)


def test_nothing_is_lost_before_the_first_answer_nor_on_the_way_to_the_view(log):
    """Poses that nobody was there for, and a cloud whose poses the view has missed."""
    for i in range(3):
        send(log, START + 10 * MS * i)
    stamp = START + 30 * MS
    send(log, stamp)
    log.contacts(stamp, rows(), stamp + MS)
    log.contacts(stamp + 10 * MS, rows(), stamp + 11 * MS)
    for i in range(3):
        later = stamp + (i + 1) * 2 * LOST_AFTER
        send(log, later)
        log.contacts(later, rows(), later)
    assert log.figures(later).lost == 0


def test_latest_pairing_answers_with_the_newer_stamp():
    """A at 10 ms with B at 0 ms: the cloud carries 10 ms; by stamps alone, no error is known."""
    for pairing, errors in (('latest', 1), ('stamp', 0)):
        log = ViewLog(BOTH, pairing=pairing)
        log.pose('box_b', START, TOUCHING)
        log.pose('box_a', START + 10 * MS, ORIGIN)
        log.contacts(START + 10 * MS, rows(), START + 11 * MS)
        seen = log.snapshot()
        assert np.array_equal(seen.poses, (ORIGIN, TOUCHING))
        assert len(seen.answer.point_errors) == errors


# --- a scene of more boxes ------------------------------------------------------------------------


def place(number):
    """Return x, y of a stack: rows of ten, 5 m apart."""
    return 5.0 * (number % 10), 5.0 * (number // 10)


def stacks(count):
    """Return a scene of loads over fixed cubes; each load is paired with its own and the next."""
    boxes = {f'load_{n}': Box(f'load_{n}', CUBE, pose_topic=f'load_{n}/pose')
             for n in range(count)}
    boxes |= {f's{n}': Box(f's{n}', CUBE, (*place(n), 0, 0, 0, 0, 1)) for n in range(count)}
    pairs = [Pair(10 + n, f'load_{n}_s{n}', f'load_{n}', f's{n}') for n in range(count)]
    pairs += [Pair(1000 + n, f'near_{n}', f'load_{n}', f's{n + 1}') for n in range(count - 1)]
    return Scene(boxes, tuple(pairs), 'yard')


def cloud_of(answer):
    message = make_cloud(make_header(0, 'yard'), answer)
    return read_cloud(message)


def loads(count, depths):
    """Return a pose for each load over its own cube, so deep."""
    return [np.array([*place(n), 2.0 - depths[n], 0, 0, 0, 1]) for n in range(count)]


def test_contacts_of_many_pairs_against_the_solver():
    """Points, normals, patches and errors are those of each pair, whatever the rows' order."""
    scene = stacks(20)
    depths = 1e-3 * np.random.default_rng(1).permutation(np.arange(-5, 15))
    answer = SceneSolver(scene, model='exact')(loads(20, depths))
    log = ViewLog(scene)
    for name, pose in zip(scene.moving, loads(20, depths)):
        log.pose(name, START, pose, 'yard')
    log.contacts(START, cloud_of(answer)[::-1], START + MS, 'yard')
    seen = log.snapshot()
    assert not np.isnan(seen.poses).any() and seen.frame_id == 'yard'
    touching = [(pair.name, contact) for pair, contact in reversed(answer.touching)]
    assert [scene.pairs[row].name for row in seen.answer.pairs] == [name for name, _ in touching]
    assert len(touching) == np.sum(depths >= 0.0)
    for number, (_, contact) in enumerate(touching):
        assert np.array_equal(seen.answer.points[number], contact.point)
        assert np.array_equal(seen.answer.covariances[number], contact.covariance)
    assert seen.answer.point_errors == pytest.approx(0.0, abs=1e-15)
    assert len(seen.answer.point_errors) == len(touching)
    assert seen.separation == pytest.approx(-depths.max())
    listed = re.findall(r'<tr><td>(load_\d+)_s\d+</td><td[^>]*>([\d.]+)<', deepest_contacts(seen))
    deepest = np.argsort(-depths)[:LISTED]
    assert listed == [(f'load_{n}', f'{1e3 * depths[n]:.2f}') for n in deepest]
    assert f'and {len(touching) - LISTED} more' in deepest_contacts(seen)
    text = read_out(seen, log.figures(START + 2 * MS), 'exact')
    assert shown(text, 'pairs') == f'{len(touching)} of 39'


def test_a_silent_box_is_grey_and_stays_where_it_was():
    """Of a stale pair the box that is not heard of, never one that is fixed or sends."""
    scene = stacks(3)
    solver, log = SceneSolver(scene, model='exact'), ViewLog(scene)
    placed = loads(3, [0.01, 0.01, 0.01])
    for name, pose in zip(scene.moving, placed):
        log.pose(name, START, pose)
    log.contacts(START, cloud_of(solver(placed)), START)
    assert not log.snapshot().stale_boxes.any()
    log.pose('load_0', START + MS, placed[0])
    log.pose('load_2', START + MS, placed[2])
    log.contacts(START + MS, cloud_of(solver([placed[0], None, placed[2]])), START + MS)
    seen = log.snapshot()
    assert [name for name, stale in zip(scene.boxes, seen.stale_boxes) if stale] == ['load_1']
    assert np.array_equal(seen.poses[1], placed[1])
    assert [scene.pairs[row].name for row in seen.answer.pairs] == ['load_0_s0', 'load_2_s2']
    assert 'stale: load_1_s1, near_1' in deepest_contacts(seen)


def array_of(*poses):
    """Return the bytes of a PoseArray at START."""
    return serialize_message(array_message(make_header(START, 'yard'), poses))


def test_boxes_that_an_array_lacks_are_not_there():
    """A row of NaN, and a quaternion of length zero; they stay where they were, in grey."""
    boxes = {name: Box(name, CUBE) for name in ('a', 'b', 'c', 'd')}
    scene = Scene(boxes, (Pair.between('a', 'b'), Pair.between('c', 'd')), pose_array=True)
    topic, = pose_topics(scene)
    log, solver = ViewLog(scene), SceneSolver(scene, model='exact')
    for box in scene.moving:
        log.pose(box, START - MS, ORIGIN)
    found = topic.read(array_of(ORIGIN, TOUCHING, [math.nan] * 7, [0.0] * 7))
    assert (topic.boxes, found.stamp, found.frame_id) == (scene.moving, START, 'yard')
    log.poses(topic.boxes, found.stamp, found.numbers, found.frame_id)
    log.contacts(START, cloud_of(solver([ORIGIN, TOUCHING, None, None])), START)
    seen = log.snapshot()
    assert seen.stale_boxes.tolist() == [False, False, True, True]
    assert np.array_equal(seen.poses, [ORIGIN, TOUCHING, ORIGIN, ORIGIN])
    for late in (1, LOST_AFTER + 2):  # a tick without its absent boxes is a tick, and can be lost
        log.poses(topic.boxes, START + late, found.numbers)
    assert log.figures(START).lost == 1


@pytest.mark.parametrize('count', [0, 1, 3])
def test_an_array_for_another_number_of_boxes_is_refused(count):
    topic, = pose_topics(Scene({name: Box(name, CUBE) for name in 'ab'},
                               (Pair.between('a', 'b'),), pose_array=True))
    with pytest.raises(Refused, match=f'{count} poses, but 2 boxes'):
        topic.read(array_of(*[ORIGIN] * count))


def test_a_pair_that_the_scene_has_not_is_refused(log):
    """And what was drawn stays."""
    send(log, START)
    log.contacts(START, rows(), START)
    other = rows()
    other['pair'] = 7
    with pytest.raises(OtherSceneError, match='pair 7'):
        log.contacts(START + MS, other, START + MS)
    assert log.snapshot().answer.stamp == START


# --- what is shown --------------------------------------------------------------------------------


def shown(text, name):
    return re.sub('<[^>]*>', '', re.search(rf'id="{name}"[^>]*>(.*?)</td>', text).group(1))


def headline(text):
    return re.search(r'id="verdict"[^>]*>(.*?)</div>', text).group(1)


@pytest.mark.parametrize('aspect', [0.5, 530 / 600, 16 / 9, 4.0])
@pytest.mark.parametrize('extents', [(12.2, 2.4, 5.2), (1.0, 1.0, 30.0), (60.0, 40.0, 10.0)])
def test_all_corners_are_in_view_whatever_its_shape(aspect, extents):
    """And they fill it: one of them is near an edge."""
    fov, corners = math.radians(75.0), CUBE_CORNERS * extents
    camera = camera_position(corners, fov, aspect)
    back = camera / np.linalg.norm(camera)
    right = np.cross([0.0, 0.0, 1.0], back) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], back))
    depth = np.linalg.norm(camera) - corners @ back
    tangent = math.tan(0.5 * fov)
    shares = np.abs([corners @ right / (aspect * tangent), corners @ np.cross(back, right)
                     / tangent]) / depth
    assert depth.min() > 0.0 and 0.9 < shares.max() < 1.0


def test_read_out_says_lengths_in_mm_and_shares_of_the_edge(log):
    """3 mm of an edge of 2 m are 0.15 %."""
    send(log, START)
    log.contacts(START, rows(0.003), START + 2 * MS)
    text = read_out(log.snapshot(), log.figures(START + 3 * MS), 'soup')
    assert headline(text) == 'contact, 125.0 mm deep'
    assert shown(text, 'separation') == '-125.00 mm'
    assert shown(text, 'error') == '3.0 mm = 0.15 %'
    assert '>0.328</td>' in deepest_contacts(log.snapshot())  # 1.5 × 1.75 × 0.125 m³
    assert '>2.62</td>' in deepest_contacts(log.snapshot())
    assert shown(text, 'latency') == '2.00 ms'
    assert shown(text, 'lost') == '0 of 1'
    assert 'point error of soup' in text


def test_read_out_without_contact_answer_or_poses(log):
    """No figure is made up."""
    assert headline(read_out(None, None, '')) == 'waiting for poses'
    send(log, START, APART)
    text = read_out(log.snapshot(), log.figures(START), 'exact')
    assert (headline(text), shown(text, 'error')) == ('no answer', '–')
    log.contacts(START, NO_ROWS, START)
    text = read_out(log.snapshot(), log.figures(START), 'exact')
    assert (headline(text), shown(text, 'error')) == ('no contact, 500.0 mm apart', '–')
    assert deepest_contacts(None) == '' and '</td></tr></table>' in deepest_contacts(log.snapshot())


@pytest.mark.parametrize('turn', [(0, 0, 0, 1), (0.1, -0.5, 0.3, 0.8)])
def test_the_ellipse_of_a_rectangle(turn):
    """A patch l × w: semi-axes l/2 and w/2 along its edges, area l·w; however the boxes lie."""
    length, width = 1.75, 1.5
    turned = rotation_matrix(turn)
    contact = ContactSolver(CUBE, CUBE, model='exact')(
        (0, 0, 0, *turn), (*turned @ [0.5, 0.25, 1.875], *turn))
    semi_axes = patch_axes(contact.normal[None], contact.covariance[None])
    longer, shorter = turned @ (0, length / 2, 0), turned @ (width / 2, 0, 0)
    for found, wanted in zip(semi_axes[0], (longer, shorter), strict=True):
        assert found * np.sign(found @ wanted) == pytest.approx(wanted, abs=1e-12)
    assert patch_areas(semi_axes) == pytest.approx(length * width)
    line = patch_outlines(np.zeros((1, 3)), semi_axes)[0] @ turned  # in the boxes' frame
    assert np.abs(line).max(axis=0) == pytest.approx([width / 2, length / 2, 0.0], abs=1e-12)
    assert (line[:, 0] / width)**2 + (line[:, 1] / length)**2 == pytest.approx(0.25)
    assert line[0] == pytest.approx(line[-1])


def test_the_ellipse_of_a_line_of_a_point_and_of_no_patch():
    """Variances of zero, or below by rounding, have no width; NaN has no ellipse."""
    down = np.tile([0.0, 0.0, -1.0], (3, 1))
    line, point = np.diag([3.0, -1e-17, 1e-20]), -1e-17 * np.eye(3)
    semi_axes = patch_axes(down, np.array([line, point, np.full((3, 3), math.nan)]))
    assert np.abs(semi_axes[0, 0]) == pytest.approx([3.0, 0.0, 0.0])
    assert not semi_axes[0, 1].any() and not semi_axes[1].any()
    assert patch_areas(semi_axes)[:2] == pytest.approx(0.0)
    assert np.isnan(semi_axes[2]).all()


# --- moved without a simulator -------------------------------------------------------------------


@pytest.mark.parametrize('name, in_contact', [
    ('yard_bay', {'load_r01_t5'}), ('two_boxes', {'box_a_box_b'}),
    ('spreader_container_stack', {'load_stack', 'load_neighbour', 'spreader_load'})])
def test_the_driver_sets_boxes_down_on_their_partners(name, in_contact):
    """One after the other, by some centimetres at most; in between nothing but riders touch."""
    scene = read_scene(name)
    solver, moves, found = SceneSolver(scene, model='exact'), motions(scene), []
    for time_ in np.arange(0.0, 2.0 * VISIT, 0.1):
        answer = solver([moves[box](time_) for box in scene.moving])
        assert all(contact.separation > -0.05 for _, contact in answer.touching)
        found.append({pair.name for pair, _ in answer.touching})
    assert in_contact <= set().union(*found)
    assert len(set(map(frozenset, found))) > 1


# --- over DDS -------------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def client():
    client = Client()
    yield client
    client.close()


@pytest.fixture(scope='module')
def contact_node():
    settings = {'size_a': list(CUBE), 'size_b': [2.0, 2.0, 2.5], 'model': 'exact'}
    with serving(lambda context: ContactNode(context, parameter_overrides=[
            Parameter(name, value=value) for name, value in settings.items()])) as node:
        yield node


@pytest.fixture(scope='module')
def view(contact_node):
    with serving(lambda context: ViewNode(context, 'contact_node')) as node:
        yield node


def test_it_learns_what_the_contact_node_is_set_to(view, client):
    """Sizes and model, by its parameter services; and a change that somebody else makes."""
    assert client.spin(lambda: view.log is not None)
    assert list(view.settings['size_b']) == [2.0, 2.0, 2.5]
    assert view.settings['model'] == 'exact' and view.connected


def test_it_hears_poses_and_answers(view, client):
    """And measures a latency; a pose of NaN, which the contact node refuses, is no pair."""
    client.offer_until_answered(ORIGIN, APART)
    assert client.spin(lambda: view.log is not None)
    deadline = time.monotonic() + PATIENCE  # the view has to have matched too
    while not (view.log.snapshot() and view.log.snapshot().answer):
        assert time.monotonic() < deadline, 'nothing heard'
        client.ask(ORIGIN, TOUCHING)
    stamp = client.ask(ORIGIN, TOUCHING)
    assert client.spin(lambda: view.log.snapshot().answer.stamp == stamp)
    seen = view.log.snapshot()
    assert seen.answer.points == pytest.approx(seen.answer.exact_points)
    assert 0.0 < seen.answer.latency < 5.0
    client.send(ORIGIN, (math.nan, 0, 0, 0, 0, 0, 1))
    client.ask(ORIGIN, APART)
    assert client.spin(lambda: not len(view.log.snapshot().answer.pairs))


def test_it_hears_the_crane(view, client):
    """Lines of every kind that the crane draws, in their order."""
    lines = np.arange(36.0).reshape(6, 2, 3)
    publisher = client.node.create_publisher(MarkerArray, CRANE_MARKERS, 10)
    header = make_header(1, 'world')
    deadline = time.monotonic() + PATIENCE
    while not len(view.lines):
        assert time.monotonic() < deadline, 'nothing heard'
        publisher.publish(MarkerArray(markers=[
            line_marker(header, name, part, width=0.1, colour=(0, 0, 0))
            for name, part in (('ropes', lines[:4]), ('spreader', lines[4:]))]))
        client.spin(lambda: False, 0.05)
    assert np.array_equal(view.lines, lines)


def test_it_hears_the_force_on_the_load(view, client):
    """Its upward part; a force that none can be is refused, and the one before stays."""
    publisher = client.node.create_publisher(WrenchStamped, CRANE_WRENCH, 10)
    message = WrenchStamped()
    message.wrench.force.z = 196e3
    deadline = time.monotonic() + PATIENCE
    while math.isnan(view.force):
        assert time.monotonic() < deadline, 'nothing heard'
        publisher.publish(message)
        client.spin(lambda: False, 0.05)
    for force in (math.inf, math.nan, 1e300):
        message.wrench.force.z = force
        with pytest.raises(Refused, match='force'):
            view._on_force(message)
    assert view.force == 196e3


def test_it_switches_the_model_of_the_running_node(view, client, contact_node):
    """Granted, or refused with the node's own words, and then the old one stays."""
    assert client.spin(lambda: view.log is not None)
    view.set_model('mlp')
    assert client.spin(lambda: view.settings['model'] == 'mlp' and not view.wish)
    assert contact_node.get_parameter('model').value == 'mlp'
    view.set_model('paper')  # it knows cubes and containers, not these sizes
    assert client.spin(lambda: view.refusal)
    assert 'paper' in view.refusal and not view.wish
    assert contact_node.get_parameter('model').value == 'mlp'
    view.set_model('exact')
    assert not view.refusal
    assert client.spin(lambda: view.settings['model'] == 'exact' and not view.wish)


# --- the program ----------------------------------------------------------------------------------


def start_view(program, *arguments):
    """Return the program, and the address of its page; in this test's domain."""
    running = program('view', '--no-browser', '--port', '8300', '--domain',
                      os.environ['ROS_DOMAIN_ID'], *arguments)
    output = running.wait_for_output('Ctrl-C', 60)
    return running, re.search(r'http://127\.0\.0\.1:\d+', output).group()


def test_an_address_that_is_none_ends_it(program):
    """It waited for ever for a server that could not start, and no signal ended it."""
    running = program('view', '--no-browser', '--host', '192.0.2.1')  # of nobody
    assert running.wait(60) == 1
    assert 'error: ' in running.output and 'Traceback' not in running.output


@pytest.mark.parametrize('number, status', [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_no_process_is_left(program, number, status):
    """Node and crane have groups of their own; the view alone gets the signal."""
    running, _ = start_view(program, '--model', 'exact')
    deadline = time.monotonic() + PATIENCE
    while len(started := children(running.process.pid)) < 2 and time.monotonic() < deadline:
        time.sleep(0.1)
    assert len(started) == 2
    running.process.send_signal(number)
    assert running.wait() == status, running.output
    assert not [pid for pid in started if Path(f'/proc/{pid}').exists()]
    assert 'Traceback' not in running.output


def test_attached_it_starts_nothing(program, contact_node):
    """The page is served, for a node that runs already."""
    running, url = start_view(program, '--attach')
    time.sleep(1.0)
    assert children(running.process.pid) == []
    running.process.send_signal(signal.SIGINT)
    assert running.wait() == 0, running.output
    assert url


def test_a_node_that_cannot_start_ends_the_view(program):
    """With its own words; the paper's continuous networks know cubes only."""
    running, _ = start_view(program, '--model', 'paper-continuous')
    assert running.wait(120) == 1
    assert 'contact_node ended' in running.output and 'paper-continuous' in running.output
    assert 'Traceback' not in running.output


@pytest.mark.parametrize('arguments', [
    ('--model', 'crystal-ball'), ('--rate', '5000'), ('--port', '0'), ('--domain', '500'),
    ('--spin',), ('--rate', '100', '--attach'), ('--open-loop', '--attach')])
def test_bad_arguments(arguments):
    done = subprocess.run([sys.executable, '-m', 'box_contact_ros', 'view', *arguments],
                          capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and arguments[0] in done.stderr


def near(picture, colour, distance):
    """Share of the pixels whose hue is that of a colour, however light or dark it got."""
    hue = np.array(colour, float) - np.mean(colour)
    offset = picture - picture.mean(axis=-1, keepdims=True)
    saturation = np.linalg.norm(offset, axis=-1)
    aligned = offset @ hue / np.linalg.norm(hue)
    return np.mean((saturation > 25) & (aligned > (1.0 - distance) * saturation))


CANVASES = '[...document.querySelectorAll("canvas")].map(c => c.clientWidth)'
CHARTS = 'Object.values(window.__viserTestpoints.uplots).map(one => one.chart)'


def filled(tab):
    """Return the models whose buttons are filled."""
    return tab.evaluate(
        '[...document.querySelectorAll("button")].filter(b => '
        f'getComputedStyle(b).backgroundColor == "rgb{CONTACT}").map(b => b.innerText)')


@pytest.mark.timeout(600)
@pytest.mark.skipif(chromium() is None, reason='no Chromium here: apt install chromium')
@pytest.mark.parametrize('width', [800, 1280])
def test_a_page_of_any_width(log, width):
    """The panel takes a third at most, the model that runs is marked, the force has a chart."""
    send(log, START)
    log.contacts(START, rows(), START + MS)
    page = Page('127.0.0.1', 8450, on_model=print)
    try:
        page.draw(log.snapshot(), np.zeros((0, 2, 3)), 2e5)
        page.show(log.snapshot(), log.figures(START), model='exact', wish='', refusal='',
                  connected=True)
        with open_page(page.url, width) as tab:
            tab.wait_for('document.getElementById("verdict")?.innerText.startsWith("contact, ")')
            tab.wait_for(f'{CANVASES}.length == 4')  # two layers, two charts
            tab.wait_for(f'Math.max(...{CANVASES}) < {width}')  # the panel has come
            assert filled(tab) == ['exact']
            assert tab.evaluate(f'Math.max(...{CANVASES})') >= 0.65 * width
    finally:
        page.close()


@pytest.mark.timeout(600)
@pytest.mark.skipif(chromium() is None, reason='no Chromium here: apt install chromium')
def test_the_page_in_a_browser(program):
    """It draws both boxes; the figures come and are sound; a button switches the running node."""
    _, url = start_view(program, '--model', 'exact', '--rate', '100')
    with open_page(url) as tab:
        tab.wait_for('document.getElementById("verdict")?.innerText.startsWith("no contact, ")'
                     ' && parseFloat(document.getElementById("separation")?.innerText) > 0', 400)
        until = time.monotonic() + 60.0
        shares = []
        while time.monotonic() < until and not (shares and min(shares) > 0.02):
            picture = np.array(Image.open(io.BytesIO(tab.picture())).convert('RGB'), float)
            scene = picture[:, :picture.shape[1] // 2]
            shares = [near(scene, colour, 0.1) for colour in (BOX_A, BOX_B)]
        assert min(shares) > 0.02
        # Charts have the axis of times that they were given, and values along it.
        tab.wait_for(f'{CHARTS}.every(c => c.scales.x.min == -12 && c.scales.x.max == 0'
                     ' && c.data[0].length > 10)')
        # All at once: the next landing begins with a load in the air.
        assert tab.wait_for('document.getElementById("verdict")?.innerText.startsWith("contact, ")'
                            ' && document.getElementById("error")?.innerText.startsWith("0.0 mm")'
                            ' && parseFloat(document.getElementById("separation").innerText) < 0')
        assert 0.0 < float(tab.text('latency').split()[0]) < 1000.0
        pytest.importorskip('fcl')
        tab.click('soup')
        tab.wait_for('document.getElementById("model-status").innerText == "running: soup"')
        assert filled(tab) == ['soup']
        tab.click('land again')
        tab.wait_for('document.getElementById("verdict").innerText.startsWith("no contact, ")')


@pytest.mark.timeout(600)
@pytest.mark.skipif(chromium() is None, reason='no Chromium here: apt install chromium')
def test_two_hundred_boxes_in_a_browser():
    """All are drawn, of all contacts the ten deepest are listed; a silent box is named in grey."""
    scene = stacks(100)
    depths = np.linspace(0.001, 0.1, 100)
    answer = SceneSolver(scene, model='exact')([None, *loads(100, depths)[1:]])
    log = ViewLog(scene)
    for name, pose in zip(scene.moving, loads(100, depths)):
        log.pose(name, START - (name == 'load_0'), pose, 'yard')
    log.contacts(START, cloud_of(answer), START + MS, 'yard')
    page = Page('127.0.0.1', 8400)
    try:
        page.draw(log.snapshot(), np.zeros((0, 2, 3)))
        page.show(log.snapshot(), log.figures(START + MS), model='exact', wish='', refusal='',
                  connected=True)
        with open_page(page.url) as tab:
            tab.wait_for('document.getElementById("pairs")?.innerText == "99 of 199"', 400)
            table = tab.text('deepest').split('\n')
            assert [row.split('\t')[0] for row in table[1:1 + LISTED]] == [
                f'load_{n}_s{n}' for n in range(99, 89, -1)]
            assert table[1 + LISTED] == f'and {99 - LISTED} more'
            assert tab.text('stale') == 'stale: load_0_s0, near_0'
            assert all(text in tab.text('legend') for _, text in LEGEND)
            deadline = time.monotonic() + 60.0
            shares = [0.0]  # of pixels: some hundred of each
            while min(shares) < 5e-4 and time.monotonic() < deadline:  # meshes come after the texts
                picture = np.array(Image.open(io.BytesIO(tab.picture())).convert('RGB'), float)
                shares = [near(picture[:, :800], colour, 0.1) for colour in (BOX_A, BOX_B, CONTACT)]
            assert min(shares) > 5e-4, shares
    finally:
        page.close()
