# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench as a whole: real processes, short runs, and faults planted between node and bench."""
from __future__ import annotations

import csv
import os
import signal
from pathlib import Path

import pytest
from geometry_msgs.msg import PointStamped, Vector3Stamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from ros_client import Client, serving

from box_contact_ros.demo.ros_client import ANSWERS

DEEP = QoSProfile(depth=1000)
PATIENCE = 240.0  # s


def bench(program, out: Path, *arguments: str):
    """Start a bench in the tests' own domain, where the test can listen."""
    options, *ros = ' '.join(arguments).split(' --ros-args ')
    return program('bench', *options.split(), '--domain', os.environ['ROS_DOMAIN_ID'], '--out',
                   str(out), *(word for text in ros for word in ('--ros-args', *text.split())))


def rows_of(out: Path) -> dict[tuple[str, str], dict[str, str]]:
    """Return the CSV by (stream, node)."""
    with (out / 'bench.csv').open() as file:
        return {(row['stream'], row['node']): row for row in csv.DictReader(file)}


def test_a_short_run(program, tmp_path):
    """All three nodes, cubes and containers: everything sent is answered, and written down."""
    out = tmp_path / 'results'
    running = bench(program, out, '--quick --duration 3 --model exact --divisions 4 '
                                  '--streams coplanar separated crane')
    status = running.wait(PATIENCE)
    assert status == 0, running.output
    assert 'sent = answered + lost: yes' in running.output
    rows = rows_of(out)
    assert list(rows) == [(stream, node) for stream in ('coplanar', 'separated', 'crane')
                          for node in ('contact', 'soup', 'echo')]
    for (stream, node), row in rows.items():
        sent, answered, lost = (int(row[name]) for name in ('sent', 'answered', 'lost'))
        # 200 Hz for half a second of each of the streams, split over three nodes.
        assert sent == 33
        assert sent == answered + lost
        assert lost == 0 or node == 'soup'
        assert 0.0 < float(row['latency_min [s]']) <= float(row['latency_p50 [s]'])
        assert (float(row['latency_p50 [s]']) <= float(row['latency_p999 [s]'])
                <= float(row['latency_max [s]']))
        if node == 'contact':
            assert row['model'] == 'exact' and row['wrong_verdicts'] == '0'
            assert row['point_error_max [m]'] in ('0', '') and row['contradictions'] == '0'
            contacts = int(row['contacts'])
            assert {'coplanar': contacts == 33, 'separated': contacts == 0,
                    'crane': 3 < contacts < 30}[stream]
    assert (out / 'bench.png').read_bytes().startswith(b'\x89PNG')
    page = (out / 'bench.md').read_text('utf-8')
    assert '| std dev |' in page and '- machine: ' in page


class FaultyRelay(Node):
    """Stands between the contact node and the bench, and plants a fault of each kind, once.

    A shorter stream than 300 messages never gets to the faults; the bench's offers and its warm-up
    are 101 pairs or some more.
    """

    def __init__(self, context: Context) -> None:
        super().__init__('faulty_relay', context=context)
        self._counts: dict[str, int] = {}
        for kind, topic in ((PointStamped, 'contact/point'), (Vector3Stamped, 'contact/normal'),
                            ANSWERS['cloud']):
            publisher = self.create_publisher(kind, f'relayed/{topic}', DEEP)
            self.create_subscription(kind, topic, self._pass_on(topic, publisher), DEEP)

    def _pass_on(self, topic, publisher):
        def callback(message):
            count = self._counts[topic] = self._counts.get(topic, 0) + 1
            fault = (topic, count)
            if fault == ('contact/point', 300):
                return  # dropped
            if fault == ('contact/point', 310):
                message.point.x += 0.01
            if fault == ('contact/normal', 320):
                vector = message.vector
                vector.x, vector.y, vector.z = -vector.x, -vector.y, -vector.z
            publisher.publish(message)
            if fault == (ANSWERS['cloud'][1], 330):
                publisher.publish(message)
        return callback


def test_planted_faults_show_up(program, tmp_path):
    """Each fault planted in 400 answers is in the results, and the exit status is not 0.

    One point is dropped, one shifted by 1 cm, one normal flipped, one cloud sent twice.
    """
    out, contacts = tmp_path / 'results', ANSWERS['cloud'][1]
    with serving(FaultyRelay):
        running = bench(
            program, out, '--duration 2 --nodes contact --model exact --streams random --ros-args '
            '-r contact/point:=relayed/contact/point -r contact/normal:=relayed/contact/normal '
            f'-r {contacts}:=relayed/{contacts}')
        assert running.wait(PATIENCE) == 1, running.output
    row = rows_of(out)['random', 'contact']
    counts = {name: int(row[name]) for name in (
        'sent', 'answered', 'lost', 'lost_contacts', 'duplicates', 'contradictions',
        'wrong_verdicts', 'strangers')}
    assert counts == {'sent': 400, 'answered': 399, 'lost': 1, 'lost_contacts': 1, 'duplicates': 1,
                      'contradictions': 2, 'wrong_verdicts': 0, 'strangers': 0}
    assert float(row['point_error_max [m]']) == pytest.approx(0.01, rel=1e-9)
    assert float(row['point_error_median [m]']) == 0.0
    assert float(row['normal_error_max [deg]']) == pytest.approx(180.0)
    assert float(row['normal_error_median [deg]']) == 0.0
    assert '1 lost, 1 duplicates, 2 contradictions' in running.output


def test_a_node_that_does_not_start_is_reported(program, tmp_path):
    """A model that knows no containers: said in its own words, the others are measured."""
    running = bench(program, tmp_path, '--quick --nodes contact echo --model paper-continuous '
                                       '--streams crane')
    assert running.wait(PATIENCE) == 1
    assert 'contact ended with status 1: error: ' in running.output
    assert 'Traceback' not in running.output
    assert list(rows_of(tmp_path)) == [('crane', 'echo')]


def test_called_off(program, tmp_path):
    """SIGINT in mid-stream: results so far, and every process that was started ends."""
    client = Client()
    try:
        running = bench(program, tmp_path, '--side-by-side --nodes contact echo --model exact '
                                           '--streams random')
        assert client.spin(lambda: len(client.clouds) > 300, PATIENCE), running.output
        running.signal(signal.SIGINT)
        assert running.wait() == 130, running.output
        gone = client.spin(lambda: not client.node.count_publishers('contacts'))
        assert gone, 'a contact node is left'
    finally:
        client.close()
    assert 'sent = answered + lost: yes' in running.output
    assert 'Traceback' not in running.output
    for row in rows_of(tmp_path).values():
        assert 100 < int(row['sent']) < 12_000 and row['lost'] == '0'


@pytest.mark.parametrize('arguments, words', [
    ('--rate 0', 'argument --rate: must lie in 1 to 4000'),
    ('--model exakt', "argument --model: model 'exakt' is not one of"),
    ('--streams randon', 'invalid choice'),
    ('--divisions 0', 'argument --divisions: must lie in'),
    ('--soak --boxes 64', 'argument --boxes: not allowed with argument --soak'),
])
def test_bad_options(program, arguments, words):
    running = program('bench', *arguments.split())
    assert running.wait(60) == 2
    assert words in running.output


def test_bad_ros_arguments_are_one_line(program):
    running = program('bench', '--quick', '--ros-args', '-r', 'no remapping')
    assert running.wait(60) == 1
    assert 'Traceback' not in running.output and 'error: ' in running.output


def test_pose_arrays(program):
    """A crowd in one message a tick: nothing lost, nothing wrong, and the figures are printed."""
    running = program('bench', *'--boxes 64 --rate 50 --duration 1 --model exact --domain'.split(),
                      os.environ['ROS_DOMAIN_ID'])
    assert running.wait(PATIENCE) == 0, running.output
    assert 'scene: 64 moving boxes, 252 pairs' in running.output
    assert 'sent: 50 at 50 Hz, 0 lost, 0 wrong' in running.output
    assert '% of one core' in running.output and 'latency [ms]: p50' in running.output
