# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# The library as a Python extension; see binding/module.cpp.
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

LENGTH_MIN: float
LENGTH_MAX: float
QUATERNION_MIN: float
QUATERNION_MAX: float
CONTACT_ULPS: float
DEPTH_FLOOR: float

NETWORK_FORMAT: int
FEATURES: int
OUTPUTS: int
UNITS_MAX: int

kernel: str
instruction_set: str
lanes: int
compiler: str

class PairSolver:
    def __init__(self, model: str | None, size_a: tuple[float, float, float],
                 size_b: tuple[float, float, float], network: np.ndarray | None = None,
                 margin: float = 0.0) -> None: ...
    def __call__(self, pose_a: ArrayLike, pose_b: ArrayLike) -> Any: ...
    def batch(self, *args: Any, **keywords: Any) -> Any: ...
    def solve(self, poses_a: np.ndarray, poses_b: np.ndarray, sizes_a: np.ndarray,
              sizes_b: np.ndarray, threads: int, patch: bool = True,
              pairs: np.ndarray | None = None, /,
              ) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray,
                               np.ndarray, np.ndarray], int]: ...
    @property
    def clipped(self) -> int: ...

class BroadPhase:
    def __init__(self, sizes: np.ndarray, fixed: np.ndarray, margin: float, listed: np.ndarray,
                 groups: np.ndarray, allowed: np.ndarray, /) -> None: ...
    def find(self, poses: np.ndarray, most: int, /) -> tuple[np.ndarray, np.ndarray, int]: ...

class PatchForces:
    def __init__(self, mass: np.ndarray, inertia: np.ndarray, centre: np.ndarray, iterations: int,
                 relaxations: int, friction: float, /) -> None: ...
    def set_bodies(self, mass: np.ndarray, inertia: np.ndarray, centre: np.ndarray, /) -> None: ...
    def hold(self, pairs: ArrayLike, separation: ArrayLike, normal: ArrayLike, point: ArrayLike,
             volume: ArrayLike, covariance: ArrayLike, poses: ArrayLike,
             friction: ArrayLike | None, surface: ArrayLike | None, stiffness: ArrayLike | None,
             age: float, period: float, /) -> None: ...
    def step(self, dt: float, poses: ArrayLike, velocities: ArrayLike, outside: ArrayLike | None,
             as_wrenches: bool, /) -> np.ndarray: ...
    def forget(self, body: int, /) -> None: ...
    def reset(self) -> None: ...
    def save(self) -> bytes: ...
    @classmethod
    def load(cls, state: bytes, /) -> PatchForces: ...

def instruction_sets() -> tuple[str, ...]: ...
def use_contact_types(single: type[tuple[object, ...]], many: type[tuple[object, ...]], /,
                      ) -> None: ...
def mlp_inputs(poses_a: np.ndarray, poses_b: np.ndarray, sizes_a: np.ndarray, sizes_b: np.ndarray,
               /) -> tuple[np.ndarray, ...]: ...
def clipped(poses_a: np.ndarray, poses_b: np.ndarray, sizes_a: np.ndarray, sizes_b: np.ndarray, /,
            ) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...
def message_numbers(point: np.ndarray, normal: np.ndarray, separation: np.ndarray,
                    volume: np.ndarray, covariance: np.ndarray, /) -> np.ndarray: ...
def patch_areas(normal: np.ndarray, covariance: np.ndarray, /) -> np.ndarray: ...
