"""Landings over DDS, in lockstep: the crane client here, the contact node in a process of its own.

What `report.landing --dds` runs: the same cases as offline, one `CraneNode` per landing, a contact
node that answers all landings of a model.
"""
from __future__ import annotations

import os
import random
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from ...node.runtime import make_executor
from ..processes import DOMAINS, end, on_this_host, start
from .crane_node import CraneNode, receive_while
from .crane_parameters import PARAMETERS, SCENARIO
from .landing import LandingResult
from .mujoco_crane import CraneScenario

PATIENCE = 30.0
"""For the node to answer [s]."""


@contextmanager
def answering_node(model: str, scenario: CraneScenario) -> Iterator[int]:
    """A contact node in a ROS domain of its own on this host; gives the domain."""
    domain = random.choice(DOMAINS)
    sizes = [f'{name}:=[{",".join(map(str, size))}]' for name, size in (
        ('size_a', scenario.size), ('size_b', scenario.stack_size))]
    node = start('contact_node', [f'model:={model}', *sizes], os.environ | on_this_host(domain),
                 subprocess.DEVNULL)
    try:
        yield domain
    finally:
        end([node])


def fly_over_dds(domain: int, scenario: CraneScenario, *, rate_hz: float, latency: float,
                 ) -> LandingResult:
    """One landing in lockstep. RuntimeError if an answer was lost or wrong."""
    # The discovery range has no other way in; the domain has.
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    values = {'closed_loop': True, 'lockstep': True, 'rate': rate_hz, 'latency': latency,
              'wait': PATIENCE} | {name: getattr(scenario, field)
                                   for name, field in SCENARIO.items()}
    given = [Parameter(name, value=list(map(float, value)) if isinstance(value, tuple) else value)
             for name, value in values.items() if value != PARAMETERS[name].default]
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = executor = None
    try:
        node = CraneNode(context, parameter_overrides=given)
        assert node.scenario == scenario, (node.scenario, scenario)
        executor = make_executor(context)
        executor.add_node(node)
        receive_while(node, executor, node.await_answers)
        receive_while(node, executor, node.lower)
        summary = node.log.summary(node.solver, max(scenario.size))
        if not summary.passed:
            raise RuntimeError(f'a landing over DDS lost something:\n{summary}')
        return node.landing()
    finally:
        if executor is not None:
            executor.shutdown()
        if node is not None:
            node.destroy_node()
        context.try_shutdown()
