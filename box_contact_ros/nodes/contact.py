"""The contact node: two box poses in, contact point and normal out.

Subscribes box_a/pose and box_b/pose (geometry_msgs/PoseStamped). Publishes contact/point
(PointStamped) and contact/normal (Vector3Stamped, from A to B) while the boxes touch, then
contacts (sensor_msgs/PointCloud2, one row per contact) on every evaluation, and /diagnostics.
"""
from __future__ import annotations

import gc
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import PointCloud2

from ..checks import pose_fault, shown
from ..pairing import PAIRINGS
from ..solver import MODELS, ContactSolver, soup_divisions
from .messages import (
    StampedPose,
    header_fault,
    make_cloud,
    make_header,
    make_normal,
    make_point,
    read_pose,
)
from .parameters import Setting, answer_help, checked, declare, numbers, one_of, text
from .runtime import CONTACT_QOS, LOG_SECONDS, POSE_QOS, run_node


def model_name(name: str, value: Any) -> str:
    """One of the models, or soup-N."""
    return value if soup_divisions(text(name, value)) else one_of(MODELS)(name, value)


CONTAINER = (12.192, 2.438, 2.591)  # ISO 40 ft [m]
PARAMETERS = {
    'size_a': Setting(CONTAINER, 'full extents of box A, three numbers > 0 [m]', numbers(3)),
    'size_b': Setting(CONTAINER, 'full extents of box B, three numbers > 0 [m]', numbers(3)),
    'model': Setting('committee', f'how the contact point is found: {", ".join(MODELS)}',
                     model_name),
    'weights': Setting('', 'weights file to use in place of the shipped one', text),
    'pairing': Setting('stamp', 'stamp: answer once, when poses of equal stamp are in; latest: '
                                "answer every pose with the other box's last", one_of(PAIRINGS)),
}
PAIR = 0                  # id of the only pair
UNMATCHED_SECONDS = 1.0   # poses without a partner for this long are worth a warning


class ContactNode(Node):
    """Answers pairs of poses; every pose that is refused is counted and said, never answered.

    A node on another method derives from this one: it names itself, a prefix of its contact topics,
    its parameters (with `size_a`, `size_b` and `pairing`), and makes the solver from them.
    """

    name: ClassVar[str] = 'contact_node'
    prefix: ClassVar[str] = ''
    parameters: ClassVar[Mapping[str, Setting]] = PARAMETERS

    def __init__(self, context: Context, **options: Any) -> None:
        super().__init__(self.name, context=context, **options)
        self._settings: dict[str, Any] = {}
        self._apply(declare(self, self.parameters))
        self.add_on_set_parameters_callback(self._set_parameters)
        self.counts: Counter[str] = Counter()
        self._reported: Counter[str] = Counter()  # the counts of the last report
        self._waiting_since: float | None = None
        self._compute: list[float] = []
        self._point, self._normal, self._contacts = (
            self.create_publisher(kind, f'{self.prefix}{topic}', CONTACT_QOS)
            for kind, topic in ((PointStamped, 'contact/point'),
                                (Vector3Stamped, 'contact/normal'), (PointCloud2, 'contacts')))
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_timer(1.0, self._report)
        # Whatever start-up made stays for good: keep it out of later collections.
        gc.collect()
        gc.freeze()
        for box, topic in enumerate(('box_a/pose', 'box_b/pose')):
            self.create_subscription(PoseStamped, topic, self._pose_callback(box), POSE_QOS)
        self.get_logger().info(
            f'ready: model {self._solver.model!r}, pairing {self._settings["pairing"]!r}')

    @staticmethod
    def make_solver(settings: Mapping[str, Any]) -> ContactSolver:
        """The solver that checked parameters ask for; ValueError if there is none."""
        return ContactSolver(settings['size_a'], settings['size_b'], model=settings['model'],
                             weights=settings['weights'] or None)

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9

    def _set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        changes = {p.name: p.value for p in parameters if p.name in self.parameters}
        try:
            self._apply(checked(self.parameters, {**self._settings, **changes}))
        except (ValueError, ImportError) as error:  # a model's library may be missing
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, settings: dict[str, Any]) -> None:
        """Take settings over as a whole, or raise ValueError and keep the old."""
        if settings == self._settings:
            return
        solver = self.make_solver(settings)
        # Compiles, or loads, the kernels before they are needed. Only a corner overlaps: where
        # faces coincide, a soup takes seconds.
        corner = 0.49 * np.add(settings['size_a'], settings['size_b'])
        solver(np.eye(7)[6], np.array((*corner, 0, 0, 0, 1)))
        if settings['pairing'] != self._settings.get('pairing'):
            self._pairing = PAIRINGS[settings['pairing']]()
        self._solver, self._settings = solver, settings

    def _pose_callback(self, box: int) -> Any:
        def callback(message: PoseStamped) -> None:
            try:
                self._take(box, message)
            except Exception as error:  # a callback must not end the node, whatever happens
                self._refuse('internal error', f'{type(error).__name__}: {error}')
        return callback

    def _take(self, box: int, message: PoseStamped) -> None:
        self.counts['poses'] += 1
        fault = header_fault(message.header)
        if fault:
            self._refuse('bad header', f'box_{"ab"[box]}/pose: {fault}')
            return
        pose = read_pose(message)
        fault = pose_fault(pose.numbers)
        if fault:
            self._refuse('bad pose', f'box_{"ab"[box]}/pose: {fault}')
            return
        if self._waiting_since is None:
            self._waiting_since = self._now()
        pair = self._pairing.add(box, pose.stamp, pose)
        if pair is None:
            return
        a, b = pair
        self._waiting_since = None
        if a.frame_id != b.frame_id:
            self._refuse('frame_id differs',
                         f'box_a/pose is in frame {shown(a.frame_id)}, box_b/pose in '
                         f'{shown(b.frame_id)}')
            return
        self._answer(a, b)

    def _answer(self, a: StampedPose, b: StampedPose) -> None:
        started = self.get_clock().now().nanoseconds
        contact = self._solver(a.numbers, b.numbers)
        self._compute.append((self.get_clock().now().nanoseconds - started) * 1e-3)
        header = make_header(max(a.stamp, b.stamp), a.frame_id)
        if contact.colliding:
            self._point.publish(make_point(header, contact))
            self._normal.publish(make_normal(header, contact))
            self.counts['contacts'] += 1
        self._contacts.publish(make_cloud(header, [(PAIR, contact)]))
        self.counts['evaluations'] += 1

    def _refuse(self, reason: str, text: str) -> None:
        self.counts[f'refused: {reason}'] += 1
        self.get_logger().warning(f'{text}; refused', throttle_duration_sec=LOG_SECONDS)

    def _report(self) -> None:
        """Once a second: say what happened since the last time."""
        arrived = self.counts['poses'] - self._reported['poses']
        waiting = arrived > 0 and self._waiting_since is not None and (
            self._now() - self._waiting_since > UNMATCHED_SECONDS)
        if waiting:
            self.get_logger().warning(
                f'poses arrive, but none could be answered for {UNMATCHED_SECONDS:g} s (pairing '
                f'{self._settings["pairing"]!r}: do the stamps of both boxes agree?)',
                throttle_duration_sec=LOG_SECONDS)
        compute, self._compute = self._compute, []
        values = dict(self.counts)
        values['dropped: no partner'] = self._pairing.dropped
        values['rate [1/s]'] = len(compute)
        if compute:
            values |= {f'compute {name} [us]': f'{value:.1f}' for name, value in zip(
                ('p50', 'p99', 'max'), np.percentile(compute, (50, 99, 100)))}
        refused = sum(count - self._reported[name] for name, count in self.counts.items()
                      if name.startswith('refused'))
        self._reported = Counter(self.counts)
        level, message = DiagnosticStatus.OK, 'answering' if compute else 'no poses'
        if refused:
            level, message = DiagnosticStatus.WARN, 'poses refused'
        elif waiting:
            level, message = DiagnosticStatus.WARN, 'poses without a partner'
        status = DiagnosticStatus(
            level=level, name=f'{self.get_fully_qualified_name()}: contacts', message=message,
            hardware_id='none',
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])
        header = make_header(self.get_clock().now().nanoseconds, '')
        self._diagnostics.publish(DiagnosticArray(header=header, status=[status]))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    answer_help('contact_node', __doc__, PARAMETERS, args)
    return run_node(ContactNode, args)
