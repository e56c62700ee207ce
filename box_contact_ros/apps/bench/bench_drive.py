"""What runs the bench: starts the nodes, sends the streams, receives the answers.

One thread sends, on an absolute schedule, poses that were serialised before; the executor receives
in the main thread and only keeps the bytes, with the time. Everything else is done between streams.
"""
from __future__ import annotations

import contextlib
import gc
import os
import platform
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, Any

import rclpy
from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from tqdm import tqdm

from ...node.messages import NANOSECONDS, make_header, read_cloud
from ...node.runtime import let_callbacks_finish, make_executor, spin_for
from ...solver.contact import Contacts
from ..processes import Stop, asked_to_end, end, on_this_host
from .bench_log import NodeLog
from .echo_node import raw_stamp
from .pose_streams import Stream

# Bounds on everything that waits, so that a bench always ends.
START_LIMIT = 30.0  # s until a node answers
OFFER_PERIOD = 0.1  # s between the pairs that only ask whether anyone answers
WARM_UP = 100  # pairs sent at the rate, and not counted, before the first stream of a group
DRAIN_SILENCE = 1.0  # s without an answer: what is still out is lost
DRAIN_LIMIT = 15.0  # s for the last answers of a node that has fallen behind
SLICE = 0.05  # s between looks at whether the bench was called off

# Deep: what the DDS layer delivers while Python is busy must not push out the rest.
DEEP = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
MESSAGES = {
    'cloud': (PointCloud2, 'contacts'),
    'point': (PointStamped, 'contact/point'),
    'normal': (Vector3Stamped, 'contact/normal'),
    'echo': (Header, 'echo'),
}
"""Type and topic of each kind of answer; the soup's topics stand under soup/."""
CLOUD_COLUMNS = ('x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z', 'depth')


@dataclass
class Subject:
    """A node that is measured: how it is started, what it answers, what it answered."""

    name: str
    command: list[str]
    """Arguments of Python; the sizes are added."""
    log: NodeLog
    prefix: str = ''
    """Of the topics it answers on."""
    poses: str = ''
    """Prefix of the pose topics that it listens to."""
    has_sizes: bool = True
    failed: bool = False
    """Did not answer, or ended; for the group of streams that is under way."""


@dataclass(frozen=True)
class Running:
    """The process of a node, and the file that holds what it prints."""

    subject: Subject
    process: subprocess.Popen[bytes]
    output: IO[bytes]


@dataclass
class Clock:
    """Time [ns] that starts as the system's and then only runs: nobody sets it meanwhile."""

    start: int = field(default_factory=lambda: time.time_ns() - time.perf_counter_ns())

    def now(self) -> int:
        return self.start + time.perf_counter_ns()


class BenchNode(Node):
    """Publishes poses that were serialised before, keeps the bytes of what comes back."""

    def __init__(self, context: Context, subjects: Sequence[Subject], clock: Clock) -> None:
        super().__init__('bench', context=context)
        self.arrivals: list[tuple[int, int, str, bytes]] = []
        """(received [ns], number of the subject, kind, message)."""
        self._publishers_ab = {
            poses: [self.create_publisher(PoseStamped, f'{poses}{box}/pose', DEEP)
                    for box in ('box_a', 'box_b')]
            for poses in dict.fromkeys(subject.poses for subject in subjects)}
        for number, subject in enumerate(subjects):
            for kind in subject.log.kinds:
                message, topic = MESSAGES[kind]
                self.create_subscription(message, subject.prefix + topic,
                                         self._keep(number, kind, clock.now), DEEP, raw=True)

    def _keep(self, number: int, kind: str, now: Callable[[], int]) -> Callable[[bytes], None]:
        arrivals = self.arrivals

        def callback(data: bytes) -> None:
            arrivals.append((now(), number, kind, data))
        return callback

    def senders(self, poses: str) -> list[Callable[[bytes], None]]:
        """What sends a serialised pose of box A, and of box B, under that prefix."""
        return [publisher.publish for publisher in self._publishers_ab[poses]]


class Bench:
    """One run: starts the nodes group by group, plays the streams, keeps the logs."""

    def __init__(self, node: BenchNode, subjects: list[Subject], *, rate: float, clock: Clock,
                 stop: Stop, node_cores: set[int]) -> None:
        """rate: pairs a second [Hz]; stop: set to call all off; node_cores: of the nodes."""
        self.node, self.subjects, self.rate, self.clock = node, subjects, rate, clock
        self.stop, self.node_cores = stop, node_cores
        self.notes: list[str] = []
        """What went wrong with the nodes as such."""
        self.executor = make_executor(node.context)
        self.executor.add_node(node)
        let_callbacks_finish()
        self._running: list[Running] = []
        self._last = 0

    def run(self, groups: list[list[Stream]], truths: dict[str, Contacts], *, play: bool = True,
            ) -> None:
        """Play all streams; what was done when `stop` is set stays in the logs.

        play: otherwise the nodes are only started, until they answer.
        """
        for streams in groups:
            if self.stop.is_set():
                return
            try:
                self._start(streams[0])
                self._await_answers(streams[0])
                for stream in streams if play else ():
                    for turn in self._turns():
                        self._play(stream, truths[stream.name], turn)
            finally:
                self._end()

    def _turns(self) -> list[list[Subject]]:
        """Who is sent a stream at the same time: all that listen to the same topics."""
        turns: dict[str, list[Subject]] = {}
        for subject in self.subjects:
            if not subject.failed:
                turns.setdefault(subject.poses, []).append(subject)
        return list(turns.values())

    # --- processes -------------------------------------------------------------------------------

    def _start(self, stream: Stream) -> None:
        sizes = [word for name in ('size_a', 'size_b') for word in (
            '-p', f'{name}:=[{",".join(map(str, getattr(stream, name)))}]')]
        for subject in self.subjects:
            remaps = [word for box in ('box_a', 'box_b') for word in (
                '-r', f'{box}/pose:={subject.poses}{box}/pose') if subject.poses]
            subject.failed, output = False, tempfile.TemporaryFile()
            process = subprocess.Popen(
                [sys.executable, *subject.command, *(sizes if subject.has_sizes else []), *remaps],
                stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                start_new_session=True)
            self._running.append(Running(subject, process, output))
            # It has inherited this process's core; now, before it has threads, it gets its own.
            with contextlib.suppress(ProcessLookupError):
                os.sched_setaffinity(process.pid, self.node_cores)

    def _await_answers(self, stream: Stream) -> None:
        """Offer pairs until every node has answered one, then some at the rate, to warm up."""
        answered_before = {s.name: len(s.log.offers_answered) for s in self.subjects}
        waiting = list(self._running)
        deadline = time.monotonic() + START_LIMIT
        offers = _serialised(stream, [0] * WARM_UP)
        with _bar(len(waiting), f'start {_lengths(stream)}', 'node') as bar:
            while waiting and not self.stop.is_set():
                for running in list(waiting):
                    subject, process = running.subject, running.process
                    if len(subject.log.offers_answered) > answered_before[subject.name]:
                        waiting.remove(running)
                        bar.update()
                    elif process.poll() is not None:
                        self._fail(running, f'ended with status {process.returncode}')
                        waiting.remove(running)
                    elif time.monotonic() > deadline:
                        self._fail(running, f'did not answer within {START_LIMIT:g} s')
                        waiting.remove(running)
                for turn in self._turns():
                    self._offer(turn, offers[:1])
                self._spin(time.monotonic() + OFFER_PERIOD)
                self._decode()
        for turn in self._turns():
            last = self._offer(turn, offers)
            # A soup may still be busy with them for seconds.
            self._drain(partial(_unanswered, turn, last))

    def _fail(self, running: Running, why: str) -> None:
        running.subject.failed = True
        running.output.seek(0)
        printed = running.output.read().decode(errors='replace').strip().splitlines()
        last = f': {printed[-1]}' if printed else ''
        self.notes.append(f'{running.subject.name} {why}{last}')

    def _end(self) -> None:
        """End the processes."""
        for running in self._running:
            if running.process.poll() is not None and not running.subject.failed:
                self._fail(running, f'ended early with status {running.process.returncode}')
        end([running.process for running in self._running])
        for running in self._running:
            running.output.close()
        self._running = []

    # --- sending and receiving -------------------------------------------------------------------

    def _play(self, stream: Stream, truth: Contacts, turn: list[Subject]) -> None:
        """Send a stream to the nodes of one turn, and wait for their last answers."""
        if self.stop.is_set():
            return
        for subject in turn:
            subject.log.open(stream.name, truth)
        pairs = _serialised(stream, range(len(stream)))
        sent: list[tuple[int, float]] = []
        sender = threading.Thread(target=self._send, args=(turn[0].poses, pairs, sent))
        who = ' '.join(subject.name for subject in turn)
        with _bar(len(pairs), f'{stream.name} ({who})', 'pair') as bar, _no_collection():
            sender.start()
            while sender.is_alive():
                self._spin(time.monotonic() + SLICE)
                bar.update(len(sent) - bar.n)
            bar.update(len(sent) - bar.n)
        for stamp, lateness in sent:
            for subject in turn:
                subject.log.sent(stamp, lateness)
        self._drain(lambda: sum(subject.log.outstanding for subject in turn))

    def _send(self, poses: str, pairs: list[tuple[tuple[bytes, bytes], ...]],
              sent: list[tuple[int, float]]) -> None:
        """Send pairs at the rate; the schedule is absolute, so lateness is not handed on."""
        publish_a, publish_b = self.node.senders(poses)
        period, stopped = 1.0 / self.rate, self.stop.is_set
        start = time.perf_counter() + SLICE
        for row, ((head, tail_a), (_, tail_b)) in enumerate(pairs):
            due = start + row * period
            while (left := due - time.perf_counter()) > 0.0 and not stopped():
                time.sleep(min(left, SLICE))
            if stopped():
                return
            stamp = self._stamp()
            middle = head + struct.pack('<iI', *divmod(stamp, NANOSECONDS))
            publish_a(middle + tail_a)
            publish_b(middle + tail_b)
            sent.append((stamp, max(0.0, -left)))

    def _offer(self, turn: list[Subject], pairs: list[Any]) -> set[int]:
        """Send pairs that count in no figure; their stamps [ns]."""
        sent: list[tuple[int, float]] = []
        sender = threading.Thread(target=self._send, args=(turn[0].poses, pairs, sent))
        sender.start()
        while sender.is_alive():
            self._spin(time.monotonic() + SLICE)
        stamps = {stamp for stamp, _ in sent}
        for subject in turn:
            subject.log.offers |= stamps
        return stamps

    def _stamp(self) -> int:
        """The time [ns], later than any before: stamps are names here."""
        self._last = max(self.clock.now(), self._last + 1)
        return self._last

    def _spin(self, until: float) -> None:
        """Receive until that time."""
        left = until - time.monotonic()
        if left > 0.0:
            spin_for(self.executor, left)

    def _drain(self, outstanding: Callable[[], int]) -> None:
        """Wait for the last answers: until nothing is out, or nothing comes any more."""
        quiet = time.monotonic() + DRAIN_SILENCE
        deadline = quiet if self.stop.is_set() else time.monotonic() + DRAIN_LIMIT
        while True:
            if self._decode():
                quiet = time.monotonic() + DRAIN_SILENCE
            if not outstanding() or time.monotonic() > min(quiet, deadline):
                break
            self._spin(time.monotonic() + SLICE)
        # The clouds come last; whatever is still on its way behind them is seen here.
        self._spin(time.monotonic() + SLICE)
        self._decode()

    def _decode(self) -> int:
        """Hand what has arrived to the logs; how many messages it was."""
        arrivals = self.node.arrivals
        count = len(arrivals)
        for received, number, kind, data in arrivals:
            values: Sequence[float] = ()
            if kind != 'echo':
                message = deserialize_message(data, MESSAGES[kind][0])
                values = _values(kind, message)
            self.subjects[number].log.answer(kind, raw_stamp(data), received, values)
        arrivals.clear()
        return count

    def close(self) -> None:
        """End everything that still runs."""
        self._end()
        self.executor.shutdown()


@contextlib.contextmanager
def open_bench(subjects: list[Subject], args: Sequence[str], *, rate: float, domain: int,
               kind: type[Bench] = Bench) -> Iterator[Bench]:
    """A bench of its own ROS domain and cores. Afterwards all is as it was, and no node is left.

    args: what follows the program's name, for rclpy. SIGINT, SIGTERM and SIGHUP set `bench.stop`,
    so that the nodes are ended and the results kept.
    """
    # Nodes inherit it; nothing else on this network hears what is measured.
    os.environ |= on_this_host(domain)
    cores = os.sched_getaffinity(0)
    own = {max(cores)} if len(cores) > 1 else cores
    context, node, bench = Context(), None, None
    with asked_to_end() as stop:
        try:
            os.sched_setaffinity(0, own)  # before rclpy starts its threads, which inherit it
            rclpy.init(args=list(args), context=context,
                       signal_handler_options=SignalHandlerOptions.NO)
            clock = Clock()
            node = BenchNode(context, subjects, clock)
            bench = kind(node, subjects, rate=rate, clock=clock, stop=stop,
                         node_cores=cores - own or cores)
            yield bench
        finally:
            if bench is not None:
                bench.close()
            if node is not None:
                node.destroy_node()
            context.try_shutdown()
            os.sched_setaffinity(0, cores)


def about_the_machine(node_cores: set[int]) -> dict[str, str]:
    """Where a bench runs; called in one."""
    def listed(cores: set[int]) -> str:
        return ' '.join(map(str, sorted(cores)))

    return {'machine': f'{platform.node()}: {_processor()}, {os.cpu_count()} cores',
            'cores': f'bench on {listed(os.sched_getaffinity(0))}, nodes on {listed(node_cores)}',
            'load at start': f'{os.getloadavg()[0]:.2f}',
            'python': platform.python_version()}


def _processor() -> str:
    with contextlib.suppress(OSError):
        for line in Path('/proc/cpuinfo').read_text().splitlines():
            if line.startswith('model name'):
                return line.partition(':')[2].strip()
    return platform.machine()


def _unanswered(turn: list[Subject], offers: set[int]) -> int:
    """How many answers to these offers (stamps) have not come."""
    return sum(len(offers - subject.log.offers_answered) for subject in turn)


def _values(kind: str, message: Any) -> Sequence[float]:
    if kind == 'cloud':
        rows = read_cloud(message)  # of pair 0, the only one
        return [float(rows[0][name]) for name in CLOUD_COLUMNS] if len(rows) else ()
    vector = message.point if kind == 'point' else message.vector
    return vector.x, vector.y, vector.z


def _serialised(stream: Stream, rows: Sequence[int]) -> list[tuple[tuple[bytes, bytes], ...]]:
    """The pairs of some rows, each message cut in two: the stamp goes between."""
    pairs = []
    for row in rows:
        pair = []
        for values in (stream.pose_a[row], stream.pose_b[row]):
            message = PoseStamped(header=make_header(0, 'world'))
            p, q = message.pose.position, message.pose.orientation
            p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, values)
            data = serialize_message(message)
            # Little endian whatever the machine's order, since the stamp is packed so.
            if data[1] != 1:
                raise NotImplementedError('messages are serialised big endian here')
            pair.append((data[:4], data[12:]))
        pairs.append(tuple(pair))
    return pairs


@contextlib.contextmanager
def _no_collection() -> Iterator[None]:
    """A full collection takes milliseconds, which would be taken for a node's."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _bar(total: int, text: str, unit: str) -> tqdm:
    return tqdm(total=total, desc=text, unit=unit, disable=None, leave=False, mininterval=0.2)


def _lengths(stream: Stream) -> str:
    return ' and '.join('×'.join(f'{extent:g}' for extent in size)
                        for size in dict.fromkeys(stream.sizes)) + ' m'
