# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attacks on the page and its log: by websites, by clients of the page, by nodes."""
from __future__ import annotations

import json
import math
import socket
import threading
import time
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

pytest.importorskip('viser')

import viser
from box_contact_ros.scene.files.scene_file import scene_text
from browser import chromium, open_page
from ros_client import PATIENCE, Client, serving
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray
from websockets.datastructures import Headers
from websockets.sync.client import connect

from box_contact_ros.node.messages import (
    CLOUD_ROW,
    NANOSECONDS,
    Refused,
    make_cloud,
    make_header,
    read_cloud,
)
from box_contact_ros.node.ros_client import MOST_ENDS, lines_of
from box_contact_ros.node.runtime import LATCHED_QOS, GuardedNode
from box_contact_ros.scene.scene_solver import Box, Pair, Scene, SceneSolver, two_boxes
from box_contact_ros.view import view_log
from box_contact_ros.view.listener import ASKED, ViewNode
from box_contact_ros.view.page.read_outs import (
    LONGEST,
    deepest_contacts,
    line,
    read_out,
    report,
)
from box_contact_ros.view.page.server import refusal
from box_contact_ros.view.page.view_page import Page
from box_contact_ros.view.view_log import ViewLog

PORT = 8500
PROTOCOL = f'viser-v{viser.__version__}'
SCRIPT = '<img src=x onerror="window.attacked=1">'
CUBE = (2.0, 2.0, 2.0)
ORIGIN, TOUCHING = np.array([0.0, 0, 0, 0, 0, 0, 1]), np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])
START = 1_000 * NANOSECONDS
END_SECONDS = 2.0
in_browser = pytest.mark.skipif(chromium() is None, reason='no Chromium here: apt install chromium')


@pytest.fixture
def page():
    page = Page('127.0.0.1', PORT)
    yield page
    page.close()


def show(page, **shown):
    page.show(None, None, **{'model': 'exact', 'wish': '', 'refusal': '', 'connected': True,
                             **shown})


def port_of(page):
    return int(page.url.rpartition(':')[2])


# --- the door -------------------------------------------------------------------------------------


def answer(page, hosts, origin, upgrade):
    """Return what the page answers to a request with these headers, {} for its port."""
    port = port_of(page)
    headers = [f'Host: {host.format(port)}' for host in hosts]
    headers += [f'Origin: {origin.format(port)}'] if origin else []
    if upgrade:
        headers += ['Upgrade: websocket', 'Connection: Upgrade', 'Sec-WebSocket-Version: 13',
                    'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==',
                    f'Sec-WebSocket-Protocol: {PROTOCOL}']
    with socket.create_connection(('127.0.0.1', port), PATIENCE) as connection:
        connection.sendall('\r\n'.join(['GET / HTTP/1.1', *headers, '', '']).encode())
        return connection.recv(4096).decode(errors='replace')


@pytest.mark.parametrize('upgrade', [False, True])
@pytest.mark.parametrize('host, origin', [
    ('127.0.0.1:{}', None), ('127.0.0.1:{}', 'http://127.0.0.1:{}'),
    ('localhost:{}', 'http://localhost:{}'), ('[::1]:{}', 'http://[::1]:{}'),
    ('localhost:9000', 'http://localhost:9000'),  # through a tunnel of ssh
    ('192.0.2.7:{}', 'http://192.0.2.7:{}')])
def test_its_own_browsers_are_let_in(page, host, origin, upgrade):
    assert answer(page, [host], origin, upgrade).startswith(
        f'HTTP/1.1 {101 if upgrade else 200} ')


@pytest.mark.parametrize('upgrade', [False, True])
@pytest.mark.parametrize('hosts, origin', [
    (['127.0.0.1:{}'], 'http://evil.example'), (['127.0.0.1:{}'], 'http://127.0.0.1:3000'),
    (['127.0.0.1:{}'], 'http://localhost:{}'), (['127.0.0.1:{}'], 'null'),
    (['evil.example:{}'], 'http://evil.example:{}'), (['evil.example:{}'], None),
    (['localhost.evil.example'], None), (['127.0.0.1.evil.example:{}'], None), (['[evil'], None),
    ([], None), (['127.0.0.1:{}', 'evil.example'], None)])
def test_foreign_websites_are_refused(page, hosts, origin, upgrade):
    """By Origin, and by Host where a website's name was made to lead here."""
    assert answer(page, hosts, origin, upgrade).startswith('HTTP/1.1 403 ')


@pytest.mark.parametrize('host, reason', [
    ('my-robot:8080', ''), ('My-Robot', ''), ('other-robot', 'open the page by its address')])
def test_a_name_that_was_given_is_let_in(host, reason):
    assert refusal(Headers(Host=host), 'my-robot').startswith(reason)
    assert bool(reason) == bool(refusal(Headers(Host=host), 'my-robot'))


def test_no_website_may_frame_it(page):
    assert "Content-Security-Policy: frame-ancestors 'none'" in answer(
        page, ['127.0.0.1:{}'], None, False)


@contextmanager
def website(content):
    """Serve a page of somebody else; its address."""
    class Website(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header('Content-Type', 'text/html')
            self.end_headers()
            self.wfile.write(content.encode())

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(('127.0.0.1', 0), Website)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f'http://127.0.0.1:{server.server_port}'
    finally:
        server.shutdown()
        server.server_close()


def opening(url):
    """Return the script that opens a page's websocket, and puts how it went into the title."""
    return (f'const s = new WebSocket({json.dumps(url.replace("http", "ws"))}, "{PROTOCOL}");'
            's.onopen = () => document.title = "open";'
            's.onerror = () => document.title = "refused";')


@pytest.mark.timeout(300)
@in_browser
def test_a_website_in_a_browser(page):
    """It gets no websocket; under a name that was made to lead here it gets nothing at all."""
    with website(f'<script>{opening(page.url)}</script>') as url, open_page(url) as tab:
        assert tab.wait_for('document.title') == 'refused'
    with open_page(f'http://evil.example:{port_of(page)}',
                   flags=['--host-resolver-rules=MAP evil.example 127.0.0.1']) as tab:
        tab.wait_for('document.body?.innerText.startsWith("refused: open the page by its address")')


# --- its clients ----------------------------------------------------------------------------------


@pytest.fixture
def tunnels(monkeypatch):
    """Return the public tunnels that are asked for; none is opened."""
    asked = []

    class Tunnel:
        def __init__(self, *target):
            asked.append(target)
            raise OSError('no tunnels in tests')

    monkeypatch.setattr('viser._viser.ViserTunnel', Tunnel)
    return asked


@pytest.mark.timeout(300)
@in_browser
def test_a_browser_gets_no_tunnel_and_no_script(page, tunnels):
    """Its own page may open websockets, and asks for a tunnel. A model's name is a script."""
    show(page, model=SCRIPT)
    with open_page(page.url) as tab:
        tab.wait_for(f'document.getElementById("model-status")?.innerText == "running: " + '
                     f'{json.dumps(SCRIPT)}', 200)
        assert not tab.evaluate('window.attacked || document.querySelector("[onerror]")')
        tab.evaluate(opening(page.url))
        tab.wait_for('document.title == "open"')
        # {'type': 'ShareUrlRequest'} in msgpack
        tab.evaluate('s.send(new Uint8Array([0x81, 0xa4, ..."type", 0xaf, ..."ShareUrlRequest"]'
                     '.map(c => c.charCodeAt ? c.charCodeAt() : c)))')
        time.sleep(1.0)
        assert tab.evaluate('s.readyState') == 1
    assert tunnels == []


def test_a_client_gets_no_tunnel(page, tunnels, capfd):
    """Whoever asks: nothing is opened, nothing printed, and the page goes on."""
    with connect(page.url.replace('http', 'ws'), subprotocols=[PROTOCOL], max_size=None,
                 proxy=None) as client:
        for name in ('ShareUrlRequest', 'ShareUrlDisconnect'):
            client.send(bytes([0x81, 0xa4]) + b'type' + bytes([0xa0 + len(name)]) + name.encode())
        assert client.recv(PATIENCE)
        time.sleep(1.0)
    assert tunnels == []
    assert ''.join(capfd.readouterr()) == ''


def test_clients_that_stand_still_do_not_hold_up_the_end():
    """One says nothing, one takes nothing that it is sent."""
    page = Page('127.0.0.1', PORT)
    with socket.create_connection(('127.0.0.1', port_of(page))), socket.create_connection(
            ('127.0.0.1', port_of(page))) as deaf:
        deaf.sendall(f'GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n'
                     'Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: '
                     f'dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: {PROTOCOL}\r\n\r\n'
                     .encode())
        assert deaf.recv(1) == b'H'
        page._status.content = 'long ' * 10_000_000
        time.sleep(1.0)
        start = time.monotonic()
        page.close()
        assert time.monotonic() - start < END_SECONDS


# --- what is said of names ------------------------------------------------------------------------


def test_everything_is_escaped():
    """Models and names of pairs, and what programs print."""
    names = [f'{SCRIPT}{number}' for number in range(3)]
    scene = Scene({name: Box(name, CUBE, pose_topic='x') for name in names},
                  (Pair(0, names[0], names[0], names[1]), Pair(1, SCRIPT, names[1], names[2])))
    log = ViewLog(scene)
    for name, pose in zip(names, (ORIGIN, TOUCHING, None)):
        if pose is not None:
            log.pose(name, START, pose)
    answer = SceneSolver(scene, model='exact')([ORIGIN, TOUCHING, None])
    log.contacts(START, read_cloud(make_cloud(make_header(START, SCRIPT), answer)), START, SCRIPT)
    figures = log.figures(START)
    for text in (read_out(log.snapshot(), figures, SCRIPT), deepest_contacts(log.snapshot()),
                 line('model-status', SCRIPT, bad=True), report(SCRIPT)):
        assert '&lt;img src=x onerror=&quot;' in text and '<img' not in text


def test_long_names_are_cut():
    assert len(line('model-status', 'long ' * 10_000_000, bad=True)) < 2 * LONGEST


# --- what nodes say -------------------------------------------------------------------------------


@pytest.fixture
def client():
    client = Client()
    yield client
    client.close()


def test_a_path_that_a_node_names_is_not_opened_here(client, tmp_path):
    """Not even for a scene that is there and good. The same scene as text is drawn."""
    boxes = {name: Box(name, CUBE, pose_topic=f'{name}/pose') for name in ('private', 'b')}
    text = scene_text(Scene(boxes, (Pair.between('private', 'b'),)))
    here = tmp_path / 'here.yaml'
    here.write_text(text)

    def impostor(context):
        node = GuardedNode('contact_node', context=context)
        values = ([1.0] * 3, [1.0] * 3, str(here), 'stamp', 0.0, 'exact')
        for name, value in zip(ASKED, values, strict=True):
            node.declare_parameter(name, value)
        return node

    with serving(impostor) as node, serving(
            lambda context: ViewNode(context, 'contact_node')) as view:
        assert client.spin(lambda: view.settings.get('scene') == str(here))
        client.spin(lambda: view.log is not None, 1.0)
        assert view.log is None and 'private' not in view.refusal
        told = node.create_publisher(String, '~/scene', LATCHED_QOS)
        told.publish(String(data='boxes: ['))
        assert client.spin(lambda: view.refusal.startswith('scene of the contact node:'))
        with pytest.raises(Refused, match='characters; at most'):
            view._on_scene(String(data=' ' * 2**21))
        told.publish(String(data=text))
        assert client.spin(lambda: view.log is not None and view.refusal == '')
        assert view.log.scene.names == ['private', 'b']


@pytest.fixture
def log():
    return ViewLog(two_boxes(CUBE, CUBE))


def rows(**changed):
    """Return the row of a good contact, with other numbers in some of its fields."""
    answer = SceneSolver(two_boxes(CUBE, CUBE), model='exact')([ORIGIN, TOUCHING])
    found = read_cloud(make_cloud(make_header(START, ''), answer))
    for name, value in changed.items():
        found[name] = value
    return found


@pytest.mark.parametrize('name', [name for name in CLOUD_ROW.names if name not in 'xyzpair'])
@pytest.mark.parametrize('value', [math.inf, -math.inf, math.nan, 1e300])
def test_contacts_that_none_can_be_are_refused(page, log, name, value):
    """And counted; what was drawn before stays. NaN is a patch that the model does not give."""
    log.pose('box_a', START, ORIGIN)
    log.pose('box_b', START, TOUCHING)
    log.contacts(START, rows(), START)
    patch = name == 'volume' or name.startswith('cov_')
    if math.isnan(value) and (patch or name in ('depth', 'point_x')):
        log.contacts(START, rows(**{name: value}), START)  # no patch, stale, close
    else:
        with pytest.raises(Refused, match=name):
            log.contacts(START, rows(**{name: value}), START)
    figures = log.figures(START)
    assert figures.refused == (figures.answered == 1)
    page.draw(log.snapshot(), np.zeros((0, 2, 3)))
    page.show(log.snapshot(), figures, model='', wish='', refusal='', connected=True)


def test_more_contacts_than_pairs_are_refused(log):
    with pytest.raises(Refused, match='2 contacts, but the scene has 1 pairs'):
        log.contacts(START, np.repeat(rows(), 2), START)


@pytest.mark.parametrize('stamp_of', [lambda number: START, lambda number: START - number,
                                      lambda number: START - number % 100 * 1000])
def test_a_log_does_not_grow_where_stamps_stand_still(log, monkeypatch, stamp_of):
    """Or where they move by less than what sets time back."""
    monkeypatch.setattr(view_log, 'KEPT', 50)
    monkeypatch.setattr(view_log, 'KEPT_ROWS', 60)
    log.start_anew()
    for number in range(300):
        for box, pose in (('box_a', ORIGIN), ('box_b', TOUCHING)):
            log.pose(box, stamp_of(number), pose)
        log.contacts(stamp_of(number), rows(), START)
    assert len(log._counts) <= 50
    assert max(map(len, log._tracks.values())) <= 50
    assert 1 <= len(log._answers) <= 20 and sum(one.rows for one in log._answers) == log._rows
    assert log.snapshot().answer is not None


@pytest.mark.parametrize('points', [
    [(0.0, 0.0, 0.0)], [(math.inf, 0.0, 0.0)] * 2, [(0.0, math.nan, 0.0)] * 2,
    [(0.0, 0.0, 0.0)] * (MOST_ENDS + 2)])
def test_lines_that_none_can_be_are_refused(points):
    marker = Marker(type=Marker.LINE_LIST)
    for point in points:
        x, y, z = point
        marker.points.append(type(marker.pose.position)(x=x, y=y, z=z))
    with pytest.raises(Refused):
        lines_of(MarkerArray(markers=[marker]))
