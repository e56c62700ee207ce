# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `service`: questions to ~/check beside an echo, and ticks beside a greedy planner.

`python -m benchmarks.service` starts a contact node of a yard of 2,000 fixed boxes, and an echo
node. The echo node answers each question with the response that the contact node gives, made
before. Both are asked in turn, so a disturbance hits both.

Then a planner asks for 4,095 contacts again and again. Beside it, a client in lockstep counts its
ticks, and another client sends poses at 100 Hz. The exit status is 0 only if all limits are met.
"""
from __future__ import annotations

import contextlib
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.context import Context
from rclpy.serialization import deserialize_message, serialize_message

from box_contact_msgs.msg import Box as BoxMessage
from box_contact_msgs.msg import Contacts
from box_contact_msgs.srv import Check
from box_contact_ros.arguments import program_parser
from box_contact_ros.bench.echo_node import raw_stamp, with_stamp
from box_contact_ros.node.check import CheckAnswerer
from box_contact_ros.node.messages import make_header, pose_message, set_pose
from box_contact_ros.node.runtime import GuardedNode, run_node, running_node, spin_once
from box_contact_ros.node.topics import DEEP_RELIABLE
from box_contact_ros.processes import keep_to_this_host, program, running
from box_contact_ros.scene.boxes import Box
from box_contact_ros.scene.scene import Scene
from box_contact_ros.scene.scene_file import read_scene
from box_contact_ros.scene.scene_solver import SceneSolver, finished

CUBE, COLUMNS, COUNT = (2.0, 2.0, 2.0), 50, 2000
FRAME = 'yard'
ON_ONE = np.array([3.0, 3.0, 1.9, 0.0, 0.0, 0.0, 1.0])
"""A pose 0.1 m deep in one box of the yard, and in no other."""
ASIDE = np.array([0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 1.0])  # far above
GREEDY = 91  # boxes of the planner in one place: 4,095 contacts
LIMITS = {'two boxes': 1.2, 'a box of the scene': 1.3, 'a guest': 1.3}
"""Most times as long as the echo, by p50."""
LEAST_SHARE = 0.75  # of the ticks in lockstep, beside the planner
RATE = 100.0  # [Hz]
PATIENCE = 60.0  # [s]
ROOT = Path(__file__).parents[1]


def yard() -> Scene:
    """Return one load, and the fixed boxes that it may meet."""
    boxes = {f's{n}': Box(CUBE, (3.0 * (n % COLUMNS), 3.0 * (n // COLUMNS), 0, 0, 0, 0, 1))
             for n in range(COUNT)}
    return Scene({'load': Box(CUBE), **boxes}, frame_id=FRAME, patterns=(('load', 's*'),))


def scene_text() -> str:
    """Return the scene file of the yard."""
    rows = [f'  {name}: {{size: {list(box.size)}'
            f'{f", pose: {list(box.pose)}" if box.pose else ""}}}' for name, box in
            yard().boxes.items()]
    return '\n'.join([f'frame_id: {FRAME}', 'boxes:', *rows, "pairs:\n  - {a: load, b: 's*'}\n"])


def a_box(name: str, pose: np.ndarray, size: Sequence[float] = (0.0, 0.0, 0.0)) -> BoxMessage:
    """Return a box of a request; without a size it is the scene's."""
    box = BoxMessage(name=name)
    box.size.x, box.size.y, box.size.z = size
    set_pose(box.pose, pose)
    return box


def request_of(*boxes: BoxMessage) -> Check.Request:
    """Return the request about boxes."""
    return Check.Request(header=make_header(0, FRAME), boxes=list(boxes))


QUESTIONS = {
    'two boxes': request_of(a_box('p', ASIDE, CUBE), a_box('q', ASIDE + 0.5, CUBE)),
    'a box of the scene': request_of(a_box('load', ON_ONE)),
    'a guest': request_of(a_box('p', ON_ONE, CUBE))}
PLAN = request_of(*(a_box(f'box {n}', ASIDE, CUBE) for n in range(GREEDY)))


class EchoNode(GuardedNode):
    """Answers each question with a response that was made before."""

    def __init__(self, context: Context) -> None:
        super().__init__('echo', context=context)
        answerer = CheckAnswerer(SceneSolver(yard()))
        for name, question in QUESTIONS.items():
            finished(answerer.answer(question, kept := Check.Response(success=True)))
            response = deserialize_message(serialize_message(kept), Check.Response)
            self.create_service(Check, service_of(name), lambda *_, response=response: response)


class Planner(GuardedNode):
    """Asks for 4,095 contacts, and again as soon as it has an answer."""

    def __init__(self, context: Context) -> None:
        super().__init__('planner', context=context)
        self._check = self.create_client(Check, 'contact_node/check')
        self._check.wait_for_service()
        self._ask()

    def _ask(self, *_: Any) -> None:
        self._check.call_async(PLAN).add_done_callback(self.guarded(self._ask, 'planner'))


def service_of(name: str) -> str:
    """Return the echo service of a question."""
    return f'echo/{name.replace(" ", "_")}'


class Asker(GuardedNode):
    """Asks questions, and sends poses of the load and counts their answers."""

    def __init__(self, context: Context) -> None:
        super().__init__('asker', context=context)
        self.answered: set[int] = set()  # stamps [ns]
        self.checks = 0  # that the contact node has answered, by its last report
        self._load = self.create_publisher(PoseStamped, 'load/pose', DEEP_RELIABLE)
        self._pose = serialize_message(pose_message(make_header(0, FRAME), ON_ONE))
        self.create_subscription(Contacts, 'contacts', self._keep, DEEP_RELIABLE, raw=True)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._count, 10)

    def _keep(self, data: bytes) -> None:
        self.answered.add(raw_stamp(data))

    def _count(self, report: DiagnosticArray) -> None:
        for entry in report.status[0].values:
            if entry.key == 'checks answered':
                self.checks = int(entry.value)

    def wait(self, executor: Any, done: Callable[[], bool], seconds: float = PATIENCE) -> bool:
        """Serve until `done()`; return whether it is."""
        deadline = time.monotonic() + seconds
        while not done() and time.monotonic() < deadline:
            spin_once(self, executor, 0.05)
        return done()

    def send(self) -> int:
        """Send the load's pose; return its stamp [ns]."""
        stamp = time.time_ns()
        self._load.publish(with_stamp(self._pose, stamp))
        return stamp

    def times(self, executor: Any, rounds: int) -> Mapping[str, np.ndarray]:
        """Return the times (rounds, 2) of each question by the contact node and the echo [s]."""
        node = self.create_client(Check, 'contact_node/check')
        echo = {name: self.create_client(Check, service_of(name)) for name in QUESTIONS}
        for client in (node, *echo.values()):
            if not client.wait_for_service(PATIENCE):
                raise TimeoutError(f'no service {client.service_name}')
        times = {name: np.zeros((rounds, 2)) for name in QUESTIONS}
        for row in range(-10, rounds):  # the first ones warm up
            for name, question in QUESTIONS.items():
                for column, client in enumerate((node, echo[name])):
                    begin = time.perf_counter()
                    future = client.call_async(question)
                    executor.spin_until_future_complete(future, PATIENCE)
                    if not future.result().success:
                        raise ValueError(f'{name}: {future.result().message}')
                    times[name][max(row, 0), column] = time.perf_counter() - begin
        return times

    def lockstep(self, executor: Any, seconds: float) -> float:
        """Return the ticks per second of a client that waits for each answer [Hz]."""
        begin, ticks = time.monotonic(), 0
        while time.monotonic() < begin + seconds:
            stamp = self.send()
            ticks += self.wait(executor, lambda: stamp in self.answered, 1.0)  # noqa: B023
        return ticks / (time.monotonic() - begin)

    def at_rate(self, executor: Any, ticks: int) -> int:
        """Send so many poses at RATE; return how many were answered."""
        begin, sent = time.monotonic(), []
        for tick in range(ticks):
            self.wait(executor, lambda: False, max(0.0, begin + tick / RATE - time.monotonic()))
            sent.append(self.send())
        self.wait(executor, lambda: self.answered.issuperset(sent), 2.0)
        return len(self.answered.intersection(sent))


def not_met(medians: Mapping[str, np.ndarray], share: float, lost: int) -> list[str]:
    """Return what is beyond its limit.

    medians: the times (2,) of each question, by the contact node and the echo.
    share: of the ticks in lockstep, beside the planner.
    lost: ticks at RATE that were not answered.
    """
    slow = [name for name, (node, echo) in medians.items() if node > LIMITS[name] * echo]
    return [*slow, *['lockstep'] * (share < LEAST_SHARE), *['ticks'] * (lost > 0)]


def main(args: Sequence[str] | None = None) -> int:
    """Print the figures; 0 only if all limits are met."""
    if (sys.argv[1:] if args is None else args) == ['--echo']:
        return run_node(EchoNode, [])
    if (sys.argv[1:] if args is None else args) == ['--planner']:
        return run_node(Planner, [])
    parser = program_parser('service', __doc__)
    parser.add_argument('--quick', action='store_true', help='a tenth of the questions and ticks')
    share = 0.1 if parser.parse_args(args).quick else 1.0
    keep_to_this_host()
    # colcon's tests run where no folder of Python's path has benchmarks/.
    own = ['-c', f'import sys; sys.path.append({str(ROOT)!r}); '
                 'from benchmarks.service import main; sys.exit(main(sys.argv[1:]))']
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as ending:
        file = Path(folder) / 'yard.yaml'
        file.write_text(scene_text(), 'utf-8')
        read_scene(file)
        ending.enter_context(running(program('node.run_contact_node', scene=str(file),
                                             pair_topics=False)))
        ending.enter_context(running([*own, '--echo']))
        asker, executor = ending.enter_context(running_node(Asker))
        medians = {name: 1e6 * np.median(both, axis=0)
                   for name, both in asker.times(executor, round(2000 * share)).items()}
        for name, (node, echo) in medians.items():
            print(f'{name}: {node:.0f} us, echo {echo:.0f} us, {node / echo:.2f} times as long '
                  f'(limit {LIMITS[name]})', flush=True)
        begin, before = time.monotonic(), asker.checks
        while not (asker.lockstep(executor, 0.5) and asker.checks > before):
            if time.monotonic() > begin + PATIENCE:
                raise TimeoutError('the contact node does not answer')
        alone = asker.lockstep(executor, 10 * share)
        ending.enter_context(running([*own, '--planner']))
        before = asker.checks
        if not asker.wait(executor, lambda: asker.checks > before):
            raise TimeoutError('the planner has no answer')
        beside = asker.lockstep(executor, 10 * share)
        ticks = round(500 * share)
        answered = asker.at_rate(executor, ticks)
    print(f'lockstep: {alone:.0f} ticks/s alone, {beside:.0f} beside the planner, '
          f'{beside / alone:.0%} (at least {LEAST_SHARE:.0%})\n'
          f'{RATE:g} Hz beside the planner: {answered} of {ticks} ticks answered')
    failed = not_met(medians, beside / alone, ticks - answered)
    print(f'not met: {", ".join(failed)}' if failed else 'all limits are met')
    return int(bool(failed))


if __name__ == '__main__':
    sys.exit(main())
