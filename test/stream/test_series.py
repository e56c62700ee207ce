# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion, frame by frame: one contact per approach, no chatter, and a point that does not jump.

What a simulator feels is not the error of a point but its steps. The series are runs of the crane
at 200 Hz and 1 kHz, and family I of the hard cases: approaches at 100 Hz. Tests print what they
measured: `python -m pytest test/stream/test_series.py -rP`.
"""
from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import poses
import pytest

pytest.importorskip('benchmarks.pose_sets')

from benchmarks.pose_sets import (
    SETS,
    Pairs,
    at_depth,
    log_uniform,
    quaternion_multiply,
    turns,
)
from box_contact_ros import ContactSolver
from box_contact_ros.core import DEPTH_FLOOR
from box_contact_ros.solver.contact import Contacts

pytestmark = pytest.mark.reports

UNIT = (1.0, 1.0, 1.0)

K = 1.0
"""|Δpoint| ≤ K · |Δpose| · size / depth: see docs/explanation/contact_point.md."""


class Series(NamedTuple):
    """Frames of some motions of equal length, one motion after the other; A stands still."""

    pairs: Pairs
    motions: int
    answers: dict[str, Contacts]
    """By model, those that were asked for."""

    def solve(self, model: str) -> Contacts:
        """Return a model's answers in all frames."""
        if model not in self.answers:
            self.answers[model] = solve(model, self.pairs)
        return self.answers[model]


def solve(model: str, pairs: Pairs) -> Contacts:
    return pairs.contacts(ContactSolver(model=model))


def contact_intervals(found: Contacts, motions: int) -> np.ndarray:
    """(motions,) how many times contact begins in each."""
    touching = found.colliding.reshape(motions, -1).astype(int)
    return (np.diff(touching, axis=1, prepend=0) == 1).sum(axis=1)


def steps(found: Contacts, motions: int) -> np.ndarray:
    """(motions · (frames − 1),) |Δpoint| [m] from frame to frame, NaN without contact in both."""
    return np.linalg.norm(np.diff(found.point.reshape(motions, -1, 3), axis=1), axis=2).ravel()


def pose_steps(one: Pairs, other: Pairs) -> np.ndarray:
    """(n,) |Δpose| [m]: how far that corner of B has moved that moved farthest."""
    farthest = np.zeros(len(one.pose_b))
    for signs in np.ndindex(2, 2, 2):
        corner = (np.array(signs) - 0.5) * one.size_b
        before, after = (pose[:, :3] + poses.rotate(pose[:, 3:], corner)
                         for pose in (one.pose_b, other.pose_b))
        farthest = np.maximum(farthest, np.linalg.norm(after - before, axis=1))
    return farthest


def slopes(one: Pairs, other: Pairs, before: Contacts, after: Contacts) -> np.ndarray:
    """(n,) |Δpoint| / |Δpose| · depth / size, NaN without contact in both.

    The depth is the lesser of the two, and DEPTH_FLOOR · size at least: boxes are pressed in to it.
    """
    size = one.size
    depth = np.maximum(-np.maximum(before.separation, after.separation), DEPTH_FLOOR * size)
    way = pose_steps(one, other)
    way[way == 0.0] = np.nan  # no step at all, or one that float64 rounds to none
    return np.linalg.norm(after.point - before.point, axis=1) / way * depth / size


def frames(count: int, motions: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of all but the last frame of each motion, and of all but the first."""
    rows = np.arange(count).reshape(motions, -1)
    return rows[:, :-1].ravel(), rows[:, 1:].ravel()


# --- the series -----------------------------------------------------------------------------------

LANDED = 17
"""Number in `landing_ways.grid`: of the crane's landings the hardest, about to lift off."""


def crane_series(rate: float) -> Series:
    """Return the poses of one run of the crane, `rate` of them a second."""
    pytest.importorskip('mujoco')
    from benchmarks.landing_ways import aimed, grid, land, solvers

    scenario = aimed(grid()[LANDED]).scenario
    load = land(scenario, solvers(scenario, 'mlp'), rate_hz=rate, latency=0.002).poses
    n = len(load)
    return Series(Pairs(np.tile(scenario.stack_pose, (n, 1)), np.array(load), np.tile(
        scenario.stack_size, (n, 1)), np.tile(scenario.size, (n, 1))), 1, {})


APPROACHES, FRAMES = 60, 401
TURN = 0.5
"""Largest angle [rad] by which a box turns in an approach."""


def approaches(name: str, turning: bool) -> Series:
    """Family I: B comes down on a slanted line, rests for an instant, and goes off sideways.

    It takes 4 s at 100 Hz, the speed smooth. Its orientation is fixed, or turns at a constant rate
    (slerp) and is given as q or −q at random.

    In the middle frame it has a pose of the set of that name, and so touches.
    """
    rng = np.random.default_rng(85)
    met = SETS[name](rng, APPROACHES)
    n = len(met.pose_a)
    normal = solve('exact', met).normal
    side = np.cross(normal, rng.normal(size=(n, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    reach = (met.size * rng.uniform(0.1, 0.5, (2, n)))[:, :, None]
    come, go = reach[0] * (normal + rng.uniform(-1, 1, (n, 1)) * side), 2.0 * reach[1] * side
    axis, angle = rng.normal(size=(n, 3)), TURN * turning * rng.uniform(0.1, 1.0, n)

    def repeated(part: np.ndarray) -> np.ndarray:
        return np.repeat(part, FRAMES, axis=0)

    time = np.tile(np.linspace(-1.0, 1.0, FRAMES), n)
    way = (np.abs(time) ** 2 * (3.0 - 2.0 * np.abs(time)))[:, None]
    b = repeated(met.pose_b)
    b[:, :3] += way * np.where(time[:, None] < 0.0, repeated(come), repeated(go))
    if turning:
        b[:, 3:] = quaternion_multiply(turns(repeated(axis), repeated(angle) * time), b[:, 3:])
        b[:, 3:] *= rng.choice([-1.0, 1.0], (len(b), 1))
    return Series(Pairs(repeated(met.pose_a), b, repeated(met.size_a), repeated(met.size_b)), n, {})


CRANES = {f'landed, {rate} Hz': (crane_series, float(rate)) for rate in (200, 1000)}
SERIES = CRANES | {f'{name}, {"turning" if turning else "fixed"}': (approaches, name, turning)
                   for name in SETS for turning in (False, True)}


@pytest.fixture(scope='module', params=[
    pytest.param(name, marks={'landed, 200 Hz': [pytest.mark.slow],
                              'landed, 1000 Hz': [pytest.mark.reports]}.get(name, []))
    for name in SERIES])
def series(request: pytest.FixtureRequest) -> tuple[str, Series]:
    """Name and frames: all tests of a series run one after the other, and share its answers."""
    make, *arguments = SERIES[request.param]
    return request.param, make(*arguments)


# --- what holds in every frame --------------------------------------------------------------------


def test_one_contact_interval_per_approach(series):
    """Boxes on a straight line that do not turn meet once and part once (A ⊕ −B is convex).

    So do boxes on two lines that have a point of contact in common. While they turn, `mlp` begins
    as many contacts as `exact` does, in the same frames. A load that a crane lets down stays, but
    for two frames while it rocks.
    """
    name, motion = series
    pairs, motions, _ = motion
    exact, mlp = motion.solve('exact'), motion.solve('mlp')
    assert np.array_equal(mlp.colliding, exact.colliding)
    begun = contact_intervals(exact, motions)
    print(f'{name}: {exact.colliding.sum()} of {len(pairs.pose_a)} frames in contact, '
          f'{begun.sum()} contacts in {motions} motions')
    assert begun.min() >= 1
    if name in CRANES:
        assert (~exact.colliding[exact.colliding.argmax():]).sum() <= 2
    elif 'turning' not in name:
        assert begun.max() == 1


def test_frames_know_no_history(series):
    """In random order, and with −q for q: the same bits."""
    _, motion = series
    rng = np.random.default_rng(2)
    order = rng.permutation(len(motion.pairs.pose_a))
    other = Pairs(*(part[order] for part in motion.pairs))
    other.pose_b[:, 3:] *= rng.choice([-1.0, 1.0], (len(order), 1))
    for model in ('exact', 'mlp'):
        poses.assert_same_bits(motion.solve(model)[order], solve(model, other))


def test_the_point_keeps_to_its_slope(series):
    """The law of K from frame to frame."""
    name, motion = series
    pairs, motions, _ = motion
    before, after = frames(len(pairs.pose_a), motions)
    found = motion.solve('exact')
    exact = slopes(pairs.rows(before), pairs.rows(after), found[before], found[after])
    print(f'{name}: K of exact {np.nanmax(exact):.2f}')
    assert np.nanmax(exact) <= K


# --- where the point may step, and where not ------------------------------------------------------

N = 50_000
SHALLOWEST, DEEPEST = 1e-6, 0.1
"""Depths, of the shortest edge: well above DEPTH_FLOOR, and to the end of the trained range."""
SHORTEST_STEP, LONGEST_STEP = 1e-7, 1e-3
"""|Δpose|, of the size, about; a tenth of the depth at most, so that the law says something."""


@cache
def small_steps(name: str) -> tuple[Pairs, Pairs]:
    """Contacts of a set, pressed to depths of all magnitudes, and these with B moved a little."""
    rng = np.random.default_rng(9)
    pairs = SETS[name](rng, N)
    shortest = np.minimum(pairs.size_a.min(axis=1), pairs.size_b.min(axis=1))
    pairs = at_depth(pairs, shortest * log_uniform(rng, SHALLOWEST, DEEPEST, len(shortest)))
    n, size = len(pairs.pose_a), pairs.size
    step = np.minimum(size * log_uniform(rng, SHORTEST_STEP, LONGEST_STEP, n),
                      -0.1 * solve('exact', pairs).separation)
    way, axis = rng.normal(size=(2, n, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    turned = rng.random(n)  # share of the step that is a turn
    angle = turned * step / (0.5 * np.linalg.norm(pairs.size_b, axis=1))
    moved = pairs.pose_b.copy()
    moved[:, :3] += ((1.0 - turned) * step)[:, None] * way
    moved[:, 3:] = quaternion_multiply(turns(axis, angle), moved[:, 3:])
    return pairs, pairs._replace(pose_b=moved)


@pytest.mark.parametrize('name', SETS)
def test_points_are_continuous(name):
    """|Δpoint| ≤ K · |Δpose| · size / depth, in every step."""
    pairs, moved = small_steps(name)
    slope = slopes(pairs, moved, solve('exact', pairs), solve('exact', moved))
    print(f'{name}: K {np.nanmax(slope):.2f} in {np.isfinite(slope).sum()} steps')
    assert np.isfinite(slope).sum() > 0.9 * N
    assert np.nanmax(slope) <= K


def patch_slopes(one: Pairs, other: Pairs, before: Contacts, after: Contacts) -> np.ndarray:
    """(n, 2) changes of volume, by itself, and of covariance, by its trace, by |Δpose| / depth.

    Of two volumes and traces the larger, of two depths the lesser.
    """
    depth = -np.maximum(before.separation, after.separation)
    traces = (np.trace(found.covariance, axis1=1, axis2=2) for found in (before, after))
    moved = (np.abs(after.volume - before.volume) / np.maximum(before.volume, after.volume),
             np.linalg.norm(after.covariance - before.covariance, axis=(1, 2))
             / np.maximum(*traces))
    return np.stack(moved, axis=1) * (depth / pose_steps(one, other))[:, None]


K_PATCH = 3.0
"""A corner's volume is as the cube of its depth, hence three."""


@pytest.mark.parametrize('name', SETS)
def test_patches_are_continuous(name):
    """|Δvolume| ≤ K_PATCH · volume · |Δpose| / depth, and so for the covariance by its trace."""
    pairs, moved = small_steps(name)
    before, after = solve('exact', pairs), solve('exact', moved)
    slope = patch_slopes(pairs, moved, before, after)
    both = np.isfinite(slope).all(axis=1) & before.colliding & after.colliding
    print(f'{name}: {slope[both].max(axis=0)}')
    assert both.mean() > 0.9
    assert slope[both].max() <= K_PATCH
