# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Search needles and plates for the worst covariances of model `exact`.

    python test/helpers/search_needles.py [--minutes MINUTES] [--seed SEED]

For each largest aspect, pairs climb to the largest error against the 60-digit oracle, and to the
least eigenvalue. The worst are printed, with their poses.
"""
from __future__ import annotations

import argparse
import sys
import time
from importlib import import_module
from pathlib import Path

import numpy as np
import oracle
import poses
from gmpy2 import mpfr

from box_contact_ros import ContactSolver
from box_contact_ros.core import DEPTH_FLOOR

sys.path.append(str(Path(__file__).resolve().parents[2]))  # for benchmarks/
worst_case = import_module('benchmarks.worst_case')
Pairs = import_module('benchmarks.pose_sets').Pairs

ASPECTS = (300.0, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8)
"""Longest edge of a box by its shortest, at most."""
DEPTHS = (0.01, np.inf)  # deeper than the shortest edge too: a needle through a box
DRAWN, CLIMBING = 600, 45  # pairs, as those of benchmarks/searched.py
SOLVER = ContactSolver()


def solved(pairs):
    """Return the contacts of pairs by `exact`."""
    return SOLVER.batch(*pairs[:2], size_a=pairs.size_a, size_b=pairs.size_b)


def covariance_errors(pairs):
    """Return errors (n,) [of the trace] and their documented bounds; NaN where there is none."""
    found, errors = solved(pairs), np.full(len(pairs.pose_a), np.nan)
    for row in np.flatnonzero(found.colliding):
        box_a, box_b = (oracle.make_box(pose[row], size[row]) for pose, size in (
            (pairs.pose_a, pairs.size_a), (pairs.pose_b, pairs.size_b)))
        axis = tuple(mpfr(float(value)) for value in found.normal[row])
        depth = mpfr(-float(found.separation[row]))
        _, _, spread = oracle.contact_moments(box_a, box_b, axis, depth, float(pairs.size[row]))
        if spread is not None:
            truth = np.array([oracle.as_array(line) for line in spread])
            errors[row] = np.linalg.norm(found.covariance[row] - truth) / np.trace(truth)
    depth = np.maximum(-found.separation / pairs.size, DEPTH_FLOOR)
    return errors, np.maximum(1e-8, 1e-14 / depth)


def by_the_bound(pairs):
    """Score: the covariance's error by its bound."""
    return np.nan_to_num(np.divide(*covariance_errors(pairs)), nan=-1.0)


def below_zero(pairs):
    """Score: how far the least eigenvalue is below zero [of the trace]."""
    found, score = solved(pairs), np.full(len(pairs.pose_a), -1.0)
    spread = found.covariance[found.colliding]
    least = np.linalg.eigvalsh(spread)[:, 0] / np.trace(spread, axis1=1, axis2=2)
    score[found.colliding] = -least
    return score


def climb(score, aspect, seed):
    """Yield pairs of aspects up to this and their scores, best first, round after round."""
    rng = np.random.default_rng([seed, int(aspect)])
    drawn = Pairs(*poses.needles(rng, DRAWN, aspect / 3))  # their sizes vary by e
    pairs = worst_case.worst_start(drawn, score, CLIMBING)
    while True:
        pairs, scores = worst_case.climb(rng, pairs, score, generations=worst_case.RESTART,
                                         free_sizes=True, aspect_max=aspect, depths=DEPTHS)
        yield pairs, scores


def main():
    """Search, and print a line and a pose for each largest aspect."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--minutes', type=float, default=10.0, help='in all (default: %(default)g)')
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    seconds = 60.0 * options.minutes / len(ASPECTS)
    for aspect in ASPECTS:
        pairs, shares = climbed(by_the_bound, aspect, options.seed, 0.8 * seconds)
        errors, _ = covariance_errors(pairs.rows(slice(1)))
        _, below = climbed(below_zero, aspect, options.seed, 0.2 * seconds)
        print(f'aspect to {aspect:g}: {shares[0]:.2g} of the bound, {errors[0]:.2g} of the trace; '
              f'least eigenvalue {-below[0]:.2g} of the trace')
        print('   ', [part[0].tolist() for part in pairs], flush=True)


def climbed(score, aspect, seed, seconds):
    """Return what a climb of so many seconds has found."""
    end = time.monotonic() + seconds
    return next(found for found in climb(score, aspect, seed) if time.monotonic() > end)


if __name__ == '__main__':
    main()
