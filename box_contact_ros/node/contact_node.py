"""The contact node: box poses in, contact points and normals out.

Subscribes box_a/pose and box_b/pose (geometry_msgs/PoseStamped). Publishes contact/point
(PointStamped) and contact/normal (Vector3Stamped, from A to B) while the boxes touch, then
contacts (sensor_msgs/PointCloud2, one row per contact) on every evaluation, and /diagnostics.

With a scene file: <box>/pose of every moving box, and <pair>/contact/point, <pair>/contact/normal.
It is a lifecycle node that configures and activates itself, unless autostart is false.
"""
from __future__ import annotations

import gc
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.event_handler import (
    EventHandler,
    PublisherEventCallbacks,
    SubscriptionEventCallbacks,
    UnsupportedEventTypeError,
)
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import PointCloud2

from ..scene.pairing import NEVER, PAIRINGS, RESETS, StampedPose, Tick
from ..scene.scene_file import read_scene
from ..scene.scene_solver import Pair, Scene, SceneSolver, two_boxes
from ..solver.checks import shown
from ..solver.models import find_model, model_names
from .diagnostics import DIAGNOSTICS_SECONDS, UNMATCHED_SECONDS, Diagnostics
from .message_bytes import RawMessages
from .messages import Refused, TypedMessages
from .parameters import Setting, answer_help, checked, declare, flag, number, one_of, size, text
from .runtime import CONTACT_QOS, LOG_SECONDS, POSE_QOS, RCLError, run_node

SERIALIZATIONS = {'raw': RawMessages, 'typed': TypedMessages}
"""Values of the node parameter `serialization`."""


def model(name: str, value: Any) -> str:
    """One of the models."""
    find_model(name, text(name, value))
    return str(value)


CHANGES = ('total_count_change', 'current_count_change', 'not_alive_count_change')
"""What events count since they were last looked at, each some of these."""
TOPICS_OF_EVERY_NODE = ('/diagnostics', '/parameter_events', '/rosout', '/clock')
"""Topics of other types than poses."""
NAMED_TOPICS = 3
"""How many pose topics the node names when it is ready."""
CONTAINER = (12.192, 2.438, 2.591)  # ISO 40 ft [m]
LONGEST = 1e6  # s, about twelve days
PARAMETERS = {
    'size_a': Setting(CONTAINER, 'full extents of box A, three numbers > 0 [m]', size),
    'size_b': Setting(CONTAINER, 'full extents of box B, three numbers > 0 [m]', size),
    'scene': Setting('', 'scene file (or the scene itself, as text) with boxes and pairs; replaces '
                         'size_a and size_b; set again, it is read again', text),
    'model': Setting('mlp', f'how the contact point is found: {model_names()}', model),
    'weights': Setting('', 'weights file to use in place of the shipped one', text),
    'pairing': Setting('stamp', 'stamp: answer once, when poses of equal stamp are in; latest: '
                                "answer every pose with the other boxes' last", one_of(PAIRINGS)),
    'tolerance': Setting(0.0, 'with pairing stamp: stamps this far apart still belong together [s]',
                         number(0.0, LONGEST)),
    'max_age': Setting(1.0, 'a pose further than this from the tick, by their stamps, is stale: '
                            'its pairs are answered with NaN; longer than the slowest '
                            'period; 0: never [s]', number(0.0, LONGEST)),
    'deadline': Setting(0.0, 'quality of service asked of pose publishers, who must offer as much: '
                             'longest time between poses; 0: none [s]', number(0.0, LONGEST)),
    'pair_topics': Setting(True, 'whether pairs have topics of their own beside the cloud', flag),
    'serialization': Setting('raw', 'raw: read and write the bytes of messages; typed: message '
                                    'objects, slower, the reference', one_of(SERIALIZATIONS)),
    'autostart': Setting(True, 'whether the node configures and activates itself', flag,
                         fixed=True),
}


def nanoseconds(seconds: float) -> int:
    """Whole nanoseconds."""
    return round(1e9 * seconds)


def look_at(handler: EventHandler) -> None:
    """Call a handler that no executor serves, if there is something new.

    As rclpy 7.1 has it: what an executor would have found ready is taken.
    """
    handler._ready_to_take_data = True
    event = handler.take_data()
    if event is not None and any(getattr(event, change, 0) for change in CHANGES):
        handler.callback(event)


def _reason(error: Exception) -> str:
    """What was refused, in its own words; a model's library may be missing."""
    known = isinstance(error, (ValueError, ImportError))
    return str(error) if known else f'{type(error).__name__}: {error}'


def _unheard(_: Any) -> None:
    pass


class ContactNode(LifecycleNode):
    """Answers ticks of poses; every pose that is refused is counted and said, never answered.

    A node on another method derives from this one: it names itself, a prefix of its contact topics,
    its parameters (all of these but `model` and `weights`), and makes the solver from them.
    """

    name: ClassVar[str] = 'contact_node'
    prefix: ClassVar[str] = ''
    parameters: ClassVar[Mapping[str, Setting]] = PARAMETERS

    def __init__(self, context: Context, **options: Any) -> None:
        """Raises ValueError where parameters do not go together."""
        super().__init__(self.name, context=context, **options)
        self.counts: Counter[str] = Counter()
        self._settings = declare(self, self.parameters)
        self._solver: SceneSolver | None = None
        self._subscriptions_of: dict[str, Subscription] = {}
        self._events_of: dict[Publisher | Subscription, list[EventHandler]] = {}
        self._contacts: Publisher | None = None
        self._publishers_of: dict[int, tuple[Publisher, Publisher, Pair]] = {}  # by pair's id
        self._ids: dict[int, Pair] = {}
        self._active = self._started = False
        self._fault: Exception | None = None
        self._health = Diagnostics(self)
        self.add_on_set_parameters_callback(self._set_parameters)
        # On a clock of its own: simulated time may stand still.
        self.create_timer(DIAGNOSTICS_SECONDS, self._report, clock=Clock(
            clock_type=ClockType.STEADY_TIME))
        self._jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                          on_clock_change=True), post_callback=self._clock_jumped)
        if self._settings['autostart']:
            for transition in (self.trigger_configure, self.trigger_activate):
                if transition() != TransitionCallbackReturn.SUCCESS:
                    raise self._fault or ValueError('the node did not start')
        self._started = True
        # Last: whoever waits for it may end the node at once, in the middle of a transition.
        self._say_ready()

    # --- lifecycle -------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the scene, load and check the weights."""
        return self._attempt(lambda: self._apply(self._settings))

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start answering."""
        return self._attempt(self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop answering: poses are not listened to."""
        self._active = False
        self._unsubscribe(list(self._subscriptions_of))
        self._pairing.reset()
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let go of solver and topics."""
        self.counts.update(self._pairing.counts)
        self.counts['outside the trained range'] += self._solver.exact_answers
        self._let_go()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop for good."""
        self._active = False
        self._unsubscribe(list(self._subscriptions_of))
        return TransitionCallbackReturn.SUCCESS

    def _attempt(self, action: Callable[[], None]) -> TransitionCallbackReturn:
        self._fault = None
        try:
            action()
        except Exception as error:  # out of here, rclpy would swallow it
            self._fault = error
            if self._started or not self._settings['autostart']:  # else it is raised
                self.get_logger().error(_reason(error))
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def _activate(self) -> None:
        # Whatever start-up made stays for good: keep it out of later collections.
        gc.collect()
        gc.freeze()
        try:
            self._subscribe()
        except RCLError:
            self._unsubscribe(list(self._subscriptions_of))
            raise
        self._active = True

    def _let_go(self) -> None:
        self._unpublish([entry[2] for entry in self._publishers_of.values()])
        if self._contacts is not None:
            self._end_events(self._contacts)
            self.destroy_publisher(self._contacts)
        self._contacts = self._solver = None

    def destroy_node(self) -> None:
        """Leave the network: events that are looked at would keep their topics there."""
        for handlers in self._events_of.values():
            for handler in handlers:
                handler.destroy()
        self._events_of.clear()
        super().destroy_node()

    def _say_ready(self) -> None:
        if self._solver is None:
            self.get_logger().info('unconfigured: autostart is false')
            return
        self._say('ready')

    def _say(self, what: str) -> None:
        scene = self._solver.scene
        pairs = len(scene.pairs)
        topics = [subscription.topic_name for subscription in self._subscriptions_of.values()
                  ] or ['nowhere, as the node is not active']
        entry, _ = find_model('model', self._solver.model)
        if self._settings.get('weights') and not entry.reads_weights:
            self.get_logger().warning(f'model {self._solver.model!r} uses no weights: '
                                      f'{shown(self._settings["weights"])} is ignored')
        elif self._solver.model == 'mlp' and self._solver.sizes_answered_exactly:
            self.get_logger().warning(
                f'pairs of sizes that the weights are not for: '
                f'{self._solver.sizes_answered_exactly}; the exact model answers them')
        more = len(topics) - NAMED_TOPICS
        frame = f' in frame {shown(scene.frame_id)}' if scene.frame_id else ''
        self.get_logger().info(
            f'{what}: model {self._solver.model!r}, pairing {self._settings["pairing"]!r}, '
            f'{pairs} {"pair" if pairs == 1 else "pairs"}; poses{frame} from '
            f'{", ".join(topics[:NAMED_TOPICS])}{f" and {more} more" if more > 0 else ""}')

    # --- parameters ------------------------------------------------------------------------------

    @staticmethod
    def make_solver(settings: Mapping[str, Any], scene: Scene) -> SceneSolver:
        """The solver that checked parameters ask for; ValueError if there is none."""
        return SceneSolver(scene, model=settings['model'], weights=settings['weights'] or None)

    def _set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        changes = {p.name: p.value for p in parameters if p.name in self.parameters}
        try:
            settings = checked(self.parameters, {**self._settings, **changes})
            # A scene that is set again may be another one by now.
            if self._solver is not None and (settings != self._settings or 'scene' in changes):
                self._apply(settings)
                self._say('changed')
            self._settings = settings
        except Exception as error:  # whoever asked would wait for ever
            return SetParametersResult(successful=False, reason=_reason(error))
        return SetParametersResult(successful=True)

    def _apply(self, settings: dict[str, Any]) -> None:
        """Take settings over as a whole, or raise ValueError and keep the old.

        Boxes that stay keep their subscriptions and the poses that wait.
        """
        scene = (read_scene(settings['scene']) if settings['scene']
                 else two_boxes(settings['size_a'], settings['size_b']))
        self._check_ids(scene)
        self._check_topics(scene, settings['pair_topics'])
        solver = self.make_solver(settings, scene)
        old, old_settings = self._solver, self._settings
        try:
            self._take_over(solver, settings)
        except RCLError:
            if old is None:
                self._let_go()
            else:
                self._take_over(old, old_settings)
            raise
        if old is not None:
            self.counts['outside the trained range'] += old.exact_answers

    def _take_over(self, solver: SceneSolver, settings: dict[str, Any]) -> None:
        """Go over from one solver and its topics, or from none, to another."""
        scene, old, running = solver.scene, self._settings, self._solver is not None
        times = {'tolerance': nanoseconds(settings['tolerance']),
                 'max_age': nanoseconds(settings['max_age'])}
        if running and settings['pairing'] == old['pairing']:
            self._pairing.set_scene(scene)
            self._pairing.tolerance, self._pairing.max_age = times.values()
        else:
            if running:
                self.counts.update(self._pairing.counts)
            self._pairing = PAIRINGS[settings['pairing']](scene, **times)
        if not running or settings['serialization'] != old['serialization']:
            self._messages = SERIALIZATIONS[settings['serialization']]()
        kept = running and all(
            settings[name] == old[name] for name in ('serialization', 'deadline'))
        self._unsubscribe([
            box for box in self._subscriptions_of if not kept or box not in scene.moving
            or scene.boxes[box].pose_topic != self._solver.scene.boxes[box].pose_topic])
        self._solver, self._settings = solver, settings
        self._publish(running)
        if self._active:
            self._subscribe()
        self._ids |= {pair.id: pair for pair in scene.pairs if pair.name}

    def _check_ids(self, scene: Scene) -> None:
        for pair in scene.pairs:
            before = self._ids.get(pair.id, pair)
            if pair.name and pair != before:
                raise ValueError(f'scene: id {pair.id} of pair {pair.name} was given to '
                                 f'{before.name} ({before.a}, {before.b}) before: ids are never '
                                 f'used again while a node runs (start it anew)')

    def _check_topics(self, scene: Scene, pair_topics: bool) -> None:
        """Raise ValueError for names that, in this namespace and remapped, can be no topics'.

        Or that are of another type: the topics that the node itself has.
        """
        own = [f'{self.prefix}contacts', '~/transition_event', *TOPICS_OF_EVERY_NODE]
        if pair_topics:
            own += [f'{self._prefix(pair)}/{topic}' for pair in scene.pairs
                    for topic in ('point', 'normal')]
        taken = {self._resolved(topic) for topic in own}
        for box in scene.moving:
            topic = scene.boxes[box].pose_topic
            if self._resolved(topic) in taken:
                raise ValueError(f'scene: pose_topic {shown(topic)} of box {box} is a topic of '
                                 'this node that carries no poses')

    def _resolved(self, topic: str) -> str:
        """A topic's full name; ValueError if it can have none."""
        try:
            return self.resolve_topic_name(topic)
        except RCLError as error:
            reason = str(error).partition(', at ')[0]
            raise ValueError(f'scene: {shown(topic)}: {reason}') from error

    # --- topics ----------------------------------------------------------------------------------

    def _prefix(self, pair: Pair) -> str:
        """What the topics of a pair begin with."""
        return f'{self.prefix}{pair.name}{"/" if pair.name else ""}contact'

    def _publish(self, running: bool) -> None:
        """Publishers of the scene's pairs, and none else."""
        if not running:
            self._contacts = self.create_publisher(
                PointCloud2, f'{self.prefix}contacts', CONTACT_QOS)
            self._keep_events(self._contacts)
        wanted = self._solver.scene.pairs if self._settings['pair_topics'] else ()
        kept = set(wanted)
        self._unpublish([entry[2] for entry in self._publishers_of.values()
                         if entry[2] not in kept])
        for pair in wanted:
            if pair.id not in self._publishers_of:
                topic = self._prefix(pair)
                # No events: too many to look at. Who asks for another QoS is told by its own node.
                events = {'event_callbacks': PublisherEventCallbacks(use_default_callbacks=False)}
                self._publishers_of[pair.id] = (
                    self.create_publisher(PointStamped, f'{topic}/point', CONTACT_QOS, **events),
                    self.create_publisher(Vector3Stamped, f'{topic}/normal', CONTACT_QOS,
                                          **events), pair)

    def _unpublish(self, pairs: Sequence[Pair]) -> None:
        for pair in pairs:
            for publisher in self._publishers_of.pop(pair.id)[:2]:
                self.destroy_publisher(publisher)

    def _subscribe(self) -> None:
        """Listen to the scene's moving boxes that are not listened to."""
        deadline = self._settings['deadline']
        qos = QoSProfile(depth=POSE_QOS.depth, reliability=POSE_QOS.reliability,
                         **({'deadline': Duration(seconds=deadline)} if deadline else {}))
        for box in self._solver.scene.moving:
            if box in self._subscriptions_of:
                continue
            topic = self._solver.scene.boxes[box].pose_topic
            events: dict[str, Any] = {'matched': self._on_matched(box),
                                      'liveliness': self._on_liveliness(box),
                                      'message_lost': self._on_lost}
            if deadline:
                events['deadline'] = self._on_deadline(box)
            arguments = (PoseStamped, topic, self._pose_callback(box, topic), qos)
            try:
                subscription = self.create_subscription(
                    *arguments, raw=self._messages.raw,
                    event_callbacks=SubscriptionEventCallbacks(**events))
            except UnsupportedEventTypeError:  # depends on the middleware
                subscription = self.create_subscription(*arguments, raw=self._messages.raw)
            self._subscriptions_of[box] = subscription
            self._keep_events(subscription)

    def _unsubscribe(self, boxes: Sequence[str]) -> None:
        for box in boxes:
            subscription = self._subscriptions_of.pop(box)
            subscription.callback = _unheard  # of what is under way
            self._end_events(subscription)
            self.destroy_subscription(subscription)

    def _keep_events(self, entity: Publisher | Subscription) -> None:
        """Have events of what may go looked at once a second, and never served.

        If one waits in EventsExecutor's queue while its publisher or subscription goes, the process
        ends (SIGSEGV, rclpy 7.1: what the event holds is released without Python's lock).
        """
        self._events_of[entity], entity.event_handlers = entity.event_handlers, []
        for handler in self._events_of[entity]:
            self.remove_waitable(handler)

    def _end_events(self, entity: Publisher | Subscription) -> None:
        for handler in self._events_of.pop(entity, ()):
            look_at(handler)
            handler.destroy()

    def _on_deadline(self, box: str) -> Callable[[Any], None]:
        def callback(event: Any) -> None:
            self.counts['deadlines missed'] += event.total_count_change
            self.get_logger().warning(f'{box}: no pose within the deadline',
                                      throttle_duration_sec=LOG_SECONDS)
        return callback

    def _on_matched(self, box: str) -> Callable[[Any], None]:
        def callback(event: Any) -> None:
            # Those that came and went since the last look are in no count of the current ones.
            gone = event.total_count_change - event.current_count_change
            self.counts['publishers gone'] += gone
            if gone:
                self.get_logger().info(f'{box}: a publisher of its poses is gone, '
                                       f'{event.current_count} left')
        return callback

    def _on_liveliness(self, box: str) -> Callable[[Any], None]:
        def callback(event: Any) -> None:
            lost = max(0, event.not_alive_count_change)
            self.counts['liveliness lost'] += lost
            if lost:
                self.get_logger().warning(f'{box}: a publisher of its poses shows no life')
        return callback

    def _on_lost(self, event: Any) -> None:
        self.counts['lost in transport'] += event.total_count_change

    def _clock_jumped(self, _: Any) -> None:
        if self._solver is not None:
            self.counts[RESETS] += 1
            self._pairing.reset()

    # --- poses -----------------------------------------------------------------------------------

    def _pose_callback(self, box: str, topic: str) -> Callable[[Any], None]:
        def callback(message: Any) -> None:
            self.counts['poses'] += 1
            try:
                ticks = self._pairing.add(box, self._messages.read_pose(message))
            except Exception as error:
                self._refuse(error, topic)
                return
            for tick in ticks:
                try:
                    self._answer(tick)
                except Exception as error:  # one tick that is refused keeps back no other
                    self._refuse(error, topic)
        return callback

    def _answer(self, tick: Tick) -> None:
        stamp, frame_id = self._header_of(tick)
        started = time.perf_counter_ns()
        answer = self._solver([pose and pose.numbers for pose in tick])
        took = time.perf_counter_ns() - started
        messages = self._messages
        messages.begin(stamp, frame_id)
        for pair, contact in answer.touching:
            publishers = self._publishers_of.get(pair.id)
            if publishers is not None:
                publishers[0].publish(messages.point(contact))
                publishers[1].publish(messages.normal(contact))
        self._contacts.publish(messages.cloud(answer))
        # What nobody waits for comes last.
        stale = len(answer.stale)
        self._health.computed(took, evaluated=stale < len(self._solver.scene.pairs))
        counts = self.counts
        counts['contacts'] += len(answer.touching)
        counts['evaluations'] += 1
        counts['stale pairs'] += stale

    def _header_of(self, tick: Tick) -> tuple[int, str]:
        """The newest stamp [ns] of a tick and its frame; raises Refused if frames differ."""
        stamp, frame_id = NEVER, self._solver.scene.frame_id or None
        for pose in tick:
            if pose is not None:
                if frame_id is None:
                    frame_id = pose.frame_id
                elif pose.frame_id != frame_id:
                    raise Refused('frame_id differs', self._frames(tick, pose))
                if pose.stamp > stamp:
                    stamp = pose.stamp
        return stamp, frame_id

    def _frames(self, tick: Tick, odd: StampedPose) -> str:
        """Which frame a tick has, by the scene or the first box, and which the pose `odd`."""
        scene = self._solver.scene
        first, pose = next((box, pose) for box, pose in zip(scene.moving, tick) if pose is not None)
        one, frame = ('the scene', scene.frame_id) if scene.frame_id else (first, pose.frame_id)
        box = next(box for box, pose in zip(scene.moving, tick) if pose is odd)
        return f'{one} is in frame {shown(frame)}, {box} in {shown(odd.frame_id)}'

    def _refuse(self, error: Exception, topic: str) -> None:
        """Count and say it: a callback must not end the node, whatever happens."""
        refused = isinstance(error, Refused)
        self.counts[f'refused: {error.reason if refused else "internal error"}'] += 1
        text = f'{topic}: {error}' if refused else f'{type(error).__name__}: {error}'
        self.get_logger().warning(f'{text}; refused', throttle_duration_sec=LOG_SECONDS)

    # --- diagnostics -----------------------------------------------------------------------------

    def _report(self) -> None:
        """Once a second: say what happened since the last time."""
        for handlers in list(self._events_of.values()):
            for handler in handlers:
                look_at(handler)
        if self._solver is None:
            self._health.publish(self.counts, 0, ())
            return
        counts = self.counts + self._pairing.counts
        counts['outside the trained range'] += self._solver.exact_answers
        unanswered = self._health.publish(counts, len(self._solver.scene.pairs),
                                          self._pairing.stale())
        if unanswered > UNMATCHED_SECONDS:
            self.get_logger().warning(
                f'poses arrive, but none could be answered for {UNMATCHED_SECONDS:g} s (pairing '
                f'{self._settings["pairing"]!r}: do the stamps of all boxes agree?)',
                throttle_duration_sec=LOG_SECONDS)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    answer_help('contact_node', __doc__, PARAMETERS, args)
    return run_node(ContactNode, args)
