# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contact node as a class: wires parameters, topics, ticks and services."""
from __future__ import annotations

import gc
from collections import Counter
from collections.abc import Generator, Iterator, Mapping, Sequence
from typing import Any, ClassVar

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockChange, JumpThreshold, TimeJump
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from box_contact_msgs.srv import Check, CheckPath, GetBoxes, SetBoxes

from ..models.make_model import make_model, most_near
from ..scene.scene import Scene, two_boxes
from ..scene.scene_check import Pose
from ..scene.scene_file import read_scene
from ..scene.scene_solver import SceneSolver
from ..solver.checks import short_repr
from ..solver.model import NATIVE
from ..stream.pairing import RESETS
from ..stream.streams import watched_of
from . import check, check_path, get_boxes, set_boxes
from .check import CheckAnswerer
from .diagnostics import DIAGNOSTICS_SECONDS, Diagnostics, TickMonitor
from .get_boxes import Lister
from .paced_service import NotActive, Outdated, PacedService
from .parameters import CONTACT_PARAMETERS, Setting, declare, model, reason_of, warn_of_unknown
from .rclpy_workarounds import ends_within, lifecycle_state
from .runtime import END_SECONDS, LOG_SECONDS, GuardedNode, run_node
from .tick import TickAnswerer
from .topics import SceneTopics

TICK_SECONDS = 0.1
"""A report waits so long for a tick, behind which it comes: one takes 0.4 ms."""
NAMED_TOPICS = 3  # how many pose topics the node names when it is ready


def live_model(name: str, value: Any) -> str:
    """Validate the name of a model that a running node takes: one in C++, ready at once."""
    if model(name, value) not in NATIVE:
        raise ValueError(f'{name} {value!r} needs a new start: a running node takes '
                         f'{" or ".join(NATIVE)}')
    return str(value)


LIVE = {'model': live_model} | {
    name: CONTACT_PARAMETERS[name].validate for name in ('tolerance', 'max_age')}
"""The parameters that may be set while the node runs, and what they may be then; none of them
touches a topic."""


def scene_of(values: Mapping[str, Any]) -> Scene:
    """Return the scene that checked parameters tell, or raise ValueError."""
    if not values['scene']:
        return two_boxes(values['size_a'], values['size_b'])
    for name in ('size_a', 'size_b'):
        if values[name] != CONTACT_PARAMETERS[name].default:
            raise ValueError(f'{name} {short_repr(values[name])} has no effect while scene is set: '
                             'write sizes into the scene file')
    return read_scene(values['scene'])


def keep_from_collections() -> None:
    """Keep what there is: no full collection of garbage (10 ms and more) looks at it any more."""
    gc.collect()
    gc.freeze()


class ContactNode(GuardedNode, LifecycleNode):
    """Wires parameters, topics, ticks and diagnostics to the states of a lifecycle node.

    `start` configures and activates it. A SingleThreadedExecutor may serve it, beside other nodes,
    as `rclpy.spin` does. An EventsExecutor has to be spun with a timeout, as `runtime.spin` does:
    without one, it hangs. A MultiThreadedExecutor is too slow for 100 ticks a second.

    A node on another method derives from this one. It sets `name`, the `prefix` of its contact
    topics and its `parameters` (all of these but `model`), and names the model.
    """

    name: ClassVar[str] = 'contact_node'
    prefix: ClassVar[str] = ''
    parameters: ClassVar[Mapping[str, Setting]] = CONTACT_PARAMETERS
    has_process = False
    """Whether the whole process is the node's, as of `run`."""

    def __init__(self, context: Context | None = None, **options: Any) -> None:
        """Begin unconfigured. context: rclpy's own where none is given; `options` go to Node."""
        super().__init__(self.name, context=context, **options)
        self.autostart: bool = declare(
            self, {'autostart': self.parameters['autostart']})['autostart']
        self.counts: Counter[str] = Counter()
        self.fault: Exception | None = None  # why the last transition failed
        self._monitor = TickMonitor()
        self._diagnostics = Diagnostics(self, self.counts, self._monitor)
        self._values: dict[str, Any] = {}
        self._topics: SceneTopics | None = None  # from configure to cleanup
        self._answerer: TickAnswerer | None = None  # likewise
        self._check_answerer: CheckAnswerer | None = None  # of the solver's scene and model
        self._lister: Lister | None = None  # from configure on
        self.add_on_set_parameters_callback(self._set_live)
        self._checks = PacedService(self, self.counts, 'checks', (Check, '~/check'), self._check,
                                    check.kind_and_size, is_timed=True)
        PacedService(self, self.counts, 'paths', (CheckPath, '~/check_path'), self._check_path,
                     check_path.kind_and_size)
        self._taken: SetBoxes.Request | None = None  # the last request of ~/set_boxes
        self._warnings: list[str] = []  # of that request
        PacedService(self, self.counts, 'changes', (SetBoxes, '~/set_boxes'), self._set_boxes,
                     set_boxes.kind_and_size, in_turn=True)
        PacedService(self, self.counts, 'listings', (GetBoxes, '~/get_boxes'), self._get_boxes,
                     get_boxes.kind_and_size, pause=1.0)
        self.create_service(Trigger, '~/reset', self.answered(self._reset, '~/reset'))
        # On a clock of its own: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DIAGNOSTICS_SECONDS, self._report_soon, clock=steady)
        self._is_due = False  # whether a report waits for a tick
        self._overdue = self.create_timer(TICK_SECONDS, self._report_at_last, clock=steady)
        self._overdue.cancel()
        self._jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                          on_clock_change=True), post_callback=self._clock_jumped)

    @staticmethod
    def model_of(values: Mapping[str, Any]) -> str:
        """Return the name of the model that checked parameters ask for."""
        return str(values['model'])

    def start(self) -> None:
        """Configure and activate; raise what keeps the node from it."""
        for transition in (self.trigger_configure, self.trigger_activate):
            if transition() != TransitionCallbackReturn.SUCCESS:
                raise self.fault or ValueError('the node did not start')

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read parameters and scene, make solver and topics.

        SUCCESS: inactive. FAILURE, with the reason logged: unconfigured, without topics.
        """
        try:
            self._configure()
        except Exception as error:  # rclpy would swallow it
            self.fault = error
            if self.context.ok():  # else a signal has ended it meanwhile
                self.get_logger().error(f'not configured: {reason_of(error)}')
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer poses. SUCCESS: active."""
        if self.has_process:
            keep_from_collections()
        self._monitor.restart(watched_of(self._tick.solver.scene))
        self._tick.active = True
        self._say_ready()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer no poses, and forget those that wait. SUCCESS: inactive."""
        self._tick.active = False
        self._tick.reset()
        self.get_logger().info('inactive: no pose is answered')
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let go of solver and topics; counts go on. SUCCESS: unconfigured."""
        assert self._topics is not None
        self._topics.close()
        self._topics = self._answerer = None
        self.get_logger().info('unconfigured: no pose is answered')
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer no poses; `destroy_node` does the rest. SUCCESS: finalized."""
        if self._answerer is not None:
            self._answerer.active = False
        return super().on_shutdown(state)

    @property
    def _tick(self) -> TickAnswerer:
        """Return what answers the ticks of a node that is configured."""
        assert self._answerer is not None
        return self._answerer

    def _configure(self) -> None:
        values = declare(self, self.parameters, live=LIVE)
        scene = scene_of(values)
        solver = self._make_solver(values, scene)
        topics = SceneTopics(self, self.prefix, scene, pair_topics=values['pair_topics'])
        try:
            answerer = TickAnswerer(solver, topics, values, self.counts, self._monitor)
            topics.subscribe(scene, answerer.callback_of)
        except Exception:
            topics.close()
            raise
        warn_of_unknown(self, self.parameters)
        self._values, self._topics, self._answerer = values, topics, answerer
        self._taken, self._lister = None, Lister(answerer.epoch)
        topics.boxes.publish(set_boxes.boxes_message(answerer.epoch, solver, None))

    def _make_solver(self, values: Mapping[str, Any], scene: Scene) -> SceneSolver:
        """Return the solver that checked parameters ask for, or raise ValueError."""
        name = self.model_of(values)
        return SceneSolver(scene, model=make_model(name), margin=values['margin'],
                           most_near=most_near(name))

    def _set_live(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        """Take new values of LIVE, all or none; rclpy refuses those that are read-only."""
        try:
            checks = LIVE if self._answerer is not None else {
                name: setting.validate for name, setting in self.parameters.items()}
            given = {parameter.name: checks[parameter.name](parameter.name, parameter.value)
                     for parameter in parameters if parameter.name in LIVE}
            values = {**self._values, **given}
            if self._answerer is not None and given:
                if 'model' in given and given['model'] != self._values['model']:
                    name = given['model']
                    self._answerer.set_solver(self._answerer.solver.with_model(
                        make_model(name), most_near(name)))
                self._answerer.set_times(values)
        except Exception as error:  # the client would wait for ever
            return SetParametersResult(successful=False, reason=reason_of(error))
        self._values = values
        return SetParametersResult(successful=True)

    def _say_ready(self) -> None:
        """Log what the node works on."""
        assert self._topics is not None
        solver, topics = self._tick.solver, self._topics.pose_topics()
        scene = solver.scene
        pairs, more = scene.pair_count, len(topics) - NAMED_TOPICS
        frame = f' in frame {short_repr(scene.frame_id)}' if scene.frame_id else ''
        self.get_logger().info(
            f'ready: model {self.model_of(self._values)!r}, pairing '
            f'{self._values["pairing"]!r}, {pairs} {"pair" if pairs == 1 else "pairs"}; '
            f'poses{frame} from {", ".join(topics[:NAMED_TOPICS])}'
            f'{f" and {more} more" if more > 0 else ""}')

    def _configured(self) -> TickAnswerer:
        """Return what answers the ticks; raise NotActive."""
        if self._answerer is None:
            raise NotActive
        return self._answerer

    def _check(self, request: Check.Request, response: Check.Response) -> Iterator[None]:
        """Answer on the node's scene and model; ticks know nothing of it."""
        checker = yield from self._checker()
        yield from checker.answer(request, response, self._last_poses(request))

    def _check_path(self, request: CheckPath.Request, response: CheckPath.Response,
                    ) -> Iterator[None]:
        """Answer on the node's scene; ticks know nothing of it."""
        checker = yield from self._checker()
        yield from check_path.answer(checker.check, self._tick.epoch, request, response,
                                     self._last_poses(request))

    def _checker(self) -> Generator[None, None, CheckAnswerer]:
        """Return what answers questions about the scene as it is now."""
        answerer, checker = self._configured(), self._check_answerer
        if checker is None or checker.solver is not answerer.solver:
            checker = self._check_answerer = CheckAnswerer(
                answerer.solver, self.model_of(self._values), answerer.epoch)
            yield
        return checker

    def _last_poses(self, request: Check.Request | CheckPath.Request) -> Mapping[str, Pose] | None:
        """Return the last poses of what moves, for a request that asks for them."""
        return self._tick.last_poses() if request.last_poses else None

    def _get_boxes(self, request: GetBoxes.Request, response: GetBoxes.Response) -> Iterator[None]:
        """Tell some boxes of the scene."""
        solver = self._configured().solver
        assert self._lister is not None
        yield from self._lister.answer(solver, self.model_of(self._values), request, response)

    def _set_boxes(self, request: SetBoxes.Request, response: SetBoxes.Response,
                   ) -> Iterator[None]:
        """Change boxes of the scene, all or none; the next poses are answered by the new scene."""
        answerer, topics = self._configured(), self._topics
        assert topics is not None
        former = answerer.solver
        response.epoch, response.revision = answerer.epoch, former.revision
        if self._taken is not None and set_boxes.is_same(request, self._taken):
            response.warnings = self._warnings
            return
        set_boxes.check_expected(request, answerer.epoch, former.revision)
        solver, warnings = yield from set_boxes.changing(former, request)
        writer = answerer.writer_of(solver)
        yield
        if self._answerer is not answerer or answerer.solver is not former:
            raise Outdated('the node was configured anew, or took another model, meanwhile')
        answerer.set_writer(writer)
        self._monitor.watch(watched_of(solver.scene))
        self._taken, self._warnings = request, warnings
        response.warnings, response.revision = warnings, solver.revision
        yield
        topics.boxes.publish(set_boxes.boxes_message(answerer.epoch, solver, request))
        if self.has_process and set_boxes.size_of_request(request) > set_boxes.STEP:
            yield
            keep_from_collections()

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Forget all poses and stamps: a simulation begins anew."""
        if self._answerer is None:
            response.message = str(NotActive())
            return response
        self._answerer.reset()
        response.success, response.message = True, 'all poses and stamps are forgotten'
        return response

    def _clock_jumped(self, jump: TimeJump) -> None:
        if self._answerer is not None:
            self.counts[RESETS] += 1
            self._answerer.reset()
            cause = ('/clock was set back' if jump.clock_change == ClockChange.ROS_TIME_NO_CHANGE
                     else 'use_sim_time was changed')
            self.get_logger().warning(f'time went back: {cause}; a new time begins',
                                      throttle_duration_sec=LOG_SECONDS)

    def _report_soon(self) -> None:
        """Report once the next tick is answered: no tick waits for it then. Or without ticks."""
        self._is_due = True
        if self._answerer is not None:
            self._answerer.after = self._report
        self._overdue.reset()

    def _report_at_last(self) -> None:
        """Report if no tick came meanwhile. If another callback cancels the timer, rclpy raises."""
        self._overdue.cancel()
        if self._is_due:
            self._report()

    def _report(self) -> None:
        """Publish diagnostics."""
        self._is_due = False
        if self._answerer is not None:
            self._answerer.after = None
        state = lifecycle_state(self)
        if self._answerer is None or self._topics is None:
            self._diagnostics.publish(state=state, values={'pairs': 0})
        else:
            self._diagnostics.report(
                state, self._answerer.solver.scene, self.model_of(self._values),
                self._answerer.pairing, self._topics, self._answerer.take_lost(),
                self._checks.take_times())


def run(node_type: type[ContactNode], args: Sequence[str] | None) -> int:
    """Run a node of this class until SIGINT or SIGTERM; return the exit status."""
    def started(context: Context) -> ContactNode:
        node = node_type(context)
        node.has_process = True
        try:
            if node.autostart:
                node.start()
            else:
                node.get_logger().info(
                    'autostart is false: the node waits for the transitions configure and '
                    f'activate; `ros2 lifecycle set {node.get_fully_qualified_name()} configure`')
        except Exception:  # whoever holds it would destroy it later, and without a guard
            with ends_within(END_SECONDS):
                node.destroy_node()
            raise
        return node
    return run_node(started, args)
