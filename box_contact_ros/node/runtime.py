# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every node here needs from rclpy: an executor that keeps up, and a clean end.

No callback ends a process: `GuardedNode` catches what those of topics, timers and futures raise;
`spin_for` and `spin_once` catch what those of rclpy's own services raise.
"""
from __future__ import annotations

import atexit
import contextlib
import functools
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer

from .parameters import reason_of
from .rclpy_workarounds import (
    RCLError,
    UnknownROSArgsError,
    ends_within,
    keep_for_ever,
    shut_down,
)

REFUSALS = (ValueError, rclpy.exceptions.ParameterException, RCLError)
"""What a node raises on parameters or arguments that it cannot start with."""
SPIN_SECONDS = 10.0
"""EventsExecutor hangs when it spins without a timeout (not reported), so it is spun in slices.
Each leaves some 32 bytes behind in rclpy (7.1): of slices this long, 0.3 MB a day."""
END_SECONDS = 8.0  # for a clean end; launch kills after ten
NodeKind = TypeVar('NodeKind', bound=Node)
EVENT_THREAD = 'dds.ev'  # begins the names of Fast DDS's threads for timed events
LONG = 86_400.0  # period of a timer that stands still [s]
LOG_SECONDS = 1.0  # the same complaint is logged at most this often


class GuardedNode(Node):
    """A node whose callbacks raise nothing: what one raises is logged, and the node goes on.

    Each request gets an answer, also where rclpy raises: its client would wait for ever.

    EventsExecutor ends the process with SIGSEGV where the callback of a future raises, as it does
    where a task raises: https://github.com/ros2/rclpy/issues/1641 (fixed in rolling). It raises
    what other callbacks raise, under two unthrottled lines that name no topic.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        """Begin as rclpy's node does."""
        super().__init__(*args, **options)
        for service in self.services:  # rclpy's own: parameters, and states of a lifecycle node
            service.callback = self.answered(service.callback, service.service_name)

    def create_subscription(self, msg_type: Any, topic: str, callback: Callable[..., None],
                            *args: Any, **options: Any) -> Subscription:
        """Subscribe; what the callback raises is logged under the topic."""
        return super().create_subscription(
            msg_type, topic, self.guarded(callback, topic), *args, **options)

    def create_timer(self, timer_period_sec: float, callback: Callable[[], None], *args: Any,
                     **options: Any) -> Timer:
        """Start a timer; what the callback raises is logged under the callback's name."""
        return super().create_timer(
            timer_period_sec, self.guarded(callback, getattr(callback, '__name__', 'timer')),
            *args, **options)

    def guarded(self, callback: Callable[..., None], what: str) -> Callable[..., None]:
        """Return a callback that raises nothing; `what` it serves stands before the logged cause.

        Refusals and other errors are each logged once per LOG_SECONDS, with the traceback at level
        debug.
        """
        @functools.wraps(callback)
        def guarded(*args: Any) -> None:
            try:
                callback(*args)
            except Exception as error:
                # A signal shuts the context down under whatever runs.
                if self.context.ok():
                    self._complain(what, error)
        return guarded

    def answered(self, callback: Callable[[Any, Any], Any], what: str) -> Callable[[Any, Any], Any]:
        """Return a service's callback that raises nothing: it answers with an empty response."""
        @functools.wraps(callback)
        def answered(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:
                if self.context.ok():
                    self._complain(what, error)
                return type(response)()  # nothing in it says success
        return answered

    def _complain(self, what: str, error: Exception) -> None:
        logger, line = self.get_logger(), f'{what}: {reason_of(error)}; ignored'
        # Two lines of code: rclpy refuses another severity from the same one.
        if isinstance(error, ValueError):  # a refusal
            logger.warning(line, throttle_duration_sec=LOG_SECONDS)
        else:
            logger.error(line, throttle_duration_sec=LOG_SECONDS)
        logger.debug(''.join(traceback.format_exception(error)), throttle_duration_sec=LOG_SECONDS)


def spin_for(node: Node, executor: Any, seconds: float) -> None:
    """Serve callbacks for so long, or until the node's context is shut down.

    It stays in the executor from one callback to the next: 5 µs less than `spin_once` for a tick of
    two poses. It returns early where a callback of rclpy's own raises.
    """
    with _complaints_of(node):
        # A new one each time: the executor leaves a callback with it.
        executor.spin_until_future_complete(Future(), seconds)


def spin_once(node: Node, executor: Any, seconds: float) -> None:
    """Serve one callback, or none if none is due within so long."""
    with _complaints_of(node):
        executor.spin_once(timeout_sec=seconds)


@contextlib.contextmanager
def _complaints_of(node: Node) -> Iterator[None]:
    """Log what a callback raises that is not the node's own, and go on.

    rclpy's own services are callbacks too, and raise on requests that they cannot read, such as a
    parameter of an unknown type.
    """
    try:
        yield
    except ExternalShutdownException:
        raise
    except Exception as error:
        if node.context.ok():  # it may fail at anything once a signal has ended it
            node.get_logger().error(f'a request failed: {type(error).__name__}: {error}',
                                    throttle_duration_sec=LOG_SECONDS)


def keep_events_from_interrupting() -> None:
    """Keep the middleware's threads for timed events from interrupting this process (Linux).

    Every reliable publish wakes one. As a batch thread it waits until its core is idle, or until
    its turn comes. Nothing that a tick needs comes through it; the threads that receive stay as
    they are: docs/contributing/node.md.
    """
    try:
        for task in Path('/proc/self/task').iterdir():
            with contextlib.suppress(ProcessLookupError, FileNotFoundError):
                if (task / 'comm').read_text().startswith(EVENT_THREAD):
                    os.sched_setscheduler(int(task.name), os.SCHED_BATCH, os.sched_param(0))
    except (AttributeError, OSError):  # another system, or it is not permitted: slower, no more
        pass


def _note_signals() -> list[int]:
    """Let Ctrl-C and SIGTERM do nothing any more but be noted; return the list they are noted in.

    KeyboardInterrupt may fall anywhere in rclpy: where a lock is held that the clean end needs, or
    in EventsExecutor, which then aborts the process. rclpy gives the handlers that it found back
    as the process ends: the default one of SIGTERM would kill it.
    """
    noted: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: noted.append(number))
    atexit.register(_ignore_signals)
    return noted


def _asked_to_end(noted: Sequence[int]) -> BaseException:
    """Return what says by which signal: SIGHUP comes as SIGTERM."""
    return KeyboardInterrupt() if signal.SIGINT in noted else ExternalShutdownException()


def _hang_up_as_terminated() -> None:
    """Let SIGHUP, which a terminal sends as it is closed, end the process as SIGTERM does.

    Not from a handler of Python's: it would run once EventsExecutor returns, seconds later.
    """
    if signal.getsignal(signal.SIGHUP) != signal.SIG_DFL:  # as `nohup` has it ignored
        return
    numbers, wakeup = os.pipe()
    os.set_blocking(wakeup, False)
    signal.set_wakeup_fd(wakeup, warn_on_full_buffer=False)
    signal.signal(signal.SIGHUP, lambda number, frame: None)

    def pass_on() -> None:
        while signal.SIGHUP not in os.read(numbers, 64):
            pass
        os.kill(os.getpid(), signal.SIGTERM)
    threading.Thread(target=pass_on, daemon=True).start()


def _ignore_signals() -> None:
    """Let no signal disturb the interpreter's end.

    It takes its handlers back: the next signal would kill the process. rclpy's thread for signals
    would use what the end destroys.
    """
    rclpy.signals.uninstall_signal_handlers()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


@contextlib.contextmanager
def running_node(make_node: Callable[[Context], NodeKind], args: Sequence[str] | None = None, *,
                 signals: SignalHandlerOptions = SignalHandlerOptions.NO,
                 ) -> Iterator[tuple[NodeKind, Any]]:
    """Give a node and its executor in a context of their own; end all three afterwards.

    signals: which handlers of rclpy's are installed; none where the caller has its own. They shut
    the context down. Whatever then fails is raised as KeyboardInterrupt after Ctrl-C, and as
    ExternalShutdownException after SIGTERM or SIGHUP. Ctrl-C itself raises nothing any more in this
    process, and SIGTERM no longer kills it.
    """
    context = Context()
    node = executor = None
    # Handlers have to be asked for where the context is not the default one.
    noted: list[int] = []
    if signals is not SignalHandlerOptions.NO:
        noted = _note_signals()
        _hang_up_as_terminated()
    try:
        rclpy.init(args=None if args is None else list(args), context=context,
                   signal_handler_options=signals)
    except RCLError as error:
        if 'logging' in str(error):  # a home that cannot be written to
            raise ValueError(f'{error}: set ROS_LOG_DIR to a folder that can be written to'
                             ) from error
        raise
    except UnknownROSArgsError as error:
        raise ValueError(f'after --ros-args, ROS does not know {error}: a parameter is '
                         '-p NAME:=VALUE, a name is remapped by -r FROM:=TO') from error
    try:
        if noted:  # before rclpy's handlers were installed
            raise _asked_to_end(noted)
        node = make_node(context)
        executor = EventsExecutor(context=context)
        executor.add_node(node)
        yield node, executor
    except Exception as error:
        if context.ok():
            raise
        raise _asked_to_end(noted) from error
    finally:
        with ends_within(END_SECONDS), contextlib.ExitStack() as last_first:
            last_first.callback(shut_down, context)
            if node is not None:
                last_first.callback(node.destroy_node)
            if executor is not None:
                keep_for_ever(executor)
                last_first.callback(executor.shutdown)


def spin(node: Node, executor: Any) -> None:
    """Serve a node until its context is shut down (SIGINT, SIGTERM, or `context.shutdown()`)."""
    while node.context.ok():
        spin_for(node, executor, SPIN_SECONDS)


def exit_on_refusal(main: Callable[..., int]) -> Callable[..., int]:
    """Decorate what returns an exit status: REFUSALS end it with one line and status 1."""
    @functools.wraps(main)
    def run(*args: Any, **options: Any) -> int:
        try:
            return main(*args, **options)
        except REFUSALS as error:
            print(f'error: {error}', file=sys.stderr)
            return 1
    return run


@exit_on_refusal
def run_node(make_node: Callable[[Context], Node], args: Sequence[str] | None, *,
             undisturbed: bool = True) -> int:
    """Start a node and `spin`; return 0 after a clean end, 1 (and print why) if it cannot start.

    undisturbed: `keep_events_from_interrupting`.
    """
    try:
        with running_node(make_node, args, signals=SignalHandlerOptions.ALL) as (node, executor):
            if undisturbed:
                keep_events_from_interrupting()
            spin(node, executor)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    return 0
