# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `yard_clients`: a yard that one client changes while another one sends poses.

`python -m benchmarks.yard_clients` starts a contact node. It changes the yard five times a second:
boxes and bodies come, go, are lifted, land, are attached and detached. A sender publishes poses by
name, and learns what moves by ~/boxes alone. It is killed and started again ten times.

Each answer is compared with that of a new solver for its revision and for the names and poses that
were sent. The exit status is 0 only if all are equal, none is late, nothing hangs, and
the node's memory stays.
"""
from __future__ import annotations

import bisect
import contextlib
import math
import os
import sys
import tempfile
import time
from collections import Counter, OrderedDict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import yaml
from geometry_msgs.msg import Quaternion, Transform, Vector3
from rclpy.context import Context
from rclpy.executors import (
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.qos import QoSProfile
from sensor_msgs.msg import MultiDOFJointState

from box_contact_msgs.msg import Body, Boxes, Contacts
from box_contact_msgs.msg import Box as BoxMessage
from box_contact_msgs.srv import SetBoxes
from box_contact_ros.arguments import program_parser
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import make_header, set_pose
from box_contact_ros.node.paced_service import REQUESTS
from box_contact_ros.node.runtime import GuardedNode, run_node, running_node, spin_once
from box_contact_ros.node.topics import LATCHED
from box_contact_ros.processes import keep_to_this_host, running
from box_contact_ros.scene.boxes import AT_FRAME, Box, Frame
from box_contact_ros.scene.scene import Scene
from box_contact_ros.scene.scene_check import NO_SIZE
from box_contact_ros.scene.scene_file import read_scene
from box_contact_ros.scene.scene_solver import SceneSolver
from box_contact_ros.stream.read_contacts import ReadContacts, read_contacts

FRAME, CUBE = 'map', (2.0, 2.0, 2.0)
YARD = {'frame_id': FRAME, 'poses': 'named', 'pairs': 'all',
        'boxes': {'ground': {'size': [200, 200, 1], 'pose': [0, 0, -0.5, 0, 0, 0, 1]}},
        'bodies': {'crane': {'boxes': {'hook': {'size': [1, 1, 1]}}}}}
NAMES = [f'c{number}' for number in range(40)]
BODIES = ('crane', 'lorry', 'trailer')
EXECUTORS = {'events': EventsExecutor, 'single': SingleThreadedExecutor,
             'multi': MultiThreadedExecutor}
CHANGES_PER_SECOND = 5.0
LATE = 0.2  # s
SLOPE = 0.25  # kB a change: half a kB a lift
PATIENCE = 30.0  # [s]
DEEP = QoSProfile(depth=10_000)
KEPT_SOLVERS = 32
ROOT = Path(__file__).parents[1]


class Yard:
    """Plays the yard: makes changes at random, and knows the scene of each revision."""

    def __init__(self, scene: Scene, seed: int) -> None:
        """Begin with the scene of the file."""
        self.scene, self._rng = scene, np.random.default_rng(seed)
        self.boxes, self.bodies = dict(scene.boxes), dict(scene.bodies)
        self._first = dict.fromkeys(scene.boxes)
        self.kinds: Counter[str] = Counter()  # of changes

    def change(self) -> SetBoxes.Request:
        """Make a change, and return its request."""
        rng, name = self._rng, str(self._rng.choice(NAMES))
        body, known = str(rng.choice(BODIES)), self.boxes.get(name)
        request = SetBoxes.Request(header=make_header(0, FRAME))
        kind = str(rng.choice(['fixed', 'fixed', 'moving', 'attach', 'attach', 'absent', 'body']))
        if kind == 'absent' and (known is None or rng.random() < 0.5):
            kind = 'fixed'
        if kind == 'body' and body not in self.bodies:
            kind = 'attach'
        self.kinds['detach' if known and known.body and kind in ('fixed', 'moving') else kind] += 1
        pose = random_pose(rng)
        if kind == 'fixed':
            self.boxes[name] = Box(CUBE, pose)
            request.fixed = [a_box(name, pose)]
        elif kind == 'moving':
            self.boxes[name] = Box(CUBE)
            request.moving = [a_box(name, AT_FRAME)]
        elif kind == 'absent':
            del self.boxes[name]
            request.absent = [name]
        else:
            is_fixed = body != 'crane' and rng.random() < 0.5
            self.bodies[body] = Frame(pose if is_fixed else None)
            message = Body(name=body, fixed=is_fixed)
            set_pose(message.pose, pose)
            if kind == 'attach':
                local = (*rng.uniform(-2, 2, 3), 0.0, 0.0, 0.0, 1.0)
                self.boxes[name] = Box(CUBE, local, body=body)
                message.boxes = [a_box(name, local, CUBE if known is None else NO_SIZE)]
            request.bodies = [message]
        if name in self.boxes:
            self._first.setdefault(name)
        used = {box.body for box in self.boxes.values()}
        self.bodies = {name: frame for name, frame in self.bodies.items() if name in used}
        return request

    def now(self) -> Scene:
        """Return the scene as a new one, with boxes in the order in which they came first."""
        boxes = {name: self.boxes[name] for name in self._first if name in self.boxes}
        return Scene(boxes, self.scene.pairs, FRAME, 'named', self.scene.patterns,
                     dict(self.bodies))


def random_pose(rng: np.random.Generator) -> tuple[float, ...]:
    """Return a pose among the boxes of the yard, turned about z."""
    x, y, z, turn = rng.uniform((-9, -9, 0, -3), (9, 9, 4, 3)).tolist()
    return (x, y, z, 0.0, 0.0, math.sin(turn), math.cos(turn))


def a_box(name: str, pose: Sequence[float], size: Sequence[float] = CUBE) -> BoxMessage:
    """Return a box of a request."""
    box = BoxMessage(name=name, size=Vector3(x=size[0], y=size[1], z=size[2]))
    set_pose(box.pose, np.array(pose))
    return box


class Sender(GuardedNode):
    """Sends poses of all that moves, and learns by ~/boxes alone what does."""

    def __init__(self, context: Context, rate: float) -> None:
        super().__init__('sender', context=context)
        self._names: Sequence[str] = ()
        self._rng = np.random.default_rng()
        self._poses = self.create_publisher(MultiDOFJointState, 'poses', DEEP)
        self.create_subscription(Boxes, 'contact_node/boxes', self._follow, LATCHED)
        self.create_timer(1.0 / rate, self._send)

    def _follow(self, boxes: Boxes) -> None:
        self._names = boxes.moving_names

    def _send(self) -> None:
        message = MultiDOFJointState(header=make_header(time.time_ns(), FRAME))
        for name in self._names:
            x, y, z, qx, qy, qz, qw = random_pose(self._rng)
            message.joint_names.append(name)
            message.transforms.append(Transform(translation=Vector3(x=x, y=y, z=z),
                                                rotation=Quaternion(x=qx, y=qy, z=qz, w=qw)))
        self._poses.publish(message)


class Judge(GuardedNode):
    """Changes the yard, and judges each answer."""

    def __init__(self, context: Context, yard: Yard) -> None:
        super().__init__('judge', context=context)
        self.yard, self.scenes = yard, {0: yard.now()}
        self.acknowledged: list[int] = []  # when each change was, by the wall clock [ns]
        self.sent: dict[int, MultiDOFJointState] = {}  # by stamp
        self.told: dict[int, ReadContacts] = {}  # answers that wait for what was sent
        self.judged, self.contacts, self.late = 0, 0, 0
        self.worst = 0  # how long after a change an answer did not know it [ns]
        self.wrong: list[str] = []
        self._solvers: OrderedDict[int, SceneSolver] = OrderedDict()
        self._change = self.create_client(SetBoxes, 'contact_node/set_boxes', qos_profile=REQUESTS)
        self.create_subscription(MultiDOFJointState, 'poses', self._keep_sent, DEEP)
        self.create_subscription(Contacts, 'contacts', self._keep_told, DEEP, raw=True)

    def _keep_sent(self, message: MultiDOFJointState) -> None:
        stamp = message.header.stamp
        self.sent[stamp.sec * 10**9 + stamp.nanosec] = message

    def _keep_told(self, data: bytes) -> None:
        read = read_contacts(data)
        self.told[read.stamp] = read

    def wait(self, executor: Any, done: Any, seconds: float = PATIENCE) -> bool:
        """Serve until `done()`; return whether it is."""
        deadline = time.monotonic() + seconds
        while not done() and time.monotonic() < deadline:
            spin_once(self, executor, 0.02)
        return bool(done())

    def change(self, executor: Any, revision: int) -> None:
        """Change the yard, for the scene that is known; raise TimeoutError for no answer."""
        request = self.yard.change()
        request.expected_revision = revision - 1
        self.scenes[revision] = self.yard.now()
        if not self._change.wait_for_service(PATIENCE):
            raise TimeoutError('no service ~/set_boxes')
        future = self._change.call_async(request)
        if not self.wait(executor, future.done):
            raise TimeoutError(f'change {revision} has no answer')
        answer = future.result()
        if not answer.success or answer.revision != revision:
            raise ValueError(f'change {revision}: {answer.message or answer.revision}')
        self.acknowledged.append(time.time_ns())

    def judge(self) -> None:
        """Compare the answers whose questions are known."""
        for stamp in [stamp for stamp in self.told if stamp in self.sent]:
            fault = self._fault(stamp, self.sent.pop(stamp), self.told.pop(stamp))
            if fault:
                self.wrong.append(f'revision {len(self.acknowledged)}, stamp {stamp}: {fault}')
            self.judged += 1

    def _solver(self, revision: int) -> SceneSolver:
        if revision not in self._solvers:
            self._solvers[revision] = SceneSolver(self.scenes[revision])
            if len(self._solvers) > KEPT_SOLVERS:
                self._solvers.popitem(last=False)
        return self._solvers[revision]

    def _fault(self, stamp: int, sent: MultiDOFJointState, told: ReadContacts) -> str:
        """Return in what an answer differs from that of a new solver, or ''."""
        known = bisect.bisect_right(self.acknowledged, stamp)
        if told.revision < known:
            behind = stamp - self.acknowledged[told.revision]
            self.worst = max(self.worst, behind)
            self.late += behind > LATE * 1e9
        poses = {name: (t.translation.x, t.translation.y, t.translation.z, t.rotation.x,
                        t.rotation.y, t.rotation.z, t.rotation.w)
                 for name, t in zip(sent.joint_names, sent.transforms)}
        solver = self._solver(told.revision)
        answer = solver([poses.get(name) for name in solver.moving])
        named = [(pair.label, pair.a, pair.b) for pair, _ in answer.named()]
        self.contacts += len(named)
        if told.names != named:
            return f'{told.names} instead of {named}'
        for field in ('separation', 'point', 'normal', 'volume', 'covariance'):
            if not np.array_equal(getattr(told.contacts, field), getattr(answer.contacts, field)):
                return f'another {field}'
        pairs = [answer.scene.pair_of(*boxes) for boxes in answer.stale.tolist()]
        stale = [pair.label if pair.a != pair.b else pair.a for pair in pairs]
        return '' if told.stale == stale else f'stale {told.stale} instead of {stale}'


def resident(process: int) -> float:
    """Return the resident memory of a process [kB]."""
    pages = Path(f'/proc/{process}/statm').read_text('utf-8').split()[1]
    return int(pages) * os.sysconf('SC_PAGE_SIZE') / 1024


def slope_of(memory: np.ndarray) -> float:
    """Return by how much memory grows a change [kB], from a quarter of all changes on."""
    rest = memory[len(memory) // 4:]
    return float(np.polyfit(np.arange(len(rest)), rest, 1)[0])


def serve(executor: str, scene: str) -> int:
    """Run a contact node in an executor until its process is ended."""
    rclpy.init(args=['--ros-args', '-p', f'scene:={scene}', '-p', 'pair_topics:=false',
                     '--log-level', 'error'])
    node = ContactNode()
    node.start()
    spinner = EXECUTORS[executor]()
    spinner.add_node(node)
    with contextlib.suppress(ExternalShutdownException):
        while rclpy.ok():
            spinner.spin_once(timeout_sec=0.5)
    return 0


def play(executor: str, *, changes: int, kills: int, rate: float, seed: int) -> bool:
    """Play a yard; print what was found, and return whether all was right."""
    # colcon's tests run where no folder of Python's path has benchmarks/.
    own = ['-c', f'import sys; sys.path.append({str(ROOT)!r}); '
                 'from benchmarks.yard_clients import main; sys.exit(main(sys.argv[1:]))']
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as ending:
        file = Path(folder) / 'yard.yaml'
        file.write_text(yaml.safe_dump(YARD), 'utf-8')
        node = ending.enter_context(running([*own, '--serve', executor, str(file)]))
        yard = Yard(read_scene(file), seed)
        judge, spinner = ending.enter_context(running_node(lambda context: Judge(context, yard)))
        starts = [round(k * changes / (kills + 1)) for k in range(kills + 1)]
        sender = ending.enter_context(contextlib.ExitStack())
        process, hangs, memory = None, 0, np.zeros(changes)
        for revision in range(1, changes + 1):
            began = time.monotonic()
            if revision - 1 in starts:
                if process is not None:
                    process.kill()
                sender.close()
                process = sender.enter_context(running([*own, '--sender', str(rate)]))
                before = judge.judged
                if not judge.wait(spinner, lambda: judge.judge() or judge.judged > before):  # noqa: B023
                    hangs += 1
            judge.change(spinner, revision)
            memory[revision - 1] = resident(node.pid)
            before = judge.judged
            judge.wait(spinner, lambda: False, began + 1.0 / CHANGES_PER_SECOND - time.monotonic())
            judge.judge()
            if judge.judged == before and not judge.wait(
                    spinner, lambda: judge.judge() or judge.judged > before):  # noqa: B023
                hangs += 1
        judge.wait(spinner, lambda: False, 1.0)
        judge.judge()
        sender.close()
        unanswered = len(judge.sent)
    print(f'{executor}, {rate:g} Hz: {changes} changes {dict(sorted(yard.kinds.items()))}, '
          f'{judge.judged} answers with {judge.contacts} contacts, {len(judge.wrong)} wrong, '
          f'{judge.late} late (at most {1e-6 * judge.worst:.0f} ms behind a change), '
          f'{unanswered} without an answer, {hangs} hangs, {slope_of(memory):.2f} kB a change',
          flush=True)
    for line in judge.wrong[:3]:
        print(line)
    return (not judge.wrong and not judge.late and not hangs and judge.contacts > changes
            and slope_of(memory) < SLOPE)


def main(args: Sequence[str] | None = None) -> int:
    """Print the figures; 0 only if all is right."""
    words = list(sys.argv[1:] if args is None else args)
    if words[:1] == ['--serve']:
        return serve(*words[1:])
    if words[:1] == ['--sender']:
        return run_node(lambda context: Sender(context, float(words[1])), [])
    parser = program_parser('yard_clients', __doc__)
    parser.add_argument('--changes', type=int, default=2000)
    parser.add_argument('--kills', type=int, default=10, help='of the sender')
    parser.add_argument('--executors', nargs='+', default=list(EXECUTORS), choices=EXECUTORS)
    parser.add_argument('--seed', type=int, default=1)
    given = parser.parse_args(words)
    keep_to_this_host()
    right = [play(executor, changes=given.changes, kills=given.kills, seed=given.seed,
                  rate=20.0 if executor == 'multi' else 100.0) for executor in given.executors]
    return int(not all(right))


if __name__ == '__main__':
    sys.exit(main())
