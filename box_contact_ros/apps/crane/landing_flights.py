"""Landings over DDS, in lockstep: the crane client here, the contact node in its own process.

What `landing --dds` runs: the same cases as offline, one `CraneNode` per landing, and one
contact node that answers all landings of a model.
"""
from __future__ import annotations

import os
import random
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from rclpy.parameter import Parameter

from .. import processes
from ..ros_client import joined
from .crane_node import CraneNode, fly
from .crane_parameters import PARAMETERS, SCENARIO
from .landing import LandingRecord
from .mujoco_crane import CraneScenario

PATIENCE = 30.0  # for the node to answer [s]


@contextmanager
def answering_node(model: str, scenario: CraneScenario) -> Iterator[int]:
    """Run a contact node in a ROS domain of its own on this host; give the domain."""
    domain = random.choice(processes.DOMAINS)
    node = processes.start(
        processes.program('contact_node', model=model, size_a=scenario.size,
                          size_b=scenario.stack_size),
        env=os.environ | processes.on_this_host(domain))
    try:
        yield domain
    finally:
        processes.end([node])


def fly_over_dds(domain: int, scenario: CraneScenario, *, rate_hz: float, latency: float,
                 ) -> LandingRecord:
    """Run one landing in lockstep. RuntimeError if an answer was lost or wrong."""
    # The discovery range has no other way in; the domain has.
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    values = {'closed_loop': True, 'lockstep': True, 'rate': rate_hz, 'latency': latency,
              'wait': PATIENCE} | {name: getattr(scenario, field)
                                   for name, field in SCENARIO.items()}
    given = [Parameter(name, value=list(map(float, value)) if isinstance(value, tuple) else value)
             for name, value in values.items() if value != PARAMETERS[name].default]
    with joined(partial(CraneNode, parameter_overrides=given), domain=domain) as (node, executor):
        assert node.scenario == scenario, (node.scenario, scenario)
        fly(node, executor)
        summary = node.summary()
    if summary is None or not summary.passed or node.feedback is None:
        raise RuntimeError(f'a landing over DDS lost something:\n{summary}')
    return node.feedback.record
