# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The searches for the worst case and for the largest step, and what they find of model `mlp`."""
from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
import search_needles

from benchmarks import steps, worst_case
from benchmarks.errors import contact_errors
from benchmarks.pose_sets import LOADS, SETS, Pairs
from box_contact_ros import ContactSolver

pytestmark = pytest.mark.reports

N = 200


def drawn(name: str, n: int = N, seed: int = 3) -> Pairs:
    return {**SETS, **LOADS}[name](np.random.default_rng(seed), n)


def by_offset(pairs: Pairs) -> np.ndarray:
    """Score: how far B's centre is from the z axis; −1 where the boxes are apart."""
    found = pairs.contacts()
    return np.where(found.colliding, np.hypot(*pairs.pose_b[:, :2].T) / pairs.edge, -1.0)


# --- the climb ------------------------------------------------------------------------------------


@pytest.mark.parametrize('free', [False, True])
@pytest.mark.parametrize('name', ['random sizes', 'containers'])
def test_a_climb_stays_where_it_may(name: str, free: bool) -> None:
    """Depths and sizes of its range; sizes of the set, unless they are free; best first."""
    pairs = drawn(name)
    generations = worst_case.RESTART + 5  # past a restart
    found, scores = worst_case.climb(np.random.default_rng(1), pairs, by_offset,
                                     generations=generations, free_sizes=free)
    start = np.sort(by_offset(pairs))[::-1]
    assert (np.diff(scores) <= 0.0).all() and (scores >= start[:len(scores)]).all()
    assert scores.mean() > start.mean() + 0.02
    np.testing.assert_array_equal(scores, by_offset(found))
    contacts = found.contacts()
    shortest = np.minimum(found.size_a.min(axis=1), found.size_b.min(axis=1))
    low, high = worst_case.DEPTHS
    assert contacts.colliding.all()
    assert (-contacts.separation >= 0.999 * low * shortest).all()
    assert (-contacts.separation <= 1.001 * high * shortest).all()

    def sizes(one: Pairs) -> set[bytes]:
        return {row.tobytes() for row in np.hstack([one.size_a, one.size_b])}

    assert (sizes(found) <= sizes(pairs)) is not free
    if free:
        edges = np.hstack([found.size_a, found.size_b])
        assert (edges.max(axis=1) < worst_case.RATIO_MAX**2 * edges.min(axis=1)).all()
        for size in (found.size_a, found.size_b):
            assert (size.max(axis=1) <= worst_case.RATIO_MAX * size.min(axis=1)).all()


def test_a_search_over_needles() -> None:
    """The bound holds up to an aspect of 300; no eigenvalue is negative, but by rounding."""
    _, shares = next(search_needles.climb(search_needles.by_the_bound, 300.0, 1))
    assert 0.0 < shares[0] <= 1.0
    for _, below in islice(search_needles.climb(search_needles.below_zero, 1e8, 1), 3):
        assert below[0] <= 1e-15


def test_a_climb_starts_from_the_worst() -> None:
    pairs = drawn('random cubes')
    scores = by_offset(pairs)
    np.testing.assert_array_equal(by_offset(worst_case.worst_start(pairs, by_offset, 7)),
                                  np.sort(scores)[::-1][:7])


@pytest.mark.parametrize('name', ['random sizes', 'tilted stacks', 'containers', 'crossed bars'])
def test_the_worst_of_mlp(name: str) -> None:
    """A short climb by the volume's error: point 15 %, volume 60 %, covariance 100 %."""
    solver = ContactSolver(model='mlp')

    def errors(pairs: Pairs) -> np.ndarray:
        with np.errstate(invalid='ignore'):  # NaN: apart
            found = contact_errors(pairs.contacts(solver), pairs.contacts(), pairs.edge)
        return np.nan_to_num(np.stack(found[:3]), nan=-1.0)

    found, scores = worst_case.climb(
        np.random.default_rng(2), drawn(name, 1_000), lambda pairs: errors(pairs)[1],
        generations=30, free_sizes=True)
    point, volume, covariance = errors(found)
    assert 0.02 < scores[0] <= volume.max() <= 60.0
    assert point.max() <= 15.0 and covariance.max() <= 100.0


# --- steps ----------------------------------------------------------------------------------------


class Stepping:
    """Model `exact`, but that the point, volume or covariance steps where B's x passes a place."""

    def __init__(self, at: float, step: float, place: int) -> None:
        self.solver = ContactSolver()
        self.at, self.step, self.place = at, step, place

    def batch(self, pose_a, pose_b, *, size_a, size_b):
        found = self.solver.batch(pose_a, pose_b, size_a=size_a, size_b=size_b)
        beyond = (pose_b[:, 0] > self.at) & found.colliding
        edge = np.minimum(size_a.max(axis=1), size_b.max(axis=1))
        if self.place == 0:
            found.point[beyond, 2] += self.step * edge[beyond]
        elif self.place == 1:
            found.volume[beyond] *= 1.0 + self.step
        else:
            trace = np.trace(found.covariance[beyond], axis1=1, axis2=2)
            found.covariance[beyond, 0, 0] += self.step * trace
        return found


def paths_through_zero(n: int = 6) -> steps.Paths:
    pairs = drawn('containers', n)
    pairs = pairs.rows(slice(n))
    pairs.pose_b[:, 0] = -0.05
    shifts = np.tile([0.1 + 1e-3, 0.0, 0.0], (len(pairs.pose_b), 1))
    return steps.Paths(pairs=pairs, axes=np.tile([0.0, 0, 1], (len(shifts), 1)), angle=1e-3,
                       shifts=shifts)


@pytest.mark.parametrize('place', range(3), ids=['point', 'volume', 'covariance'])
def test_a_planted_step_is_found(place: int) -> None:
    """In its quantity, in its size; and none in the others, nor where the path does not pass it."""
    paths = paths_through_zero()
    colliding = np.all([paths.at(np.arange(len(paths.axes)), np.full(len(paths.axes), time)
                                 ).contacts().colliding for time in (0.45, 0.5, 0.55)], axis=0)
    assert colliding.sum() > 2
    found = steps.largest_steps(Stepping(1e-4, 2e-3, place), paths)
    for number, values in enumerate(found):
        if number == place:
            np.testing.assert_allclose(values[colliding], 0.2, rtol=1e-6)
        else:
            assert values.max() < 1e-6
    for values in steps.largest_steps(Stepping(10.0, 2e-3, place), paths):
        assert values.max() < 1e-6


def test_drawn_paths_start_at_their_pairs_and_turn() -> None:
    pairs = drawn('tilted stacks', 50)
    rows = np.arange(len(pairs.pose_b))
    for flat in (False, True):
        paths = steps.drawn_paths(np.random.default_rng(4), pairs, 0.3, flat)
        np.testing.assert_allclose(paths.at(rows, np.zeros(len(rows))).pose_b, pairs.pose_b,
                                   atol=1e-15)
        end = paths.at(rows, np.ones(len(rows))).pose_b
        cosine = np.abs((end[:, 3:] * pairs.pose_b[:, 3:]).sum(axis=1))
        np.testing.assert_allclose(np.arccos(np.minimum(cosine, 1.0)), 0.15, atol=1e-6)
        assert (np.linalg.norm(end[:, :3] - pairs.pose_b[:, :3], axis=1) > 0.0).all()
