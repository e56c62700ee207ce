# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From answers that come late to the wrench on a load, against the laws themselves."""
from __future__ import annotations

import numpy as np
import pytest

from box_contact_ros import Body, ContactSolver, HeldPatch
from box_contact_ros.demo.load_laws import (
    LoopState,
    held_patch,
    held_wrench,
    predicted_wrench,
)
from box_contact_ros.scene.force.laws import GRAVITY

SIZE, MASS = (2.0, 2.0, 2.0), 1000.0
LOAD = Body.of_box(SIZE, MASS)
STACK = np.array([0.0, 0, 0, 0, 0, 0, 1])
LOOP = {'rate_hz': 200.0, 'latency': 0.002}
SOLVER = ContactSolver(SIZE, SIZE, model='exact')
STILL = np.zeros(6)


def at(depth: float) -> np.ndarray:
    """Return the load's pose at a depth [m]."""
    return STACK + [0, 0, 2.0 - depth, 0, 0, 0, 0]


def asked(tick: int, depth: float) -> tuple[dict, LoopState]:
    """Return the contacts at a depth, and the state for which they were asked."""
    pose = at(depth)
    return {'pair': SOLVER(pose, STACK)}, LoopState(tick, 0.005 * tick, pose, STILL)


def test_a_held_patch_is_that_of_the_pose_for_which_it_was_asked():
    """It acts from its time on, at the load's pose by then; the next takes its place."""
    law, plain = held_patch(LOAD, step=0.001, **LOOP), HeldPatch.for_loop(LOAD, step=0.001, **LOOP)
    depth = GRAVITY / plain.frequency**2
    for tick, was in enumerate((depth, 2.0 * depth)):
        contacts, state = asked(tick, was)
        law.answer(contacts, state, due=state.time + 0.002)
        before = law.wrench(state.time + 0.001, at(was), STILL)
        assert before == pytest.approx(plain.wrench(at(was), STILL))
        assert before.any() == (tick > 0)
        plain.hold(contacts, state.pose)
        for lower in (1.5, 1.0):
            found = law.wrench(state.time + 0.002, at(lower * was), STILL)
            assert found.tolist() == plain.wrench(at(lower * was), STILL).tolist()
            assert found[2] > 0.0


def test_a_held_wrench_stays_wherever_the_load_goes():
    law = held_wrench(LOAD, step=0.001, **LOOP)
    contacts, state = asked(0, 5e-4)
    law.answer(contacts, state, due=0.002)
    assert not law.wrench(0.001, at(1e-3), STILL).any()
    found = law.wrench(0.002, at(1e-3), STILL)
    assert found[2] > 0.0 and found.tolist() == law.wrench(0.004, at(-1.0), STILL).tolist()
    assert law.asked_for(state) is state


def test_a_predicted_wrench_is_asked_for_where_it_will_begin_to_act():
    """A load in free fall: the pose and the velocity that it has one latency later."""
    law = predicted_wrench(LOAD, rate_hz=200.0, latency=0.01, step=0.001)
    height, speed = 3.0, 0.0
    for tick in range(40):
        state = LoopState(tick, 0.005 * tick, STACK + [0, 0, height, 0, 0, 0, 0],
                          np.array([0, 0, speed, 0, 0, 0]))
        ahead = law.asked_for(state)
        law.answer({}, ahead, due=state.time + 0.01)
        height, speed = height + 0.005 * speed - 0.5 * GRAVITY * 0.005**2, speed - 0.005 * GRAVITY
    assert ahead.tick == tick and ahead.time == state.time
    assert ahead.velocity[2] == pytest.approx(state.velocity[2] - 0.01 * GRAVITY, rel=1e-6)
    fall = 0.01 * state.velocity[2] - 0.5 * GRAVITY * 0.01**2
    assert ahead.pose[2] - state.pose[2] == pytest.approx(fall, rel=0.02)
