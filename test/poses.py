"""Families of poses that many tests draw from. Every one is seeded and stored as doubles."""
from __future__ import annotations

import numpy as np

CONTAINER = (12.192, 2.438, 2.591)
CUBE = (2.0, 2.0, 2.0)
IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def unit_quaternions(rng, n):
    q = rng.normal(size=(n, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def small_rotations(axes, angles):
    """Quaternions (n, 4) xyzw of rotations by `angles` (n,) [rad] about `axes` (n, 3)."""
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return np.concatenate([axes * np.sin(0.5 * angles)[:, None], np.cos(0.5 * angles)[:, None]],
                          axis=1)


def rotate(q, v):
    """Rotate vectors (n, 3) by quaternions (n, 4) xyzw."""
    u, w = q[:, :3], q[:, 3:]
    return v + 2.0 * np.cross(u, np.cross(u, v) + w * v)


def multiply(p, q):
    """Hamilton product of quaternions (n, 4) xyzw."""
    u, w = p[:, :3], p[:, 3:]
    v, s = q[:, :3], q[:, 3:]
    return np.concatenate([w * v + s * u + np.cross(u, v),
                           w * s - np.sum(u * v, axis=1, keepdims=True)], axis=1)


def moved(poses, shift, turn):
    """Poses (n, 7) after one rigid motion each: turn about the origin, then shift."""
    return np.concatenate([rotate(turn, poses[:, :3]) + shift, multiply(turn, poses[:, 3:])],
                          axis=1)


def random_pairs(rng, n):
    """Random sizes (aspect to 1:20), orientations and offsets; about half of them overlap."""
    size_a = np.exp(rng.uniform(-1.5, 1.5, (n, 3)))
    size_b = np.exp(rng.uniform(-1.5, 1.5, (n, 3)))
    a = np.concatenate([rng.uniform(-5, 5, (n, 3)), unit_quaternions(rng, n)], axis=1)
    reach = 0.5 * (np.linalg.norm(size_a, axis=1) + np.linalg.norm(size_b, axis=1))
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    offset = direction * (reach * rng.uniform(0.2, 0.9, n))[:, None]
    b = np.concatenate([a[:, :3] + offset, unit_quaternions(rng, n)], axis=1)
    return a, b, size_a, size_b


def near_parallel_pairs(rng, n, size=CONTAINER):
    """Stacked boxes: tilt 0 and 1e-16 to 0.1 rad about axes of all kinds, gap ±1e-12 to ±1e-1 m.

    Lateral offsets: none, exactly flush sides (half an extent), or random. Half of the pairs are
    then moved rigidly, so that no axis is a coordinate axis.
    """
    size = np.asarray(size, dtype=np.float64)
    sizes = np.tile(size, (n, 1))
    axes = rng.normal(size=(n, 3))
    kind = rng.integers(0, 6, n)
    for k, fixed in ((1, (1, 0.5, 3)), (2, (1, 1, 1)), (3, (1, 0, 1)), (4, (0, 0, 1)),
                     (5, (1, 0, 0))):
        axes[kind == k] = fixed
    angles = 10.0**rng.uniform(-16, -1, n) * (rng.random(n) < 0.9)
    gap = 10.0**rng.uniform(-12, -1, n) * rng.choice([-1.0, -1.0, 1.0], n)
    lateral = rng.uniform(-0.9, 0.9, (n, 2)) * size[:2]
    exact = rng.integers(0, 3, n)
    lateral[exact == 0] = 0.0
    flush = exact == 1
    lateral[flush] = rng.choice([0.0, 0.5, -0.5], (int(flush.sum()), 2)) * size[:2]
    b = np.concatenate([lateral, (size[2] + gap)[:, None], small_rotations(axes, angles)], axis=1)
    a = np.tile(IDENTITY, (n, 1))
    far = rng.random(n) < 0.5
    turn = unit_quaternions(rng, n)
    turn[~far] = IDENTITY[3:]
    shift = rng.uniform(-20, 20, (n, 3)) * far[:, None]
    return moved(a, shift, turn), moved(b, shift, turn), sizes, sizes
