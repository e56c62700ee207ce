# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contact node: parameters, topics, evaluation and diagnostics, by states of a lifecycle."""
from __future__ import annotations

import gc
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from typing import Any, ClassVar

from rclpy.clock import Clock, ClockChange, JumpThreshold, TimeJump
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from ..scene.scene_solver import Scene, SceneSolver
from ..scene.stamp_pairing import RESETS
from ..solver.checks import shown
from ..solver.models import find_model
from .contact_program import PARAMETERS
from .declared_parameters import CheckedParameters
from .diagnostics import DIAGNOSTICS_SECONDS, Diagnostics
from .evaluator import SERIALIZATIONS, Evaluator
from .messages import ContactsMessage
from .named_files import NamedFiles, named_scene
from .parameters import Setting, reason_of
from .rclpy_workarounds import lifecycle_state, refuse_transitions
from .runtime import LOG_SECONDS, GuardedNode, give_back_memory
from .topics.scene_topics import SceneTopics
from .topics.tf_poses import check_frames
from .wrench_output import make_wrenches

NAMED_TOPICS = 3  # how many pose topics the node names when it is ready


def _refuse_boxes(settings: Mapping[str, Any], before: Mapping[str, Any]) -> None:
    """Raise ValueError for sizes and masses that change although a scene replaces them.

    One may be given again as it is: files of all parameters do so.
    """
    for kind in ('size', 'mass'):
        for name in (f'{kind}_a', f'{kind}_b'):
            if settings['scene'] and settings.get(name) != before.get(name):
                plural = {'size': 'sizes', 'mass': 'masses'}[kind]
                raise ValueError(f'{name} {shown(settings[name])} has no effect while scene is '
                                 f"set: write {plural} into the scene file, or set scene to ''")


class ContactNode(GuardedNode, LifecycleNode):
    """Wires parameters, topics, evaluation and diagnostics to the states of a lifecycle node.

    A node on another method derives from this one. It sets `name`, the `prefix` of its contact
    topics and its `parameters` (all of these but `model` and `weights`), and makes the solver.
    """

    name: ClassVar[str] = 'contact_node'
    prefix: ClassVar[str] = ''
    parameters: ClassVar[Mapping[str, Setting]] = PARAMETERS

    def __init__(self, context: Context, **options: Any) -> None:
        """Raise ValueError where parameters do not go together."""
        super().__init__(self.name, context=context, **options)
        self.counts: Counter[str] = Counter()
        self._evaluator: Evaluator | None = None  # from configure to cleanup
        self._settings = CheckedParameters(self, self.parameters, self._change)
        values = self._settings.values
        _refuse_boxes(values, {name: one.default for name, one in self.parameters.items()})
        if values['locked'] and not values['autostart']:
            raise ValueError('locked: a node that does not start itself could never be started')
        self._files = NamedFiles(self, values)
        self._topics = SceneTopics(self, self.prefix, self.counts)
        self._diagnostics = Diagnostics(self)
        # On a clock of its own: simulated time may stand still.
        self.create_timer(DIAGNOSTICS_SECONDS, self._report, clock=Clock(
            clock_type=ClockType.STEADY_TIME))
        self._jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                          on_clock_change=True), post_callback=self._clock_jumped)
        self._fault: Exception | None = None
        self._raises_faults = values['autostart']
        if self._raises_faults:
            for transition in (self.trigger_configure, self.trigger_activate):
                if transition() != TransitionCallbackReturn.SUCCESS:
                    raise self._fault or ValueError('the node did not start')
        self._raises_faults = False
        if values['locked']:
            refuse_transitions(self)
        if ContactsMessage is None:
            self.get_logger().warning('box_contact_msgs is not installed: contacts are published '
                                      'as contacts_cloud alone')
        # Last: a program that waits for this line may end the node at once.
        self._log_state('ready' if values['autostart'] else 'unconfigured')

    @staticmethod
    def make_solver(settings: Mapping[str, Any], scene: Scene) -> SceneSolver:
        """Return the solver that checked parameters ask for, or raise ValueError."""
        entry, _ = find_model('model', settings['model'])
        return SceneSolver(scene, model=settings['model'], weights=settings['weights'] or None,
                           margin=settings['margin'], most_near=entry.most_near)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the scene, load the weights, create the publishers.

        SUCCESS: inactive. FAILURE, with the reason logged: unconfigured, without topics.
        """
        if not self._attempt(lambda: self._apply(self._settings.values)):
            return TransitionCallbackReturn.FAILURE
        self._log_state('configured')
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe to poses.

        SUCCESS: active. FAILURE, with the reason logged: inactive, without subscriptions.
        """
        if not self._attempt(self._activate):
            return TransitionCallbackReturn.FAILURE
        self._log_state('ready')
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Unsubscribe, and forget the poses that wait. SUCCESS: inactive."""
        self._topics.deactivate()
        self._configured.reset()
        self._log_state('inactive')
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let go of solver and publishers; counts go on. SUCCESS: unconfigured."""
        self._configured.close()
        self._evaluator = None
        self._topics.close()
        self._log_state('unconfigured')
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Unsubscribe; `destroy_node` does the rest. SUCCESS: finalized."""
        self._topics.deactivate()
        self._log_state('finalized')
        return super().on_shutdown(state)

    def destroy_node(self) -> None:
        """Leave the network."""
        self._topics.events.close()
        super().destroy_node()

    @property
    def _configured(self) -> Evaluator:
        """Return the evaluator of a node that is configured."""
        assert self._evaluator is not None
        return self._evaluator

    def _attempt(self, action: Callable[[], None]) -> bool:
        """Return whether an action of a transition succeeded; keep and log its error."""
        self._fault = None
        try:
            action()
        except Exception as error:  # rclpy would swallow it
            self._fault = error
            if not self._raises_faults:
                self.get_logger().error(reason_of(error), throttle_duration_sec=LOG_SECONDS)
            return False
        return True

    def _activate(self) -> None:
        # What start-up made stays for good. No full collection (10 ms) has to look at it.
        gc.collect()
        gc.freeze()
        self._diagnostics.watch.restart()
        self._topics.activate(self._configured.pose_callback)

    def _change(self, settings: dict[str, Any], names: Collection[str]) -> None:
        """Apply parameters if one differs. A scene that is set again may differ in its file."""
        _refuse_boxes(settings, self._settings.values)
        if self._evaluator is not None and (
                settings != self._settings.values or 'scene' in names):
            self._apply(settings)
            if self.may_log('changed'):
                self._log_scene(f'changed {", ".join(sorted(names))}', settings)

    def _apply(self, settings: dict[str, Any]) -> None:
        """Apply parameters as a whole, or raise ValueError or RCLError and keep the old."""
        with self._files.resolved(settings, starts=self._raises_faults) as resolved:
            self._replace(resolved, named_scene(
                resolved, check=check_frames, limits=self._files.limits(settings)))

    def _replace(self, settings: Mapping[str, Any], scene: Scene) -> None:
        """Replace scene, solver and topics, or raise and keep the old.

        Boxes that stay keep their subscriptions and the poses that wait.
        """
        solver = self.make_solver(settings, scene)
        wrenches = make_wrenches(settings, solver)
        covered = wrenches.pairs if wrenches else ()
        self._topics.check(scene, pair_topics=settings['pair_topics'], wrenches=covered)
        self._topics.set_scene(scene, pair_topics=settings['pair_topics'],
                               cloud=settings['contacts_cloud'] or ContactsMessage is None,
                               raw=SERIALIZATIONS[settings['serialization']].raw,
                               deadline=settings['deadline'], wrenches=covered)
        if self._evaluator is None:
            self._evaluator = Evaluator(
                solver, wrenches, settings, topics=self._topics, counts=self.counts,
                diagnostics=self._diagnostics, logger=self.get_logger())
        else:
            self._evaluator.set_solver(solver, wrenches, settings)
            self._topics.tf.look_up()

    def _log_state(self, what: str) -> None:
        """Log a state that a transition has brought; the start itself logs its last one alone."""
        if self._raises_faults:
            return
        if what in ('configured', 'ready'):
            self._topics.warn_of_unused_qos()
            self._log_scene(what, self._settings.values)
        else:
            self.get_logger().info(f'{what}: no pose is answered')

    def _log_scene(self, what: str, settings: Mapping[str, Any]) -> None:
        """Log what the node works on, and warn of weights that the model does not use."""
        assert self._evaluator is not None
        logger = self.get_logger()
        solver, scene = self._evaluator.solver, self._evaluator.solver.scene
        entry, _ = find_model('model', solver.model)
        if settings.get('weights') and 'weights' not in entry.takes:
            logger.warning(f'model {solver.model!r} uses no weights: '
                           f'{shown(settings["weights"])} is ignored')
        pairs, topics = len(scene.pairs), self._topics.pose_topics()
        more = len(topics) - NAMED_TOPICS
        frame = f' in frame {shown(scene.frame_id)}' if scene.frame_id else ''
        named = ', '.join(topics[:NAMED_TOPICS]) or 'nowhere, as the node is not active'
        logger.info(f'{what}: model {solver.model!r}, pairing {settings["pairing"]!r}, '
                    f'{pairs} {"pair" if pairs == 1 else "pairs"}; poses{frame} from '
                    f'{named}{f" and {more} more" if more > 0 else ""}')

    def _clock_jumped(self, jump: TimeJump) -> None:
        if self._evaluator is not None:
            self.counts[RESETS] += 1
            self._evaluator.reset(time_only=True)
            cause = ('/clock was set back' if jump.clock_change == ClockChange.ROS_TIME_NO_CHANGE
                     else 'use_sim_time was changed')
            self.get_logger().warning(f'time went back: {cause}; a new time begins',
                                      throttle_duration_sec=LOG_SECONDS)

    def _report(self) -> None:
        """Serve QoS events, publish diagnostics and give memory back, once a second."""
        if self._topics.serve_events() and self._evaluator is not None:
            self._evaluator.desert()
        state = lifecycle_state(self)
        if self._evaluator is None:
            self._diagnostics.publish(self.counts, state=state, pairs=0)
        else:
            self._evaluator.report(state)
        give_back_memory()
