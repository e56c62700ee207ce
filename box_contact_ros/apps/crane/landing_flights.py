# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Landings over DDS, in lockstep: many cranes here, one contact node in a process of its own.

What `landing --dds` runs. Landings of one model and rate share a scene: each has its load, a
moving box, and its own stack. A tick sends the poses of all loads as one message, and waits for the
answer.
"""
from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray
from rclpy.context import Context

from ...node.messages import make_header, read_contacts
from ...node.runtime import GuardedNode, joined, spin_once
from ...scene.files.scene_file import write_scene
from ...scene.scene_solver import POSE_ARRAY, Box, Pair, Scene
from ...solver.contact import Contact
from .. import processes
from ..answer_log import first_row, is_stale, touch_in
from ..ros_client import DEEP_RELIABLE, array_message, stamp_of, subscribe_contacts
from .landing import ClosedLoop, LandingRecord
from .mujoco_crane import CraneScenario

PATIENCE = 30.0  # for the node to answer [s]
OFFER_PERIOD = 0.1  # s between the ticks that only ask whether the node answers


def scene_of(scenarios: Sequence[CraneScenario]) -> Scene:
    """Return the scene of all landings: `load_k`, and the boxes `stack_k_n` that it may meet."""
    boxes, pairs = {}, []
    for number, scenario in enumerate(scenarios):
        load = f'load_{number}'
        boxes[load] = Box(load, scenario.size)
        for place, (pose, size) in enumerate(scenario.stack_boxes):
            stack = f'stack_{number}_{place}'
            boxes[stack] = Box(stack, size, tuple(pose.tolist()))
            pairs.append(Pair(len(pairs), f'{load}_{stack}', load, stack))
    return Scene(boxes, tuple(pairs), pose_array=True)


class FlightNode(GuardedNode):
    """Sends the poses of all loads, and awaits their contacts."""

    def __init__(self, context: Context, scene: Scene) -> None:
        super().__init__('flights', context=context)
        self._poses = self.create_publisher(PoseArray, POSE_ARRAY, DEEP_RELIABLE)
        subscribe_contacts(self, self._on_contacts, DEEP_RELIABLE)
        self._ids = scene.ids
        self._contacts: dict[int, np.ndarray] = {}

    def _on_contacts(self, message: Any) -> None:
        self._contacts[stamp_of(message.header)] = read_contacts(message, self._ids)

    def contacts(self, executor: Any, poses: Sequence[np.ndarray], patience: float,
                 ) -> dict[int, Contact]:
        """Return the contacts of poses (7,), by the id of their pair.

        TimeoutError: none came within `patience` [s]. RuntimeError: a pair was not evaluated.
        """
        message = array_message(make_header(self.get_clock().now().nanoseconds, 'world'), poses)
        self._poses.publish(message)
        stamp, deadline = stamp_of(message.header), time.monotonic() + patience
        while stamp not in self._contacts:
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise TimeoutError(f'the contact node gave no answer within {patience:g} s')
            spin_once(self, executor, left)
        rows = self._contacts.pop(stamp)
        found = {int(rows[n]['pair']): first_row(rows[n:]) for n in range(len(rows))}
        if any(map(is_stale, found.values())):
            raise RuntimeError('the contact node did not evaluate all pairs')
        return {pair: touch for pair, values in found.items() if (touch := touch_in(values))}

    def await_node(self, executor: Any, poses: Sequence[np.ndarray]) -> None:
        """Offer poses until they are answered; TimeoutError after PATIENCE."""
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                self.contacts(executor, poses, OFFER_PERIOD)
                return
            except TimeoutError:
                if time.monotonic() > deadline:
                    raise TimeoutError(f'no contact node within {PATIENCE:g} s') from None


@contextmanager
def answering_node(model: str, scene: Scene) -> Iterator[None]:
    """Run a contact node for a scene."""
    with tempfile.NamedTemporaryFile('w', suffix='.yaml') as file:
        write_scene(scene, file.name)
        node = processes.start(
            processes.program('contact_node', model=model, scene=file.name, pair_topics=False))
        try:
            yield
        finally:
            processes.end([node])


def fly_over_dds(model: str, scenarios: Sequence[CraneScenario], latencies: Sequence[float], *,
                 rate_hz: float, domain: int) -> list[LandingRecord]:
    """Run landings together, each with its latency [s]; return their records.

    This process is in the ROS domain from then on, and heard on this host alone.
    Raises TimeoutError where an answer does not come, RuntimeError where one lacks a pair.
    """
    os.environ |= processes.on_this_host(domain)
    scene = scene_of(scenarios)
    flights = [ClosedLoop(scenario, rate_hz, latency=latency)
               for scenario, latency in zip(scenarios, latencies)]

    def poses() -> list[np.ndarray]:
        return [flight.crane.load_pose for flight in flights]

    each = ((number, name) for number, scenario in enumerate(scenarios) for name in scenario.pairs)
    names: list[dict[int, str]] = [{} for _ in flights]  # of a flight's pairs, by their ids
    for pair, (number, name) in zip(scene.pairs, each, strict=True):
        names[number][pair.id] = name
    make_node = partial(FlightNode, scene=scene)
    with answering_node(model, scene), joined(make_node) as (node, executor):
        node.await_node(executor, poses())
        while not all(flight.record.ended for flight in flights):
            found = node.contacts(executor, poses(), PATIENCE)
            for number, (flight, latency) in enumerate(zip(flights, latencies)):
                if not flight.record.ended:
                    contacts = {name: found[pair] for pair, name in names[number].items()
                                if pair in found}
                    flight.answer(flight.ask(), contacts, latency=latency)
                    flight.step()
    return [flight.record for flight in flights]
