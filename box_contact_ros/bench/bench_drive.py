# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What runs the bench: starts the nodes, sends the streams, receives the answers.

One thread sends, on an absolute schedule, poses that were serialised before. The executor receives
in the main thread and only keeps the bytes, with the time. Everything else is done between streams.
"""
from __future__ import annotations

import contextlib
import os
import platform
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import IO, Any

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped
from rclpy.context import Context
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header
from tqdm import tqdm

from benchmarks.timing import no_garbage_collection, pinned
from box_contact_ros.bench.answer_log import CONTACT_MESSAGES, ECHO_MESSAGES, AnswerLog
from box_contact_ros.core import native
from box_contact_ros.demo.processes import (
    Stop,
    asked_to_end,
    end,
    on_this_host,
    parameters,
    printed,
    program,
    start,
)
from box_contact_ros.demo.ros_client import (
    ANSWERS,
    DEEP_RELIABLE,
    answer_values,
    array_message,
    pose_message,
)
from box_contact_ros.node.messages import make_header, read_contacts
from box_contact_ros.node.runtime import GuardedNode, joined, let_callbacks_finish, spin_for
from box_contact_ros.output import machine
from box_contact_ros.scene.files.scene_file import write_scene
from box_contact_ros.scene.scene_solver import POSE_ARRAY, Scene
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.view.recording.stream import Stream

from .echo_node import raw_stamp, with_stamp

# Bounds on everything that waits, so that a bench always ends.
START_LIMIT = 30.0  # s until a node answers
OFFER_PERIOD = 0.1  # s between the pairs that only ask whether anyone answers
WARM_UP = 100  # pairs sent at the rate, and not counted, before the first stream of a group
DRAIN_SILENCE = 1.0  # s without an answer: what is still out is lost
DRAIN_LIMIT = 15.0  # s for the last answers of a node that has fallen behind
SLICE = 0.05  # s between looks at whether the bench was called off

PACKAGES = ('numpy', 'rclpy', 'ros-fastrtps')  # whose versions are named

MESSAGES = ANSWERS | {'echo': (Header, 'echo')}
"""Type and topic of each kind of answer; the soup's topics stand under soup/."""
PAIR_INPUTS = (('box_a/pose', PoseStamped), ('box_b/pose', PoseStamped))
ARRAY_INPUTS = ((POSE_ARRAY, PoseArray),)


@dataclass
class MeasuredNode:
    """A node that is measured: how it is started, what it answered, its process while it runs."""

    log: AnswerLog
    command: list[str]  # arguments of Python; the sizes and the pose topics are added
    poses: str = ''  # prefix of the pose topics that it listens to
    inputs: Sequence[tuple[str, type]] = PAIR_INPUTS  # those topics with their types
    prefix: str = ''  # of the topics it answers on
    failed: bool = False  # did not answer, or ended; for the group of streams that is under way
    process: subprocess.Popen[bytes] | None = None
    output: IO[bytes] | None = None

    @property
    def name(self) -> str:
        """Return what tables call the node."""
        return self.log.node

    def start(self, cores: set[int], stream: Stream | None = None) -> None:
        """Start the process on some cores, for the boxes of a stream."""
        words = [word for topic, _ in self.inputs for word in (
            '-r', f'{topic}:={self.poses}{topic}') if self.poses]
        if stream is not None and self.log.kinds != ECHO_MESSAGES:
            words += parameters(size_a=stream.size_a, size_b=stream.size_b)
        self.failed, self.output = False, tempfile.TemporaryFile()
        self.process = start([*self.command, *words], self.output)
        # It has inherited this process's core; now, before it has threads, it gets its own.
        with contextlib.suppress(ProcessLookupError):
            os.sched_setaffinity(self.process.pid, cores)

    def ended(self) -> int | None:
        """Return the exit status of the process, None while it runs."""
        return self.process.poll() if self.process else None


def solver_node(name: str, model: str, /, *, poses: str, prefix: str = '',
                **values: object) -> MeasuredNode:
    """Return a contact or soup node that is not started yet; `values` are its parameters."""
    return MeasuredNode(AnswerLog(name, model, CONTACT_MESSAGES),
                        program(f'{name}_node', **values), poses, prefix=prefix)


def echo_node(name: str, *, poses: str, prefix: str = '', bare: bool = False) -> MeasuredNode:
    """Return an echo node that is not started yet."""
    return MeasuredNode(AnswerLog(name, '', ECHO_MESSAGES), [
        '-m', 'box_contact_ros.bench.echo_node', *(['--bare'] if bare else []),
        '--ros-args', '-r', f'echo:={prefix}echo'], poses, prefix=prefix)


def monotonic_clock() -> Callable[[], int]:
    """Return a clock [ns] that starts at the system's time and is never set back."""
    start = time.time_ns() - time.perf_counter_ns()
    return lambda: start + time.perf_counter_ns()


class BenchNode(GuardedNode):
    """Publishes poses that were serialised before, keeps the bytes of what comes back."""

    def __init__(self, context: Context, nodes: Sequence[MeasuredNode],
                 clock: Callable[[], int]) -> None:
        super().__init__('bench', context=context)
        self._now = clock
        self.arrivals: list[tuple[int, int, str, bytes]] = []
        """(received [ns], number of the node, kind, message)."""
        self.senders = {
            poses: [self.create_publisher(kind, poses + topic, DEEP_RELIABLE).publish
                    for topic, kind in inputs]
            for poses, inputs in {node.poses: node.inputs for node in nodes}.items()}
        """What sends a serialised message of each input, by the topics' prefix."""
        for number, node in enumerate(nodes):
            for kind in node.log.kinds:
                message, topic = MESSAGES[kind]
                self.create_subscription(message, node.prefix + topic,
                                         partial(self._keep, number, kind), DEEP_RELIABLE, raw=True)

    def _keep(self, number: int, kind: str, data: bytes) -> None:
        self.arrivals.append((self._now(), number, kind, data))


class Bench:
    """One run: starts the nodes group by group, plays the streams, keeps the logs."""

    def __init__(self, nodes: Sequence[MeasuredNode], client: BenchNode, executor: Any, *,
                 clock: Callable[[], int], rate: float, node_cores: set[int], stop: Stop) -> None:
        """rate: pairs a second [Hz]; stop: set to call all off; node_cores: of the nodes."""
        self.nodes, self.client, self.executor, self.clock = nodes, client, executor, clock
        self.rate, self.node_cores, self.stop = rate, node_cores, stop
        self.notes: list[str] = []  # what went wrong with the nodes as such
        self._last = 0

    def run(self, groups: list[list[Stream]], play: Callable[[Stream], None]) -> None:
        """Start the nodes for each group of streams; when they answer, `play` each stream of it.

        What was done when `stop` is set stays in the logs.
        """
        for streams in groups:
            if self.stop.is_set():
                return
            for node in self.nodes:
                node.start(self.node_cores, streams[0])
            self.await_answers(_serialised(streams[0], [0] * WARM_UP), _lengths(streams[0]))
            for stream in streams:
                play(stream)
            self.end()

    def turns(self) -> list[list[MeasuredNode]]:
        """Return which nodes are sent a stream together: all that listen to the same topics."""
        turns: dict[str, list[MeasuredNode]] = {}
        for node in self.nodes:
            if not node.failed:
                turns.setdefault(node.poses, []).append(node)
        return list(turns.values())

    def await_answers(self, offers: list[list[bytes]], what: str) -> None:
        """Offer the first tick until every node has answered it, then all of them, to warm up.

        what: the boxes, for the progress bar.
        """
        answered_before = {node.name: len(node.log.offers_answered) for node in self.nodes}
        waiting = list(self.nodes)
        deadline = time.monotonic() + START_LIMIT
        with _bar(len(waiting), f'start {what}', 'node') as bar:
            while waiting and not self.stop.is_set():
                for node in list(waiting):
                    if len(node.log.offers_answered) > answered_before[node.name]:
                        waiting.remove(node)
                        bar.update()
                    elif node.ended() is not None:
                        self._fail(node, f'ended with status {node.ended()}')
                        waiting.remove(node)
                    elif time.monotonic() > deadline:
                        self._fail(node, f'did not answer within {START_LIMIT:g} s')
                        waiting.remove(node)
                for turn in self.turns():
                    self._offer(turn, offers[:1])
                spin_for(self.client, self.executor, OFFER_PERIOD)
                self._decode()
        for turn in self.turns():
            last = self._offer(turn, offers)
            # A soup may still be busy with them for seconds.
            self._drain(partial(_unanswered, turn, last))

    def _fail(self, node: MeasuredNode, why: str) -> None:
        node.failed = True
        *_, last = ['', *(printed(node.output).splitlines() if node.output else [])]
        self.notes.append(f'{node.name} {why}{": " if last else ""}{last}')

    def end(self) -> None:
        """End the processes that still run."""
        for node in self.nodes:
            if node.ended() is not None and not node.failed:
                self._fail(node, f'ended early with status {node.ended()}')
        end([node.process for node in self.nodes if node.process])
        for node in self.nodes:
            if node.output:
                node.output.close()
            node.process = node.output = None

    def play(self, stream: Stream, truth: Contacts | None, turn: list[MeasuredNode]) -> None:
        """Send a stream to the nodes of one turn, and wait for their last answers."""
        if self.stop.is_set():
            return
        for node in turn:
            node.log.open(stream.name, len(stream), truth)
        pairs = _serialised(stream, range(len(stream)))
        who = ' '.join(node.name for node in turn)
        with _bar(len(pairs), f'{stream.name} ({who})', 'pair') as bar, no_garbage_collection():
            sent = self.send_and_receive(turn, pairs, lambda count: bar.update(count - bar.n))
        for stamp, lateness in sent:
            for node in turn:
                node.log.sent(stamp, lateness)
        self._drain(lambda: sum(node.log.outstanding for node in turn))

    def send_and_receive(self, turn: list[MeasuredNode], ticks: list[list[bytes]],
                         show: Callable[[int], object] = lambda count: None,
                         ) -> list[tuple[int, float]]:
        """Send the messages of ticks in a thread, receive meanwhile, and `show` how many are sent.

        Return the stamp [ns] and the lateness [s] of each tick that was sent.
        """
        sent: list[tuple[int, float]] = []
        sender = threading.Thread(target=self._send, args=(turn[0].poses, ticks, sent))
        sender.start()
        while sender.is_alive():
            spin_for(self.client, self.executor, SLICE)
            show(len(sent))
        return sent

    def _send(self, poses: str, ticks: list[list[bytes]], sent: list[tuple[int, float]]) -> None:
        """Send ticks at the rate; the schedule is absolute, so lateness is not handed on."""
        publishers = self.client.senders[poses]
        period, stopped = 1.0 / self.rate, self.stop.is_set
        start = time.perf_counter() + SLICE
        for row, messages in enumerate(ticks):
            due = start + row * period
            while (left := due - time.perf_counter()) > 0.0 and not stopped():
                time.sleep(min(left, SLICE))
            if stopped():
                return
            stamp = self._stamp()
            for publish, message in zip(publishers, messages):
                publish(with_stamp(message, stamp))
            sent.append((stamp, max(0.0, -left)))

    def _offer(self, turn: list[MeasuredNode], ticks: list[list[bytes]]) -> set[int]:
        """Send ticks that count in no figure; return their stamps [ns]."""
        stamps = {stamp for stamp, _ in self.send_and_receive(turn, ticks)}
        for node in turn:
            node.log.offers |= stamps
        return stamps

    def _stamp(self) -> int:
        """Return the time [ns], later than any before: stamps are names here."""
        self._last = max(self.clock(), self._last + 1)
        return self._last

    def _drain(self, outstanding: Callable[[], int]) -> None:
        """Wait for the last answers: until nothing is out, or nothing comes any more."""
        quiet = time.monotonic() + DRAIN_SILENCE
        deadline = quiet if self.stop.is_set() else time.monotonic() + DRAIN_LIMIT
        while True:
            if self._decode():
                quiet = time.monotonic() + DRAIN_SILENCE
            if not outstanding() or time.monotonic() > min(quiet, deadline):
                break
            spin_for(self.client, self.executor, SLICE)
        # The clouds come last; whatever is still on its way behind them is seen here.
        spin_for(self.client, self.executor, SLICE)
        self._decode()

    def _decode(self) -> int:
        """Hand what has arrived to the logs; return how many messages it was."""
        arrivals = self.client.arrivals
        count = len(arrivals)
        for received, number, kind, data in arrivals:
            values: Sequence[float] | np.ndarray = ()
            if kind != 'echo':
                values = answer_values(kind, deserialize_message(data, MESSAGES[kind][0]))
            self.nodes[number].log.answer(kind, raw_stamp(data), received, values)
        arrivals.clear()
        return count


@contextlib.contextmanager
def open_bench(nodes: Sequence[MeasuredNode], args: Sequence[str], *, rate: float, domain: int,
               ) -> Iterator[Bench]:
    """Give a bench of its own ROS domain and cores. Afterwards all is as it was, no node is left.

    args: what follows the program's name, for rclpy. SIGINT, SIGTERM and SIGHUP set `bench.stop`,
    so that the nodes are ended and the results kept.
    """
    # Nodes inherit it; nothing else on this network hears what is measured.
    os.environ |= on_this_host(domain)
    cores = os.sched_getaffinity(0)
    own = {max(cores)} if len(cores) > 1 else cores
    clock = monotonic_clock()
    # Pinned before rclpy starts its threads, which inherit it.
    with asked_to_end() as stop, pinned(own), joined(
            partial(BenchNode, nodes=nodes, clock=clock), args) as (client, executor):
        let_callbacks_finish()
        bench = Bench(nodes, client, executor, clock=clock, rate=rate, stop=stop,
                      node_cores=cores - own or cores)
        try:
            yield bench
        finally:
            bench.end()


@dataclass
class ArrayRun:
    """What one contact node did with pose arrays."""

    about: dict[str, str]
    sent: int = 0
    ids: dict[int, set[int]] = field(default_factory=dict)  # of pairs in contact, by tick
    latencies: list[float] = field(default_factory=list)  # [s], from stamp to cloud
    cpu_share: float = 0.0  # of one core


def drive_array(scene: Scene, poses: np.ndarray, args: Sequence[str], *, model: str, rate: float,
                seconds: float, domain: int) -> ArrayRun:
    """Send poses (ticks, boxes, 7) over and over as arrays to a contact node on one core."""
    ticks = [[serialize_message(array_message(make_header(0, 'world'), tick))] for tick in poses]
    with tempfile.NamedTemporaryFile('w', suffix='.yaml') as file:
        write_scene(scene, file.name)
        node = MeasuredNode(AnswerLog('contact', model, ('cloud',)), program(
            'contact_node', scene=file.name, model=model, pair_topics=False), inputs=ARRAY_INPUTS)
        with open_bench([node], args, rate=rate, domain=domain) as bench:
            cores = {min(bench.node_cores)}
            found = ArrayRun(about_the_machine(cores))
            node.start(cores)
            bench.await_answers(ticks[:1] * WARM_UP, f'{len(scene.moving)} boxes')
            if bench.notes:
                raise ValueError(bench.notes[0])
            with no_garbage_collection():
                before = _cpu_seconds(node.process.pid)
                sent = bench.send_and_receive(
                    [node], [ticks[n % len(ticks)] for n in range(round(rate * seconds))])
                spent = _cpu_seconds(node.process.pid) - before
                found.cpu_share = spent * rate / max(len(sent), 1)
                spin_for(bench.client, bench.executor, DRAIN_SILENCE)
    found.sent, number_of = len(sent), {stamp: number for number, (stamp, _) in enumerate(sent)}
    for received, _, _, data in bench.client.arrivals:
        rows = read_contacts(deserialize_message(data, MESSAGES['cloud'][0]), scene.ids)
        stamp = raw_stamp(data)
        if stamp in number_of:  # else a late answer to an offer
            found.ids[number_of[stamp]] = set(rows['pair'].tolist())
            found.latencies.append(1e-9 * (received - stamp))
    return found


def _cpu_seconds(pid: int) -> float:
    """Return the processor time that a process has taken (Linux)."""
    with open(f'/proc/{pid}/stat') as file:
        fields = file.read().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def about_the_machine(node_cores: set[int]) -> dict[str, str]:
    """Return where a bench runs; called in one."""
    def listed(cores: set[int]) -> str:
        return ' '.join(map(str, sorted(cores)))

    return {'machine': f'{platform.node()}: {machine(native, PACKAGES)}, {os.cpu_count()} cores',
            'cores': f'bench on {listed(os.sched_getaffinity(0))}, nodes on {listed(node_cores)}',
            'load at start': f'{os.getloadavg()[0]:.2f}'}


def adds_up(bench: Bench) -> bool:
    """Return whether sent = answered + lost, by node and by stream."""
    return all(node.log.adds_up and all(result.adds_up for result in node.log.results())
               for node in bench.nodes)


def _unanswered(turn: list[MeasuredNode], offers: set[int]) -> int:
    """Return how many answers to these offers (stamps) have not come."""
    return sum(len(offers - node.log.offers_answered) for node in turn)


def _serialised(stream: Stream, rows: Sequence[int]) -> list[list[bytes]]:
    """Return the pairs of some rows as messages under a stamp of 0."""
    return [[serialize_message(pose_message(make_header(0, 'world'), poses[row]))
             for poses in (stream.pose_a, stream.pose_b)] for row in rows]


def _bar(total: int, text: str, unit: str) -> tqdm:
    return tqdm(total=total, desc=text, unit=unit, disable=None, leave=False, mininterval=0.2)


def _lengths(stream: Stream) -> str:
    return ' and '.join('×'.join(f'{extent:g}' for extent in size)
                        for size in dict.fromkeys(stream.sizes)) + ' m'
