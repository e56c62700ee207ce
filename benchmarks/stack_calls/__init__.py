# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Programs that move the boxes of a scene by one engine each; steps.hpp says what all do."""
from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

import numpy as np


class Asked(NamedTuple):
    """What a program is asked for: a scene of boxes, a row each."""

    step: float  # [s]
    substeps: int
    friction: float
    gravity: float  # [m/s²]
    sleep: bool
    size: np.ndarray  # (n, 3) [m]
    mass: np.ndarray  # (n,) [kg]; 0: fixed
    pose: np.ndarray  # (n, 7)


class World(Protocol):
    """Boxes of a scene that move."""

    step: Callable[[], None]

    def awake(self) -> int:
        """Return how many bodies are awake."""

    def poses(self) -> Iterable[Iterable[float]]:
        """Return a pose for each box."""


def run(make: Callable[[Asked], World]) -> None:
    """Do what the arguments say: SCENE SLEEP LIMIT STOP..."""
    with open(sys.argv[1], encoding='utf-8') as file:
        step, substeps, friction, gravity = file.readline().split()
        size, mass, pose = np.split(np.loadtxt(file, ndmin=2), [3, 4], axis=1)
    world = make(Asked(float(step), int(substeps), float(friction), float(gravity),
                       sys.argv[2] == '1', size, mass[:, 0], pose))
    done, limit = 0, float(sys.argv[3])
    for stop in map(int, sys.argv[4:]):
        step_once, begin = world.step, time.process_time()
        for tick in range(done, stop):
            if tick % 64 == 0 and time.process_time() > limit:
                return
            step_once()
        print(time.process_time() - begin, world.awake())
        for row in world.poses():
            print(*map(float, row))
        sys.stdout.flush()
        done = stop
