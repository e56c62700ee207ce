# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the contacts of a load become the wrench on it, with the answers that are still under way.

`held_patch` is the default and the best. It evaluates the law at every physics step. The others
apply one wrench until the next: `held_wrench`, and `predicted_wrench`, which asks for the contacts
at the state where that wrench begins to act.

Conventions: those of `laws`.
"""
from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np

from ..scene.force.held_wrench import HeldWrench, InFlight
from ..scene.force.laws import Body, HeldPatch, PatchLaw
from ..scene.force.predictor import Predictor
from ..solver.contact import Contact

NamedContacts = Mapping[str, Contact]
"""All contacts of one question, by the names of their pairs."""


class LoopState(NamedTuple):
    """The state of the load at which contacts are asked for."""

    tick: int
    time: float  # at which they are asked for [s]
    pose: np.ndarray  # of the load's box (7,)
    velocity: np.ndarray  # of its centre of mass (6,)


class LoadLaw(Protocol):
    """The wrench on a load at every physics step, from the answers that have come."""

    def asked_for(self, state: LoopState) -> LoopState:
        """Return the state at which contacts are asked for, from the present state."""

    def answer(self, contacts: NamedContacts, state: LoopState, *, due: float) -> None:
        """Take the contacts of a state, which act from `due` [s] on."""

    def wrench(self, time: float, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return force and torque (6,) at `time` [s], a physics step at a time."""


class MakeLaw(Protocol):
    """What makes the law of a load for a loop."""

    def __call__(self, load: Body, *, rate_hz: float, latency: float, step: float) -> LoadLaw:
        """Return the law for so many questions a second; latency and physics step in s."""


class WrenchLaw(Protocol):
    """A law that makes one wrench of one answer."""

    def wrench(self, contacts: NamedContacts, pose: np.ndarray, velocity: np.ndarray,
               ) -> np.ndarray:
        """Return force and torque (6,) of the contacts at this pose (7,) and velocity (6,)."""


class PatchesHeld:
    """A `HeldPatch`, with the answers that are under way."""

    def __init__(self, law: HeldPatch) -> None:
        self._law = law
        self._under_way: InFlight[tuple[NamedContacts, np.ndarray]] = InFlight()

    def asked_for(self, state: LoopState) -> LoopState:
        """Return the state itself."""
        return state

    def answer(self, contacts: NamedContacts, state: LoopState, *, due: float) -> None:
        """Take the contacts of a state, which act from `due` [s] on."""
        self._under_way.answer((contacts, state.pose), asked=state.time, due=due)

    def wrench(self, time: float, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return force and torque (6,) of the newest patches at this pose and velocity."""
        newest = self._under_way.arrived(time)
        if newest is not None:
            self._law.hold(*newest)
        return self._law.wrench(pose, velocity)


class WrenchesHeld:
    """A law of one wrench per answer, with a `Predictor` or without; the last wrench acts."""

    def __init__(self, law: WrenchLaw, predictor: Predictor | None = None) -> None:
        self._law, self._predictor = law, predictor
        self._held = HeldWrench()

    def asked_for(self, state: LoopState) -> LoopState:
        """Return the state that is predicted for the end of the latency, or the state itself."""
        if self._predictor is None:
            return state
        pose, velocity = self._predictor.state(state.time, state.pose, state.velocity)
        return state._replace(pose=pose, velocity=velocity)

    def answer(self, contacts: NamedContacts, state: LoopState, *, due: float) -> None:
        """Take the contacts of a state; their wrench acts from `due` [s] on."""
        wrench = self._law.wrench(contacts, state.pose, state.velocity)
        if self._predictor is not None:
            self._predictor.sent(wrench, state.time)
        self._held.answer(wrench, asked=state.time, due=due)

    def wrench(self, time: float, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return force and torque (6,) that acts, wherever the load is by now."""
        return self._held.at(time)


def held_patch(load: Body, *, rate_hz: float, latency: float, step: float) -> PatchesHeld:
    """Return the law that is evaluated at every physics step."""
    return PatchesHeld(HeldPatch.for_loop(load, rate_hz=rate_hz, latency=latency, step=step))


def held_wrench(load: Body, *, rate_hz: float, latency: float, step: float) -> WrenchesHeld:
    """Return the law whose wrench is applied until the next."""
    return WrenchesHeld(PatchLaw.for_loop(load, rate_hz=rate_hz, latency=latency))


def predicted_wrench(load: Body, *, rate_hz: float, latency: float, step: float) -> WrenchesHeld:
    """Return the same with a predictor, for a latency that is known."""
    return WrenchesHeld(PatchLaw.for_loop(load, rate_hz=rate_hz, predicted=True),
                        Predictor(load, latency=latency))
