# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Landings over DDS: the crane client closes the loop with a contact node in another process."""
from __future__ import annotations

import time

import numpy as np
import pytest

pytest.importorskip('mujoco')

import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from box_contact_ros.demo import crane_feedback, crane_node
from box_contact_ros.demo.landing import (
    LANDING_DURATION,
)
from box_contact_ros.node.runtime import make_executor

EXACT = ('--ros-args', '-p', 'model:=exact')
HARD = {'rope_angle': 3.0, 'rope_heading': 100.0, 'pitch': 2.0, 'roll': -2.0, 'yaw': 1.0,
        'offset': [0.2, 0.4]}
"""A landing at the ends of what is asked for."""


def arguments(**values):
    texts = [f'{name}:={str(value).lower()}' for name, value in values.items()]
    return ['--ros-args', *(word for text in texts for word in ('-p', text))]


@pytest.fixture
def node(program):
    running = program('contact_node', *EXACT)
    running.wait_for_output('ready', 120)
    return running


def test_lands_in_lockstep_faster_than_real_time(program, node):
    """200 Hz, 2 ms latency: at rest, exit status 0, and time does not wait for the clock."""
    started = time.monotonic()
    crane = program('crane', *arguments(closed_loop=True, lockstep=True, latency=0.002, **HARD))
    assert crane.wait(200) == 0, crane.output
    took = time.monotonic() - started
    assert 'landing ................ at rest' in crane.output
    assert 'messages lost .......... 0 ' in crane.output
    assert took < LANDING_DURATION, f'{took:.1f} s for {LANDING_DURATION:g} s of motion'


def test_a_landing_that_does_not_rest_fails(program, node):
    """Ended before it can be judged: contacts came through, and still the status is 1."""
    crane = program('crane', *arguments(closed_loop=True, lockstep=True, duration=4.0,
                                        overlap=0.025))
    assert crane.wait(100) == 1, crane.output
    assert 'not judged' in crane.output


@pytest.fixture
def client():
    """Return a crane node in this process, closed loop, with what it needs to be served."""
    context = Context()
    rclpy.init(context=context)
    values = {'closed_loop': True, 'lockstep': True} | HARD
    crane = crane_node.CraneNode(
        context, parameter_overrides=[Parameter(name, value=v) for name, v in values.items()])
    executor = make_executor(context)
    executor.add_node(crane)
    yield crane, executor
    executor.shutdown()
    crane.destroy_node()
    context.try_shutdown()


def test_lost_ticks_are_bridged(node, client, monkeypatch):
    """Every eleventh answer is thrown away on arrival: the last patch is held, and it lands.

    As in real time, the law is made for a period's latency.
    """
    crane, executor = client
    crane.feedback.loop = crane_feedback.ClosedLoop(crane.scenario, crane.rate, latency=0.005)
    crane.crane = crane.feedback.loop.crane
    monkeypatch.setattr(crane_feedback, 'LOCKSTEP_PATIENCE', 0.01)
    monkeypatch.setattr(crane_feedback, 'LOCKSTEP_LOST_MOST', 100)  # a busy machine pauses for 1 s
    answer, count = crane.feedback.answer, 0

    def lossy(stamp, values, received):
        nonlocal count
        count += 1
        if count % 11:
            answer(stamp, values, received)

    monkeypatch.setattr(crane.feedback, 'answer', lossy)
    crane_node.receive_while(crane, executor, crane.await_answers)
    crane_node.receive_while(crane, executor, crane.lower)
    result = crane.landing()
    assert count > 4000
    assert len(crane.feedback.loop.record.points) < 0.95 * crane.summary().result.contacts
    assert result.carried and result.force_worst < 1e-3, f'\n{result}'


def test_answers_that_say_nothing_are_held_over(client, monkeypatch):
    """Rows of NaN are no answer: the patch is still held. An empty cloud is "no contact"."""
    crane, _ = client
    monkeypatch.setattr(crane_feedback, 'LOCKSTEP_PATIENCE', 0.01)
    feedback = crane.feedback
    row = np.array([0.0, 0.0, 2.6, 0.0, 0.0, -1.0, 1e-3, 0.03, 12.0, 0.0, 0.0, 0.5, 0.0, 1e-7])
    pushes = []
    for stamp, values in enumerate((row, np.full(14, np.nan), row[:0]), start=1):
        feedback.ask(stamp)
        feedback.answer(stamp, values, stamp)
        feedback.step(stamp)
        pushes.append(feedback.loop.record.forces[-1][2])
    assert pushes[0] > 0.0 and pushes[1] > 0.0 and pushes[2] == 0.0


def test_a_model_without_a_patch_does_not_end_the_crane(program):
    """The whole load stands for the patch: a run is flown to its end, judged, and says so."""
    program('contact_node', '--ros-args', '-p', 'model:=paper').wait_for_output('ready', 120)
    crane = program('crane', *arguments(closed_loop=True, lockstep=True, duration=12.0))
    assert crane.wait(100) == 1, crane.output
    assert 'crane: done after 12 s' in crane.output and 'Traceback' not in crane.output
    assert 'messages lost .......... 0 ' in crane.output
    assert crane.output.count('without a patch: the whole load stands for it') == 1


def test_a_point_alone_pushes(client):
    """Up, by a finite force; contacts of both kinds may follow each other."""
    crane, _ = client
    feedback = crane.feedback
    row = np.array([0.0, 0.0, 2.6, 0.0, 0.0, -1.0, 1e-3, 0.03, 12.0, 0.0, 0.0, 0.5, 0.0, 1e-7])
    alone = np.where(np.arange(14) < 7, row, np.nan)
    for stamp, values in enumerate((alone, row, alone), start=1):
        feedback.ask(stamp)
        feedback.answer(stamp, values, stamp)
        feedback.step(stamp)
    assert np.isfinite(feedback.loop.record.forces).all()
    assert all(force[2] > 0.0 for force in feedback.loop.record.forces)
    assert feedback.points_alone == 2


def test_lockstep_ends_when_nobody_answers(client, monkeypatch):
    """A lost answer is waited for, within bounds, and so is a node that is gone."""
    crane, _ = client
    monkeypatch.setattr(crane_feedback, 'LOCKSTEP_PATIENCE', 0.01)
    with pytest.raises(TimeoutError, match='no answer to 5 pairs'):
        for stamp in range(1, 7):
            crane.feedback.ask(stamp)
            crane.feedback.step(stamp)
    assert stamp == 5
