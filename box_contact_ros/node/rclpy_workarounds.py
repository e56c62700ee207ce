# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Workarounds for rclpy: every use of its private attributes, and of its objects' memory.

All were seen with rclpy 7.1 (Jazzy). Each names the symptom, the upstream report, and the test that
guards it. "Not reported": a search of the trackers of rclpy and Fast DDS found nothing.
"""
from __future__ import annotations

import ctypes
import faulthandler
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from typing import Any

from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.service import Service

CallbackWithInfo = Callable[[Any, Mapping[str, Any]], None]
Send = Callable[[Any], None]
"""Sends the response to a request."""
RCLError = rclpy_implementation.RCLError
"""Symptom: what the middleware refuses raises a type without a public name. Not reported.
Test: test_contact_node.py::test_a_bad_start_is_one_clear_line."""
UnknownROSArgsError = rclpy_implementation.UnknownROSArgsError
"""Symptom: so does a word after --ros-args that is no option, and rclpy raises a RuntimeError.
Not reported.
Test: test_parameters.py::test_a_word_that_ros_does_not_know_ends_the_program."""


@contextmanager
def qos_refusals(node: Node, topic: str) -> Iterator[None]:
    """Raise `ValueError` with the topic's full name where a word of its QoS overrides is refused.

    Symptom: rclpy raises a RuntimeError that names the policy alone. Not reported.
    Test: test_contact_node.py::test_a_bad_start_is_one_clear_line.
    """
    try:
        yield
    except RCLError:  # of another cause
        raise
    except RuntimeError as error:
        name = node.resolve_topic_name(topic)
        raise ValueError(f'qos_overrides of {name}: {error}') from error


def parameter_overrides(node: Node) -> dict[str, Any]:
    """Return the parameters that were given at the start, by name.

    Symptom: rclpy silently ignores names that are never declared, and has no public list of them.
    Not reported.
    Test: test_parameters.py::test_an_unknown_name_is_logged_with_the_nearest_one.
    """
    return {name: parameter.value
            for name, parameter in getattr(node, '_parameter_overrides', {}).items()}


def lifecycle_state(node: LifecycleNode) -> str:
    """Return the label of a node's state: unconfigured, inactive, active or finalized.

    Symptom: a lifecycle node tells its state by a service alone. Not reported.
    Test: test_first_run.py::test_the_state_is_told.
    """
    return str(node._state_machine.current_state[1])


def with_info(callback: CallbackWithInfo) -> Callable[..., None]:
    """Return the callback of a subscription for a message and what is known of it.

    Symptom: EventsExecutor gives both as one tuple; the other executors give two arguments.
    Not reported.
    Test: test_runtime.py::test_a_message_comes_with_its_time_and_number.
    """
    @wraps(callback)  # rclpy asks for the signature
    def call(message: Any, info: Mapping[str, Any] | None = None) -> None:
        if info is None:
            message, info = message
        callback(message, info)
    return call


def answer_later(service: Service, take: Callable[[Any, Any, Send], None]) -> None:
    """Let `take` have each request of a service, its empty response, and a function that sends it.

    Symptom: the callback of a service has to return its answer at once, and nobody can measure how
    long sending it takes. Not reported.
    Test: test_check.py::test_costly_requests_wait_for_ticks.
    """
    send = service.send_response

    def keep(request: Any, response: Any) -> Any:
        return request, response  # rclpy hands them to `send_response`

    def answer(kept: tuple[Any, Any], header: Any) -> None:
        take(kept[0], kept[1], lambda response: send(response, header))
    service.callback = keep
    service.send_response = answer  # type: ignore[assignment, method-assign]


@contextmanager
def ends_within(seconds: float) -> Iterator[None]:
    """End the process with status 1, and its threads' tracebacks, if the block takes longer.

    Symptom: destroying a node spins for ever in Fast DDS (`DomainParticipant::set_listener`), with
    Python's lock, while another participant of the host stands still. It is rare.
    Report: https://github.com/eProsima/Fast-DDS/issues/6513 (open).
    Test: test_runtime.py::test_an_end_that_hangs_is_ended.
    """
    faulthandler.dump_traceback_later(seconds, exit=True, file=2)  # standard error
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def shut_down(context: Context) -> None:
    """Shut a context down, unless it is shut down already.

    Symptom: a thread of rclpy's does the same after a signal; where both do it at once,
    `try_shutdown` raises. Report: https://github.com/ros2/rclpy/issues/1352, fixed in rolling.
    Test: test_runtime.py::test_two_threads_shut_a_context_down.
    """
    try:
        context.try_shutdown()
    except RCLError:
        if context.ok():
            raise


def keep_for_ever(executor: Any) -> None:
    """Keep an executor from being destroyed, even as the interpreter ends.

    Symptom: EventsExecutor aborts the process if it is destroyed while it has something of a node.
    A signal during add_node brings that about. Not reported.
    Test: test_contact_node.py::test_ends_cleanly; the symptom is rare.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(executor))
