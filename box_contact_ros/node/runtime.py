"""What every node here needs from rclpy: an executor that keeps up, and a clean end."""
from __future__ import annotations

import atexit
import contextlib
import functools
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from .rclpy_workarounds import RCLError, ends_within, keep_for_ever

EventsExecutor: Any = None
with contextlib.suppress(ImportError):  # rclpy before 7.1.4
    from rclpy.experimental.events_executor import EventsExecutor

REFUSALS = (ValueError, rclpy.exceptions.ParameterException, RCLError)
"""What a node raises on parameters or arguments that it cannot start with."""
POSE_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Pose inputs: best effort matches every publisher; the depth bridges a second at 1 kHz, in which a
scene of a thousand pairs can be read."""
ARRAY_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Pose arrays, as pose inputs: a second at 100 Hz; 1,000 poses are 56 kB."""
CONTACT_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)  # contact outputs
LATCHED_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                         durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For what changes rarely: whoever subscribes later gets the last message."""
SPIN_SECONDS = 10.0
"""EventsExecutor hangs when it spins without a timeout, so it is spun in slices. Each leaves some
32 bytes behind in rclpy (7.1): of slices this long, 0.3 MB a day."""
END_SECONDS = 8.0  # for a clean end; launch kills after ten
NodeKind = TypeVar('NodeKind', bound=Node)
LOG_SECONDS = 1.0  # the same complaint is logged at most this often


def make_executor(context: Context) -> Any:
    """Return the executor that loses nothing at 1 kHz where rclpy has it, else the default one."""
    if EventsExecutor is None:
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def spin_for(executor: Any, seconds: float) -> None:
    """Serve callbacks for so long, or until the executor's context is shut down.

    It stays in the executor from one callback to the next: 5 µs less than `spin_once` for a tick of
    two poses. An exception of a callback is raised here.
    """
    # A new one each time: the executor leaves a callback with it.
    executor.spin_until_future_complete(Future(), seconds)


def let_callbacks_finish() -> None:
    """Keep this process's other threads from interrupting the one that calls this (Linux).

    Every reliable publish wakes two or three threads of the middleware. As batch threads they wait
    until this one is idle: docs/decisions/contact-node.md.
    """
    try:
        mine = threading.get_native_id()
        for name in os.listdir('/proc/self/task'):
            if int(name) != mine:
                with contextlib.suppress(ProcessLookupError):
                    os.sched_setscheduler(int(name), os.SCHED_BATCH, os.sched_param(0))
    except (AttributeError, OSError):  # another system, or it is not permitted: slower, no more
        pass


@contextlib.contextmanager
def interrupted_once() -> Iterator[Callable[[], None]]:
    """Let the first Ctrl-C raise KeyboardInterrupt, and ignore others until the process has ended.

    A further one would break the clean end that is under way. Yields a function that begins the
    end: from its call on Ctrl-C is ignored. Handlers of the caller's own stay.
    """
    if (threading.current_thread() is not threading.main_thread()  # only that one may
            or signal.getsignal(signal.SIGINT) is not signal.default_int_handler):
        yield lambda: None
        return
    ending = heard = False

    def interrupt(number: int, frame: object) -> None:
        nonlocal ending, heard
        if not ending:
            ending = heard = True
            raise KeyboardInterrupt

    def end() -> None:
        nonlocal ending
        ending = True

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield end
    finally:
        if not heard:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        # While the interpreter ends it takes its handlers back, and a signal would kill it.
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)


@contextlib.contextmanager
def joined(make_node: Callable[[Context], NodeKind], args: Sequence[str] | None = None, *,
           signals: SignalHandlerOptions = SignalHandlerOptions.NO,
           ) -> Iterator[tuple[NodeKind, Any]]:
    """Give a node and its executor in a context of their own; end all three afterwards.

    signals: which handlers of rclpy's are installed; none where the caller has its own. After a
    signal, whatever was under way fails; that is raised as ExternalShutdownException.
    """
    context = Context()
    node = executor = None
    with interrupted_once() as begin_end:
        # Handlers have to be asked for where the context is not the default one.
        rclpy.init(args=None if args is None else list(args), context=context,
                   signal_handler_options=signals)
        try:
            node = make_node(context)
            executor = make_executor(context)
            executor.add_node(node)
            yield node, executor
        except Exception as error:
            if context.ok():
                raise
            raise ExternalShutdownException from error
        finally:
            begin_end()
            with ends_within(END_SECONDS):
                if executor is not None:
                    executor.shutdown()
                    keep_for_ever(executor)
                if node is not None:
                    node.destroy_node()
                context.try_shutdown()


def spin(node: Node, executor: Any) -> None:
    """Serve a node until its context is shut down (SIGINT, SIGTERM, or `context.shutdown()`).

    An exception of a callback is logged and ends nothing.
    """
    while node.context.ok():
        try:
            spin_for(executor, SPIN_SECONDS)
        except ExternalShutdownException:
            raise
        except Exception as error:
            if not node.context.ok():  # it may fail at anything once a signal has ended it
                break
            # rclpy's own services are callbacks too, and raise on requests that they cannot read,
            # such as a parameter of an unknown type.
            node.get_logger().error(f'a request failed: {type(error).__name__}: {error}',
                                    throttle_duration_sec=LOG_SECONDS)


def refusals_end(main: Callable[..., int]) -> Callable[..., int]:
    """Decorate what returns an exit status: REFUSALS end it with one line and status 1."""
    @functools.wraps(main)
    def run(*args: Any, **options: Any) -> int:
        try:
            return main(*args, **options)
        except REFUSALS as error:
            print(f'error: {error}', file=sys.stderr)
            return 1
    return run


@refusals_end
def run_node(make_node: Callable[[Context], Node], args: Sequence[str] | None, *,
             undisturbed: bool = True) -> int:
    """Start a node and `spin`; return 0 after a clean end, 1 (and print why) if it cannot start.

    undisturbed: `let_callbacks_finish`.
    """
    try:
        with joined(make_node, args, signals=SignalHandlerOptions.ALL) as (node, executor):
            if undisturbed:
                let_callbacks_finish()
            spin(node, executor)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    return 0
