# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Workarounds for rclpy: every use of its private attributes, and of its objects' memory.

All were seen with rclpy 7.1 (Jazzy). Each names the symptom, and the test that guards it.
"""
from __future__ import annotations

import ctypes
import faulthandler
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.context import Context
from rclpy.event_handler import EventHandler
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.subscription import Subscription

RCLError = rclpy_implementation.RCLError
"""Symptom: what the middleware refuses raises a type without a public name.
Test: test_scene_node.py::test_a_scene_that_fails_half_way_is_taken_back."""
UnknownROSArgsError = rclpy_implementation.UnknownROSArgsError
"""Symptom: so does a word after --ros-args that is no option, and rclpy raises a RuntimeError.
Test: test_runtime.py::test_a_word_that_ros_does_not_know_ends_the_program."""
CHANGES = ('total_count_change', 'current_count_change', 'not_alive_count_change')
"""What events count since they were last taken; each kind has some of these."""


def parameter_overrides(node: Node) -> dict[str, Any]:
    """Return the parameters that were given at the start, by name.

    Symptom: rclpy silently ignores names that are never declared, and has no public list of them.
    Test: test_hygiene_ros.py::test_parameters_from_a_file.
    """
    return {name: parameter.value
            for name, parameter in getattr(node, '_parameter_overrides', {}).items()}


def withhold_events(node: Node, entity: Any) -> list[EventHandler]:
    """Take the QoS events of a topic from all executors; return their handlers.

    Symptom: an event waits in EventsExecutor's queue while its publisher or subscription is
    destroyed. The process ends with SIGSEGV: the event is released without Python's lock.
    Tests: test_faults.py::test_scenes_change_while_deadlines_are_missed, …::test_topics_go_while….
    """
    handlers = list(entity.event_handlers)
    entity.event_handlers.clear()
    for handler in handlers:
        node.remove_waitable(handler)
    return handlers


def serve_event(handler: EventHandler) -> None:
    """Call the callback of a withheld handler, if its event has something new.

    Symptom: only an executor may take an event, after it has set a private flag.
    Test: test_scene_node.py::test_deadlines_and_lost_publishers_are_reported.
    """
    handler._ready_to_take_data = True
    event = handler.take_data()
    if event is not None and any(getattr(event, change, 0) for change in CHANGES):
        handler.callback(event)


def silence(subscription: Subscription) -> None:
    """Drop the messages that an executor has taken for a subscription that is about to go.

    Symptom: the callback runs after destroy_subscription, with poses of a box that is gone.
    Test: test_faults.py::test_topics_go_while_others_ask_for_what_they_do_not_offer.
    """
    subscription.callback = lambda _: None


def lifecycle_state(node: LifecycleNode) -> str:
    """Return the label of a node's state: unconfigured, inactive, active or finalized.

    Symptom: a lifecycle node tells its state by a service alone.
    Test: test_first_run.py::test_the_state_is_told.
    """
    return str(node._state_machine.current_state[1])


def refuse_transitions(node: LifecycleNode) -> None:
    """Answer every request for a transition with a refusal.

    Symptom: a lifecycle node has all of its services or none, and those that read are wanted.
    Test: test_strangers.py::test_a_locked_node_takes_no_changes.
    """
    node._service_change_state.callback = lambda _, response: response  # success is false in it


@contextmanager
def ends_within(seconds: float) -> Iterator[None]:
    """End the process with status 1, and its threads' tracebacks, if the block takes longer.

    Symptom: destroying a node spins for ever in Fast DDS (`DomainParticipant::set_listener`), with
    Python's lock, while another participant of the host stands still. It is rare.
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
    `try_shutdown` raises.
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
    A signal during add_node brings that about.
    Test: test_contact_node.py::test_ends_cleanly; the symptom is rare.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(executor))
