# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Streams of pose pairs for the bench: seeded, and made before they are sent. No ROS.

In both streams box B is on top of box A. Each pair has a random depth of B's lowest corner below
A's top face. An answer that mixes two ticks therefore has a wrong depth. Some pairs are apart.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene.pose import quaternion_multiply, rotation_matrix

CONTAINER = (12.192, 2.438, 2.591)  # full extents of a 40 ft container [m]
CUBE = (2.0, 2.0, 2.0)  # of the source paper's cubes [m]
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
"""Of a box, as shares of its size."""
STREAMS = 2  # how many there are
APART = 0.1  # how far boxes are apart at most, as a share of how deep they are at most


@dataclass(frozen=True, kw_only=True)
class Stream:
    """Pairs of poses for two boxes of one size."""

    name: str
    size: tuple[float, float, float]  # full extents of both boxes [m]
    poses_a: np.ndarray  # (n, 7), x y z qx qy qz qw
    poses_b: np.ndarray  # (n, 7), in the same frame


def make_streams(count: int, *, rate: float, seed: int = 1) -> list[Stream]:
    """Return all streams, each of `count` pairs; the same for the same seed.

    rate: pairs per second [Hz], by which the containers' motion is sampled.
    """
    return [swaying_containers(np.random.default_rng([seed, 0]), count, rate),
            touching_cubes(np.random.default_rng([seed, 1]), count)]


def swaying_containers(rng: np.random.Generator, count: int, rate: float) -> Stream:
    """Sway a 40 ft container on ropes close above another one, up to 2 cm deep."""
    periods = np.array([6.3, 5.1, 3.7, 4.3, 7.9])  # of surge, sway, roll, pitch and yaw [s]
    swings = np.array([0.2, 0.1, 0.01, 0.005, 0.03])  # their amplitudes [m] and [rad]
    time = np.arange(count)[:, None] / rate
    motion = swings * np.sin(2.0 * np.pi * (time / periods + rng.random(5)))
    turns = _unit(np.column_stack([0.5 * motion[:, 2:], np.ones(count)]))
    lowest = _lowest_corners(CONTAINER, turns)
    heights = CONTAINER[2] / 2.0 - _depths(rng, count, 0.02) - lowest[:, 2]
    return Stream(name='swaying containers', size=CONTAINER,
                  poses_a=np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (count, 1)),
                  poses_b=np.column_stack([motion[:, :2], heights, turns]))


def touching_cubes(rng: np.random.Generator, count: int) -> Stream:
    """Touch a cube in any pose by the corner of another one, up to 1 mm deep."""
    turns_a, turns_b = _unit(rng.normal(size=(2, count, 4)))
    places = np.column_stack([rng.uniform(-0.8, 0.8, (count, 2)),  # within A's face
                              CUBE[2] / 2.0 - _depths(rng, count, 1e-3)])
    centres = places - _lowest_corners(CUBE, turns_b)  # of B, in the frame of A
    origins = rng.uniform(-10.0, 10.0, (count, 3))
    moved = origins + np.einsum('nij,nj->ni', rotation_matrix(turns_a), centres)
    return Stream(name='touching cubes', size=CUBE, poses_a=np.column_stack([origins, turns_a]),
                  poses_b=np.column_stack([moved, quaternion_multiply(turns_a, turns_b)]))


def _depths(rng: np.random.Generator, count: int, most: float) -> np.ndarray:
    """Draw depths (count,) of up to `most` [m]; a few are negative: apart."""
    return rng.uniform(-APART * most, most, count)


def _unit(quaternions: np.ndarray) -> np.ndarray:
    return quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)


def _lowest_corners(size: tuple[float, float, float], quaternions: np.ndarray) -> np.ndarray:
    """Return the lowest corner (n, 3) of a turned box, from its centre [m]."""
    corners = np.einsum('nij,kj->nki', rotation_matrix(quaternions), CORNERS * size)
    return corners[np.arange(len(corners)), corners[:, :, 2].argmin(axis=1)]
