# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The view: what it hears, the program, and the page in a real browser."""
from __future__ import annotations

import io
import math
import re
import signal
import threading
import time
from contextlib import ExitStack, closing
from dataclasses import replace
from http.client import HTTPConnection

import numpy as np
import poses
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, WrenchStamped
from patience import PATIENCE
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from ros_client import Client, serving
from visualization_msgs.msg import Marker

pytest.importorskip('viser')
pytest.importorskip('mujoco')

import msgspec
import viser
from browser import chromium, open_page
from PIL import Image
from typed_messages import changed, contacts_at, joint_state, pose_stamped, read
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import connect

from box_contact_ros import ContactSolver
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import make_header
from box_contact_ros.node.parameters import SCENE_PARAMETERS
from box_contact_ros.node.topics import contact_qos
from box_contact_ros.scene.boxes import Box
from box_contact_ros.scene.scene import Pair, Scene, two_boxes
from box_contact_ros.solver.nearest import Nearest
from box_contact_ros.solver.pose import rotation_matrix
from box_contact_ros.stream.cdr import NANOSECONDS, MessageError
from box_contact_ros.view.drawing import CUBE as CUBE_CORNERS
from box_contact_ros.view.drawing import camera_position
from box_contact_ros.view.live import listener
from box_contact_ros.view.live.listener import (
    DrawnTick,
    Listener,
    SceneRows,
    Track,
    read_sorted,
)
from box_contact_ros.view.live.page import Page, figures, legend
from box_contact_ros.view.live.view_node import ViewNode
from box_contact_ros.view.server import Server
from box_contact_ros.view.style import BOX_A, BOX_B, CONTACT, patch_axes, patch_sides

ORIGIN = poses.IDENTITY
TOUCHING = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])
APART = np.array([0.5, 0.25, 2.5, 0, 0, 0, 1])
CUBE = (2.0, 2.0, 2.0)
EXACT = ContactSolver(CUBE, CUBE, model='exact')(ORIGIN, TOUCHING)
BOTH = two_boxes(CUBE, CUBE)
ROWS = SceneRows(BOTH)
SIZES = [Parameter(name, value=list(CUBE)) for name in ('size_a', 'size_b')]
PAIR, = BOTH.pairs
START = 1_000 * NANOSECONDS
MS = 1_000_000


# --- what is heard --------------------------------------------------------------------------------


@pytest.fixture
def make_node():
    """Return a function that makes a Listener, which nothing serves."""
    nodes = []
    with closing(Client()) as client:
        def make(*parameters):
            nodes.append(Listener('listener', client.context, SCENE_PARAMETERS, contact_qos(),
                                  parameter_overrides=parameters or SIZES))
            return nodes[-1]
        yield make
        for node in nodes:
            node.destroy_node()


def send(node, stamp, *poses_of_boxes):
    """Hand poses to a node, as their topics do; None for a box that sends nothing."""
    assert len(node.topics) == len(poses_of_boxes)
    for number, pose in enumerate(poses_of_boxes):
        if pose is not None:
            node._on_poses(number, serialize_message(pose_stamped(pose, 'yard', stamp)))


def test_sizes_beside_a_scene_are_refused(make_node):
    with pytest.raises(ValueError, match='^size_a .* has no effect while scene is set'):
        make_node(Parameter('scene', value='config/scenes/two_boxes.yaml'), *SIZES)


@pytest.mark.parametrize('answer_at', [0, 1, 2])
def test_contacts_are_drawn_with_the_poses_that_they_answer(make_node, answer_at):
    """Whichever message comes first; newer poses, and an older one of b, change nothing."""
    node = make_node()
    send(node, START - MS, None, TOUCHING)
    news = [lambda: send(node, START, ORIGIN, None), lambda: send(node, START + MS, APART, APART)]
    news.insert(answer_at, lambda: node._on_contacts(
        serialize_message(contacts_at(START, {PAIR: EXACT}))))
    for deliver in news:
        deliver()
    tick = node.tick()
    assert (tick.stamp, tick.frame_id) == (START, 'yard')
    assert np.array_equal(tick.poses, (ORIGIN, TOUCHING))
    for name in ('separation', 'normal', 'point', 'volume', 'covariance'):
        assert np.array_equal(getattr(tick.answer.contacts, name), [getattr(EXACT, name)])
    assert tick.latency > 0.0


def test_latency_is_the_time_from_the_stamp_to_the_contacts(make_node):
    node = make_node()
    stamp = node.get_clock().now().nanoseconds - 3 * MS
    send(node, stamp, ORIGIN, TOUCHING)
    node._on_contacts(serialize_message(contacts_at(stamp, {PAIR: EXACT})))
    assert 3e-3 <= node.tick().latency < 1.0


def test_no_contact_stays_where_nobody_answers(make_node, monkeypatch):
    """A contact does not stay in the air while the boxes move on; and silence is told."""
    node = make_node()
    assert node.tick() is None and node.quiet
    send(node, START, ORIGIN, TOUCHING)
    node._on_contacts(serialize_message(contacts_at(START, {PAIR: EXACT})))
    monkeypatch.setattr(listener, 'UNANSWERED', 0.01)
    send(node, START + MS, ORIGIN, APART)
    time.sleep(0.02)
    tick = node.tick()
    assert tick.answer is None and math.isnan(tick.latency)
    assert tick.stamp == START + MS and np.array_equal(tick.poses, (ORIGIN, APART))
    assert not node.quiet
    monkeypatch.setattr(listener, 'QUIET', 0.01)
    assert node.quiet


def test_time_that_goes_back(make_node):
    """A simulation that begins anew is drawn with its own poses."""
    node = make_node()
    for stamp, pose in ((START, APART), (START - 10 * NANOSECONDS, TOUCHING)):
        send(node, stamp, ORIGIN, pose)
        node._on_contacts(serialize_message(contacts_at(stamp, {})))
        assert np.array_equal(node.tick().poses, (ORIGIN, pose))


def test_boxes_that_a_message_lacks_stay_where_they_were(make_node, tmp_path):
    """One that is not named, and a quaternion of length zero."""
    (tmp_path / 'scene.yaml').write_text(
        'poses: named\npairs: [{a: a, b: b}, {a: c, b: d}]\nboxes:\n'
        + ''.join(f'  {name}: {{size: [2, 2, 2]}}\n' for name in 'abcd'))
    node = make_node(Parameter('scene', value=str(tmp_path / 'scene.yaml')))
    for stamp, rows in ((START, dict.fromkeys('abcd', ORIGIN)),
                        (START + MS, {'b': TOUCHING, 'a': ORIGIN, 'd': [0.0] * 7})):
        node._on_poses(0, serialize_message(joint_state(rows, 'yard', stamp)))
    assert np.array_equal(node.tick().poses, [ORIGIN, TOUCHING, ORIGIN, ORIGIN])


def test_a_body_carries_its_boxes(make_node, tmp_path):
    """Half a turn about z, and the box beside the body's middle is on the other side."""
    (tmp_path / 'scene.yaml').write_text(
        'pairs: [{a: a, b: b}]\nboxes: {a: {size: [2, 2, 2]}}\n'
        'bodies: {b: {boxes: {left: {size: [1, 1, 1]}, right: {size: [1, 1, 1], pose: '
        '[3, 0, 0, 0, 0, 0, 1]}}}}\n')
    node = make_node(Parameter('scene', value=str(tmp_path / 'scene.yaml')))
    send(node, START, ORIGIN, np.array([10.0, 0, 0, 0, 0, 1, 0]))
    poses_of = node.tick().poses
    assert poses_of.shape == (3, 7)
    assert np.allclose(poses_of[:, :3], [[0, 0, 0], [10, 0, 0], [7, 0, 0]])


def test_poses_come_while_they_are_looked_up():
    """The page reads in one thread what the node hears in another."""
    track, pose = Track(), np.zeros((1, 7))
    ended = threading.Event()

    def hear() -> None:
        for stamp in range(20_000):
            track.append(stamp, pose)
        ended.set()

    track.append(0, pose)
    thread = threading.Thread(target=hear)
    thread.start()
    while not ended.is_set():
        assert track.at(-1) is not None
    thread.join()


def test_contacts_of_another_scene_are_refused():
    for message in (contacts_at(1, {Pair.between('a', 'c'): EXACT}), contacts_at(1, {}, ['a_c'])):
        with pytest.raises(MessageError, match="'a_c' is no pair of the scene"):
            read_sorted(read(message), BOTH)


def test_the_deepest_contact_comes_first():
    """And the nearest of the pairs that are near; a model without a patch gives NaN."""
    pairs = tuple(Pair.between('a', b) for b in 'bcd')
    scene = Scene({name: Box(CUBE, pose_topic=name) for name in 'abcd'}, pairs)
    nothing = changed(EXACT, volume=math.nan, covariance=np.full((3, 3), math.nan))
    apart = [Nearest(False, distance, *np.eye(3)) for distance in (0.2, 0.1)]
    message = contacts_at(1, {pairs[0]: EXACT, pairs[1]: changed(nothing, separation=-1.0)}, (),
                          dict(zip(pairs[1:], apart)))
    answer = read_sorted(read(message), scene)
    assert answer.pairs.tolist() == [[0, 2], [0, 1]]
    assert answer.contacts.separation.tolist() == [-1.0, -0.125]
    assert np.isnan(answer.contacts.volume).tolist() == [True, False]
    assert answer.near_pairs.tolist() == [[0, 3], [0, 2]]
    assert answer.near.distance.tolist() == [0.1, 0.2]


@pytest.fixture
def view_node():
    """With a page, over DDS."""
    with serving(lambda context: ViewNode(context, parameter_overrides=SIZES)) as node:
        yield node


def test_the_force_is_that_of_the_tick(view_node):
    """No force of a landing that is over."""
    message = WrenchStamped(header=make_header(START, 'yard'))
    message.wrench.force.z = 196e3
    view_node._on_force(message)
    assert view_node.force(START + 20 * MS) == 196e3
    assert math.isnan(view_node.force(START + NANOSECONDS))


def test_ropes_are_lines_of_numbers(view_node):
    """Others are left out: one end alone, and what is not finite."""
    ends = [Point(z=15.0), Point(x=1.0, z=2.0)]
    for points in (ends, ends[:1], [ends[0], Point(x=math.nan)]):
        view_node._on_ropes(Marker(type=Marker.LINE_LIST, points=points))
        assert view_node._ropes.tolist() == [[[0, 0, 15], [1, 0, 2]]]


def test_the_model_is_that_of_the_contact_node(view_node):
    for name, model in (('contact_node', 'exact'), ('soup_node', 'soup')):
        view_node._on_diagnostics(DiagnosticArray(status=[DiagnosticStatus(
            name=f'/{name}: contacts', values=[KeyValue(key='model', value=model)])]))
    assert view_node.model == 'exact'


def test_it_hears_a_contact_node(view_node):
    """Over DDS: poses, contacts, and which model answers."""
    with serving(lambda context: ContactNode(context, parameter_overrides=[
            *SIZES, Parameter('model', value='exact')])), closing(Client()) as client:
        client.offer_until_answered(ORIGIN, TOUCHING)
        deadline = time.monotonic() + PATIENCE  # the view has to have matched too
        while not ((tick := view_node.tick()) and tick.answer and view_node.model):
            assert time.monotonic() < deadline, 'nothing heard'
            client.ask(ORIGIN, TOUCHING)
        assert np.array_equal(tick.answer.contacts.point, [EXACT.point])
        assert view_node.model == 'exact'


# --- what is drawn and said -----------------------------------------------------------------------


@pytest.mark.parametrize('turn', [(0, 0, 0, 1), (0.1, -0.5, 0.3, 0.8)])
def test_the_rectangle_of_a_patch(turn):
    """A patch l × w has its own sides, however the boxes lie."""
    length, width = 1.75, 1.5
    turned = rotation_matrix(turn)
    contact = ContactSolver(CUBE, CUBE, model='exact')(
        (0, 0, 0, *turn), (*turned @ [0.5, 0.25, 1.875], *turn))
    axes, = patch_axes(contact.normal[None], contact.covariance[None])
    for found, wanted in zip(axes, (turned @ (0, length / 2, 0), turned @ (width / 2, 0, 0)),
                             strict=True):
        assert found * np.sign(found @ wanted) == pytest.approx(wanted, abs=1e-12)
    ends = patch_sides(np.zeros((1, 3)), contact.normal[None], contact.covariance[None])
    corners = ends[:, 0] @ turned  # in the boxes' frame
    assert np.abs(corners) == pytest.approx(np.tile([width / 2, length / 2, 0.0], (4, 1)),
                                            abs=1e-12)
    assert len(np.unique(np.sign(corners[:, :2]), axis=0)) == 4
    assert np.roll(ends[:, 1], 1, axis=0) == pytest.approx(ends[:, 0], abs=1e-12)


def test_the_rectangle_of_a_line_of_a_point_and_of_no_patch():
    """Variances of zero, or below by rounding, have no width; NaN has no rectangle."""
    down = np.tile([0.0, 0.0, -1.0], (3, 1))
    line, point = np.diag([3.0, -1e-17, 1e-20]), -1e-17 * np.eye(3)
    covariances = np.array([line, point, np.full((3, 3), math.nan)])
    axes = patch_axes(down, covariances)
    assert np.abs(axes[0, 0]) == pytest.approx([3.0, 0.0, 0.0])
    assert not axes[0, 1].any() and not axes[1].any() and np.isnan(axes[2]).all()
    assert len(patch_sides(np.zeros((3, 3)), down, covariances)) == 2 * 4


@pytest.mark.parametrize('aspect', [0.5, 530 / 600, 16 / 9, 4.0])
@pytest.mark.parametrize('extents', [(12.2, 2.4, 5.2), (1.0, 1.0, 30.0), (60.0, 40.0, 10.0)])
def test_all_corners_are_in_view_whatever_its_shape(aspect, extents):
    fov, corners = math.radians(75.0), CUBE_CORNERS * extents
    camera = camera_position(0.5 * float(np.linalg.norm(extents)), fov, aspect)
    back = camera / np.linalg.norm(camera)
    right = np.cross([0.0, 0.0, 1.0], back) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], back))
    depth = np.linalg.norm(camera) - corners @ back
    tangent = math.tan(0.5 * fov)
    shares = np.abs([corners @ right / (aspect * tangent), corners @ np.cross(back, right)
                     / tangent]) / depth
    assert depth.min() > 0.0 and 0.2 < shares.max() < 1.0


def tick_of(stamp, pose_b, contacts):
    """Return a tick of two boxes with contacts by pair, box a at the origin."""
    return DrawnTick(ROWS, stamp, 'yard', np.array([ORIGIN, pose_b], dtype=float),
                     read_sorted(read(contacts_at(stamp, contacts)), BOTH), 2e-3)


def shown(text):
    """Return what figures show, by name."""
    return dict(re.findall(r'id="(\w+)"[^>]*>(.*?)</', text))


def test_figures_are_those_of_the_tick():
    found = shown(figures(tick_of(START, TOUCHING, {PAIR: EXACT}), 196.2e3, model='exact'))
    assert found == {'verdict': 'contact, 125.00 mm deep', 'model': 'exact', 'volume': '328 L',
                     'force': '196.2 kN', 'latency': '2.00 ms'}


def test_no_figure_is_made_up():
    """Without contact, without an answer, and without poses."""
    apart = tick_of(START, APART, {})
    found = shown(figures(apart, math.nan, model='exact'))
    assert (found['verdict'], found['volume'], found['force']) == ('no contact', '0 L', '–')
    near = {PAIR: Nearest(False, 0.125, (0, 0, 1), (0, 0, 1), (0, 0, 1.125))}
    answer = read_sorted(read(contacts_at(START, {}, near=near)), BOTH)
    assert shown(figures(replace(apart, answer=answer), math.nan, model=''))['verdict'] == (
        'no contact, 0.125 m apart')
    alone = replace(apart, answer=None, latency=math.nan)
    found = shown(figures(alone, math.nan, model=''))
    assert found['verdict'] == 'poses come, but no contacts'
    assert {found[name] for name in ('model', 'volume', 'latency')} == {'–'}
    assert shown(figures(None, math.nan, model='')) == {
        'verdict': 'waiting for poses', 'model': '–'}


def test_between_two_landings_the_heading_tells_what_comes(view_node, monkeypatch):
    """A crane's ropes were seen: it lands again. Other poses may never come."""
    headings = []
    monkeypatch.setattr(view_node._page, 'show', lambda tick, force, *, model, lands_again:
                        headings.append(shown(figures(tick, force, model=model,
                                                      lands_again=lands_again))['verdict']))
    for ends in ([], [Point(z=15.0), Point(x=1.0, z=2.0)]):
        view_node._on_ropes(Marker(type=Marker.LINE_LIST, points=ends))
        view_node._figures_at = 0.0
        view_node._draw()
    assert [headings[0], headings[-1]] == ['waiting for poses', 'next landing']


def test_the_legend_names_the_boxes():
    """Each in its colour, three at most; a name is text."""
    assert [f'rgb{colour}">■</span>&nbsp;{name} ' in legend(ROWS)
            for colour, name in ((BOX_A, 'box_a'), (BOX_B, 'box_b'))] == [True, True]
    boxes = {name: Box(CUBE, pose_topic='p') for name in ('<b>', 'l1', 'l2', 'l3', 'l4', 'stack')}
    pairs = tuple(Pair.between(name, 'stack') for name in boxes if name != 'stack')
    text = legend(SceneRows(Scene(boxes, pairs)))
    assert '&lt;b&gt;, l1, l2 and 2 more' in text and '&nbsp;stack ' in text
    assert 'near' not in text and 'near: distance' in legend(ROWS, near=True)


def test_a_late_force_is_that_of_the_chart():
    """It was a dash beside a chart with its last value."""
    with closing(Page('127.0.0.1', 8450, ROWS)) as page:
        for step, force in enumerate((math.nan, 196.2e3, math.nan)):
            page.show(tick_of(START + step, TOUCHING, {PAIR: EXACT}), force, model='exact')
            assert shown(page._figures.content)['force'] == ('196.2 kN' if step else '–')


@pytest.mark.parametrize(('volume', 'words'), [
    (4e-5, '0.04 L'), (0.9994, '999 L'), (0.9996, '1 m³'), (81.24, '81.2 m³'),
    (12345.6, '12,346 m³')])
def test_large_volumes_are_in_cubic_metres(volume, words):
    tick = tick_of(START, TOUCHING, {PAIR: changed(EXACT, volume=volume)})
    assert shown(figures(tick, math.nan, model='exact'))['volume'] == words


def test_the_name_of_a_model_is_text():
    text = figures(None, math.nan, model='<script>')
    assert '<script>' not in text and '&lt;script&gt;' in text


# --- the program ----------------------------------------------------------------------------------


def test_the_program_tells_its_address_and_ends(program):
    running = program('view', '--ros-args', '-p', 'scene:=config/scenes/yard_bay.yaml')
    running.wait_for_output('view: open http://127.0.0.1:')
    running.signal(signal.SIGINT)
    assert running.wait() == 0, running.output


@pytest.mark.parametrize('parameter, words', [
    ('host:=192.0.2.1', 'error: host 192.0.2.1: '),  # an address of nobody
    ('scene:=no_such_scene', 'no_such_scene')])
def test_what_it_cannot_start_with_ends_it(program, parameter, words):
    running = program('view', '--ros-args', '-p', parameter)
    assert running.wait() == 1
    assert words in running.output and 'Traceback' not in running.output


# --- the page -------------------------------------------------------------------------------------


@pytest.fixture
def page():
    with closing(Page('127.0.0.1', 8450, ROWS)) as page:
        yield page


def bring(page, tick, force=math.nan, model='exact'):
    page.draw(tick)
    page.show(tick, force, model=model)


def test_charts_begin_anew_with_a_landing(page, monkeypatch):
    """Where time goes back, and after the page has waited for poses."""
    plotted = []
    monkeypatch.setattr(page, '_plot', lambda label, least, times, values, **_: plotted.append(
        values.tolist()))
    bring(page, tick_of(START + 5 * NANOSECONDS, APART, {}), 0.0)
    for begin in (START, START + NANOSECONDS):
        for stamp in (begin, begin + 100 * MS):
            bring(page, tick_of(stamp, TOUCHING, {PAIR: EXACT}), 200e3)
        page.show(None, math.nan, model='exact')
    assert plotted == [[200.0] * 2, [125.0] * 2] * 2


OPTIONS = {'subprotocols': [f'viser-v{viser.__version__}'], 'max_size': None, 'proxy': None}


def test_no_browser_opens_a_public_tunnel(page, monkeypatch):
    """Nor does garbage that it sends end the page."""
    tunnels = []
    monkeypatch.setattr('viser._viser.ViserTunnel', lambda *target: tunnels.append(target))
    for message in (b'\xff' * 100, msgspec.msgpack.encode({'type': 'ShareUrlRequest'})):
        with connect(page.url.replace('http', 'ws'), **OPTIONS) as client:
            client.send(message)
            bring(page, tick_of(START, TOUCHING, {PAIR: EXACT}))
            assert client.recv(PATIENCE)
    assert tunnels == []


SITE = 'http://box-contact.example:8450'


def status_of(page, headers, upgrade=('websocket',)):
    """Return the status of a request under headers: for the WebSocket, or for the page itself."""
    with closing(HTTPConnection(page.url.removeprefix('http://'), timeout=PATIENCE)) as client:
        client.putrequest('GET', '/', skip_host=True)
        fixed = {'Connection': 'Upgrade', 'Sec-WebSocket-Version': 13,
                 'Sec-WebSocket-Key': 'AAAAAAAAAAAAAAAAAAAAAA=='}
        for name, value in [*fixed.items(), *(('Upgrade', name) for name in upgrade), *headers]:
            client.putheader(name, value)
        client.endheaders()
        return client.getresponse().status


@pytest.mark.parametrize(('host', 'origin', 'served'), [
    ('{own}', 'http://{own}', True), ('{own}', SITE, False),
    ('{own}', 'null', False),  # of a file, or of a frame without rights
    ('box-contact.example:8450', SITE, False),  # a site whose name leads here
    ('localhost:9000', 'http://localhost:9000', True),  # through a tunnel
    ('{own}', 'http://localhost:8450', False), ('[::1', '', False), ('{own}', '', True),
    ('', '', True), ('', SITE, False)])
def test_no_page_of_another_site_reads_the_view(page, host, origin, served):
    """Origin and Host are the page's own, or absent."""
    own = page.url.removeprefix('http://')
    headers = [(name, value.format(own=own))
               for name, value in (('Host', host), ('Origin', origin)) if value]
    assert status_of(page, headers) == (101 if served else 403)
    assert status_of(page, headers, upgrade=()) == (200 if served else 403)
    assert status_of(page, [*headers, ('Origin', SITE)]) == 403  # one of two


def test_a_message_of_9_kb_ends_its_connection_alone(page):
    with connect(page.url.replace('http', 'ws'), **OPTIONS) as other:
        with connect(page.url.replace('http', 'ws'), **OPTIONS) as client:
            client.send(msgspec.msgpack.encode([None] * 9_000))
            with pytest.raises(ConnectionClosedError, match='1009'):
                while client.recv(PATIENCE):
                    pass
        bring(page, tick_of(START, TOUCHING, {PAIR: EXACT}))
        assert other.recv(PATIENCE)


def test_the_33rd_page_is_refused_until_one_is_closed(page):
    headers = [('Host', page.url.removeprefix('http://'))]
    with ExitStack() as opened:
        pages = [opened.enter_context(connect(page.url.replace('http', 'ws'), **OPTIONS))
                 for _ in range(32)]
        assert status_of(page, headers) == status_of(page, headers, upgrade=()) == 503
        pages[0].close()
        deadline = time.monotonic() + PATIENCE
        while status_of(page, headers, upgrade=()) != 200:
            assert time.monotonic() < deadline


def test_a_viser_that_serves_in_another_way_does_not_start(monkeypatch):
    """Its page would be open to every site."""
    monkeypatch.setattr('viser.ViserServer.__init__', lambda *arguments, **options: None)
    with pytest.raises(RuntimeError, match='this viser does not serve by websockets'):
        Server('127.0.0.1', 8450)


in_browser = pytest.mark.skipif(chromium() is None,
                                reason='no Chromium here: apt-get install chromium')


def near(picture, colour):
    """Return which pixels have the hue of a colour, however light or dark it got."""
    hue = np.array(colour, float) - np.mean(colour)
    offset = picture - picture.mean(axis=-1, keepdims=True)
    saturation = np.linalg.norm(offset, axis=-1)
    aligned = offset @ hue / np.linalg.norm(hue)
    return (saturation > 25) & (aligned > 0.9 * saturation)


def wait_for_drawing(tab, least, *, boxes=0.0):
    """Wait until the colours of contact and boxes have so much of a picture; return the picture."""
    deadline = time.monotonic() + PATIENCE
    while True:
        picture = np.array(Image.open(io.BytesIO(tab.picture())).convert('RGB'), float)
        shares = [near(picture, colour).mean() for colour in (BOX_A, BOX_B, CONTACT)]
        if min(shares) > least and min(shares[:2]) > boxes:
            return picture
        assert time.monotonic() < deadline, shares


def has_ropes(picture, width):
    """Return whether the sky above the boxes, in so many columns, has pixels as dark as ropes."""
    return (picture[5:60, :width].mean(axis=2) < 120.0).any()


CHARTS = 'Object.values(window.__viserTestpoints?.uplots ?? {}).map(one => one.chart)'
LAST = f'{CHARTS}.map(c => c.data[1].at(-1)).sort()'
LABELS = (f'{CHARTS}.every(c => c.axes.every(a => !a.show || a._splits?.length > 1) '
          '&& c.scales.x.max == 0)')


NARROW_WINDOW = 800  # [px]


@in_browser
@pytest.mark.parametrize('width', [NARROW_WINDOW, 1280])
def test_the_page_in_a_browser(page, width):
    """Load and stack are whole in the first view; figures and charts are of the same tick."""
    with open_page(page.url, width) as tab:
        for number in range(20):
            bring(page, tick_of(START + number * 100 * MS, TOUCHING, {PAIR: EXACT}), 196.2e3)
            time.sleep(0.05)
        tab.wait_for('document.getElementById("verdict")?.innerText == "contact, 125.00 mm deep"')
        assert tab.wait_for(f'{CHARTS}.length == 2 && {LAST}') == pytest.approx([125, 196.2])
        tab.wait_for(f'{LABELS} && {CHARTS}.every(c => Math.abs(c.scales.x.min + 1.9) < 0.01)')
        canvas = tab.evaluate('document.querySelector("canvas").clientWidth')
        assert 0.55 * width < canvas <= width - 300
        tab.evaluate('document.querySelector(".mantine-Notification-closeButton")?.click()')
        assert tab.evaluate('document.title') == 'Contacts of boxes: box_contact_ros'
        assert tab.evaluate(f'{CHARTS}.map(c => c.axes[0].show)') == [False, True]  # one for both
        ends = [tab.evaluate(f'{CHARTS}.map(c => c.valToPos(c.scales.x.{end}, "x"))')
                for end in ('min', 'max')]
        assert all(force == depth for force, depth in ends)
        picture = wait_for_drawing(tab, 1e-3, boxes=0.03)  # edges come before faces
        for colour in (BOX_A, BOX_B):
            is_box = near(picture[:, :canvas], colour)
            rows, columns = np.nonzero(is_box)
            assert rows.min() > 5 and rows.max() < len(picture) - 6
            assert columns.min() > 5 and columns.max() < canvas - 6
            # Light meets all upright faces alike: no step or shade crosses one, dark on one side.
            # Row by row, as sky and ground show through.
            shades = np.where(is_box, picture[:, :canvas].mean(axis=2), np.nan)[np.unique(rows)]
            off = np.abs(shades - np.nanmedian(shades, axis=1, keepdims=True))
            assert (off[is_box[np.unique(rows)]] < 6.0).mean() > 0.7
        if width == NARROW_WINDOW:
            return  # what follows does not depend on the width
        assert not has_ropes(picture, canvas)
        ropes = np.array([[(x, 0.0, 3.0), (x, 0.0, 15.0)] for x in (-0.5, 0.5)])
        page.draw(tick_of(START + 2 * NANOSECONDS, TOUCHING, {PAIR: EXACT}), ropes)
        deadline = time.monotonic() + PATIENCE
        while not has_ropes(wait_for_drawing(tab, 1e-3), canvas):
            assert time.monotonic() < deadline
        bring(page, tick_of(START + 5 * NANOSECONDS, APART, {}), 0.0)
        found = tab.wait_for('document.getElementById("verdict").innerText == "no contact" && '
                             f'[document.getElementById("force").innerText, ...{LAST}]')
        assert found == ['0.0 kN', 0, 0]
        page.show(None, math.nan, model='exact')
        tab.wait_for('document.getElementById("verdict").innerText == "waiting for poses"')


@in_browser
def test_two_hundred_boxes_in_a_browser():
    """All are drawn, in map coordinates too, and all contacts."""
    places = np.array([(5e5 + 5.0 * (n % 10), 4e6 + 5.0 * (n // 10)) for n in range(100)])
    boxes = {f'load_{n}': Box(CUBE, pose_topic=f'load_{n}/pose') for n in range(100)}
    boxes |= {f's{n}': Box(CUBE, (*place, 0, 0, 0, 0, 1))
              for n, place in enumerate(places)}
    pairs = tuple(Pair.between(f'load_{n}', f's{n}') for n in range(100))
    scene = Scene(boxes, pairs)
    placed = np.array([(*place, 1.9, 0, 0, 0, 1) for place in places])
    solver = ContactSolver(CUBE, CUBE, model='exact')
    rows = SceneRows(scene)
    contacts = {pair: solver(pose, boxes[pair.b].pose) for pair, pose in zip(pairs[:99], placed)}
    message = contacts_at(START, contacts, [pairs[99].label])
    with closing(Page('127.0.0.1', 8450, rows)) as page, open_page(page.url, 640, 360) as tab:
        known = np.where(np.isnan(rows.poses), np.r_[placed, placed], rows.poses)
        answer = read_sorted(read(message), scene)
        bring(page, DrawnTick(rows, START, 'yard', known, answer, 1e-3))
        tab.wait_for('document.getElementById("pairs")?.innerText == "99 of 100"')
        assert tab.text('stale') == '1'
        wait_for_drawing(tab, 5e-4)


@in_browser
def test_boxes_that_come_and_go_in_a_browser():
    """The page draws the boxes of the newest scene, as ~/set_boxes makes it, and no others."""
    stack = Box(CUBE, ORIGIN)
    both = Scene({'crane': Box(CUBE), 'stack': stack}, patterns=(('crane', 'stack*'),),
                 poses='named')
    crane_alone, _ = both.changed({'stack': None}, {})
    with (closing(Page('127.0.0.1', 8450, SceneRows(crane_alone))) as page,
          open_page(page.url, 640, 360) as tab):
        tab.wait_for('document.querySelector("canvas") != null')
        again, _ = crane_alone.changed({'stack2': stack}, {})
        for scene in (crane_alone, both, crane_alone, again):
            rows, deadline = SceneRows(scene), time.monotonic() + PATIENCE
            placed = np.where(np.isnan(rows.poses), (0, 0, 3, 0, 0, 0, 1), rows.poses)
            shares = [0.0, 0.0]  # of crane and stack
            while shares[0] < 1e-3 or (shares[1] > 1e-3) != (len(rows.sizes) == 2):
                assert time.monotonic() < deadline, (scene.names, shares)
                bring(page, DrawnTick(rows, START, 'yard', placed, None, math.nan))
                picture = np.array(Image.open(io.BytesIO(tab.picture())).convert('RGB'), float)
                shares = [near(picture, colour).mean() for colour in (BOX_A, BOX_B)]


@in_browser
def test_a_landing_in_a_browser(program):
    """Until the stack carries the load, by the model that was asked for.

    The browser renders in software and takes all cores.
    """
    running = program('demo.demo', '--view', '--model', 'mlp')
    url = re.search(r'http://127\.0\.0\.1:\d+', running.wait_for_output('view: open http')).group()
    with open_page(url, 640, 360) as tab:
        verdict = 'document.getElementById("verdict")?.innerText'
        try:
            for words in ('no contact', 'contact, '):
                tab.wait_for(f'{verdict}?.startsWith({words!r})')
        except AssertionError as error:  # the crane prints why
            raise AssertionError(f'{error}\nprinted:\n{running.output}') from error
        assert tab.text('model') == 'mlp'
        wait_for_drawing(tab, 1e-3)
        tab.wait_for('parseFloat(document.getElementById("force")?.innerText) > 150')
        tab.wait_for(LABELS)
