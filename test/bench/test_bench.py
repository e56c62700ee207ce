# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench as a whole: real processes, short runs, and faults planted between node and bench."""
from __future__ import annotations

import gc
import os
import re
import signal
import sys
from pathlib import Path

import pytest
from children import children
from geometry_msgs.msg import PointStamped, Vector3Stamped
from rclpy.context import Context
from rclpy.qos import QoSProfile

from box_contact_msgs.msg import Contacts
from box_contact_ros import extras
from box_contact_ros.bench import drive
from box_contact_ros.bench.bench import loops
from box_contact_ros.bench.bench import main as bench_main
from box_contact_ros.node.runtime import GuardedNode, running_node, spin_for

pytestmark = pytest.mark.reports

DEEP = QoSProfile(depth=1000)


def bench(program, *arguments: str):
    """Start a bench, where the test can listen."""
    options, *ros = ' '.join(arguments).split(' --ros-args ')
    return program('bench', *options.split(),
                   *(word for text in ros for word in ('--ros-args', *text.split())))


def rows_of(text: str) -> list[dict[str, str]]:
    """Return the rows of the table in a report."""
    head, _, *rows = ([cell.strip() for cell in line.strip('| ').split('|')]
                      for line in text.splitlines() if line.startswith('|'))
    return [dict(zip(head, row)) for row in rows]


def test_a_short_run(program, tmp_path):
    """All pairs are answered rightly; page and terminal tell the same; the picture comes first."""
    pytest.importorskip('fcl')
    pytest.importorskip('matplotlib')
    running = bench(program, f'--rate 100 --duration 3 --out {tmp_path}/made/b.md')
    status, page = running.wait(), tmp_path / 'made' / 'b.md'
    is_void = 'void' in running.output
    assert status == is_void, running.output  # on a machine that is too busy
    assert page.read_text().startswith(f'# Bench of `exact` at 100 Hz{", void" * is_void}\n\n'
                                       '![Latencies of each node](b.png)\n\n')
    assert page.with_suffix('.png').read_bytes().startswith(b'\x89PNG')
    assert page.read_text().partition('\n\n- model')[2] in running.output
    rows = rows_of(running.output)
    assert [row['node'] for row in rows] == ['echo', 'floor', 'contact', 'soup']
    for row in rows:
        assert (row['sent'], row['lost'], row['wrong']) == ('75', '0', '0')
        worst, of, count = row['worst [ms]'].split()
        assert 0.0 < float(row['p50 [ms]']) <= float(row['p99 [ms]']) <= float(worst)
        assert (of, count) == ('of', '75')
    assert rows[2]['worst point error [mm]'] == '0 of 75'  # the exact model, bit by bit
    number = r'(\d+\.\d\d)'
    compared = re.search(f'quiet: contact / echo {number} \\[{number}, {number}\\], p50 {number}, '
                         f'p99 {number}; contact / floor .*; soup / contact ', running.output)
    middle, low, high, *_ = map(float, compared.groups())
    assert low <= middle <= high


def test_loops_are_where_they_are_asked_for():
    """One on each core, of its priority, while the block lasts; none where all is quiet."""
    cores = os.sched_getaffinity(0)
    for surroundings, niceness in (('quiet', None), ('nice', 10), ('busy', 0)):
        with loops(surroundings, cores):
            found = [pid for pid in children(os.getpid())
                     if b'while True' in Path(f'/proc/{pid}/cmdline').read_bytes()]
            assert [os.getpriority(os.PRIO_PROCESS, pid) for pid in found] == (
                [] if niceness is None else [niceness] * len(cores))
            assert sorted(core for pid in found for core in os.sched_getaffinity(pid)) == (
                sorted(cores) if found else [])
        assert not any(Path(f'/proc/{pid}').exists() for pid in found)


def test_a_row_for_each_surroundings(program):
    running = bench(program,
                    '--rate 50 --duration 2 --nodes contact floor echo --beside quiet nice')
    running.wait()
    rows = rows_of(running.output)
    assert [(row['beside'], row['node']) for row in rows] == [
        (beside, node) for beside in ('quiet', 'nice') for node in ('contact', 'floor', 'echo')]
    assert all(int(row['sent']) > 0 and row['wrong'] == '0' for row in rows)
    for beside in ('quiet', 'nice'):
        assert re.search(rf'^{beside}: contact / echo \d', running.output, re.M)


class FaultyRelay(GuardedNode):
    """Stands between the contact node and the bench, and plants a fault of each kind, once.

    They are planted behind the first hundred answers, in which the nodes warm up.
    """

    def __init__(self, context: Context) -> None:
        super().__init__('faulty_relay', context=context)
        self._counts: dict[str, int] = {}
        for kind, topic in ((PointStamped, 'contact/point'), (Vector3Stamped, 'contact/normal'),
                            (Contacts, 'contacts')):
            publisher = self.create_publisher(kind, f'relayed/{topic}', DEEP)
            self.create_subscription(kind, f'bench/contact/{topic}',
                                     self._pass_on(topic, publisher), DEEP)

    def _pass_on(self, topic, publisher):
        def callback(message):
            count = self._counts[topic] = self._counts.get(topic, 0) + 1
            fault = (topic, count)
            if fault == ('contact/point', 150):
                return  # dropped
            if fault == ('contacts', 170):
                message.contacts[0].depth += 1e-6
            if fault == ('contacts', 180):
                message.contacts = []
            publisher.publish(message)
        return callback


def test_planted_faults_show_up(program):
    """One point is dropped, one depth wrong, one contact missing."""
    with running_node(FaultyRelay) as (relay, executor):
        remaps = ' '.join(f'-r bench/contact/{topic}:=relayed/{topic}'
                          for topic in ('contact/point', 'contact/normal', 'contacts'))
        running = bench(program, '--rate 100 --duration 6 --model exact',
                        f'--ros-args {remaps}')
        while running.process.poll() is None:
            spin_for(relay, executor, 0.2)
    assert running.wait() == 1, running.output
    row = next(row for row in rows_of(running.output) if row['node'] == 'contact')
    assert (row['lost'], row['wrong']) == ('1', '2'), running.output


class Listener(GuardedNode):
    """Counts answers of the echo node."""

    def __init__(self, context: Context) -> None:
        super().__init__('listener', context=context)
        self.count = 0
        self.create_subscription(PointStamped, 'bench/echo/echo/contact/point', self._heard, DEEP)

    def _heard(self, _: PointStamped) -> None:
        self.count += 1


def test_called_off(program):
    """SIGINT in mid-stream: results so far, and every process that was started ends."""
    with running_node(Listener) as (listener, executor):
        running = bench(program, '--duration 600')
        while listener.count < 200 and running.process.poll() is None:
            spin_for(listener, executor, 0.2)
        started = children(running.process.pid)
        running.signal(signal.SIGINT)
        assert running.wait() == 130, running.output
    assert len(started) >= 2 and not any(Path(f'/proc/{pid}').exists() for pid in started)
    assert 'interrupted: ' in running.output and 'Traceback' not in running.output
    sent = re.findall(r'\| +echo \| +(\d+) ', running.output)
    assert 100 <= int(sent[0]) < 60_000


def test_a_node_that_does_not_start_is_reported(monkeypatch, capfd):
    """In the node's own words, too."""
    monkeypatch.setitem(drive.NODES, 'echo', ('bench.no_node', '', {}))
    cores = os.sched_getaffinity(0)
    try:
        assert bench_main(['--duration', '1']) == 1
    finally:
        os.sched_setaffinity(0, cores)
        gc.enable()
    assert 'error: the echo node has not answered' in (error := capfd.readouterr().err)
    assert 'no_node' in error


def test_a_report_without_matplotlib_names_the_extra(monkeypatch, tmp_path):
    """Before anything is started; without --out nobody needs it."""
    monkeypatch.setattr(sys, 'excepthook', sys.excepthook)
    monkeypatch.setitem(extras.MODULES, 'report', ('no_such_module',))
    with pytest.raises(extras.MissingExtra, match=r'pip install .*\[report\]'):
        bench_main(['--out', str(tmp_path / 'bench.md')])


@pytest.mark.parametrize('arguments, words', [
    ('--rate 0', 'argument --rate: must lie in 1 to 4000'),
    ('--model exakt', "argument --model: model 'exakt' is not one of"),
    ('--beside loud', "argument --beside: invalid choice: 'loud'"),
    ('--out /proc/nowhere/bench.md', 'cannot write to /proc/nowhere'),
    ('--nodes echo floor', 'argument --nodes: the contact node must be among them'),
])
def test_bad_options(arguments, words, capsys):
    with pytest.raises(SystemExit, match='2'):
        bench_main(arguments.split())
    assert words in capsys.readouterr().err
