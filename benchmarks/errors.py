# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of points, volumes and covariances: the one place that all reports ask.

Each error has the unit that its size depends on: the point's is relative to the smaller box's
longest edge, the volume's to the exact volume, the covariance's to the exact one's trace.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from box_contact_ros.solver.contact import Contacts


class ContactErrors(NamedTuple):
    """Errors of n contacts against the exact ones, in %."""

    point: np.ndarray
    """(n,) of the smaller box's longest edge."""
    volume: np.ndarray
    """(n,) of the exact volume; NaN from models that give the point alone."""
    covariance: np.ndarray
    """(n,) Frobenius norm, of the exact covariance's trace; NaN like the volume's."""

    def rows(self, chosen: np.ndarray) -> ContactErrors:
        """Return some of the errors."""
        return ContactErrors(*(errors[chosen] for errors in self))


def degrees_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the angles (n,) [deg] between vectors (n, 3); by atan2, as acos loses small angles."""
    sines = np.linalg.norm(np.cross(a, b), axis=1)
    return np.degrees(np.arctan2(sines, np.sum(a * b, axis=1)))


def contact_errors(found: Contacts, truth: Contacts, edge: np.ndarray) -> ContactErrors:
    """Return the errors of n contacts; edge: see `Pairs.edge`. All pairs touch, by both."""
    return ContactErrors(*map(lengths, departures(found, truth, edge)))


def departures(found: Contacts, truth: Contacts, edge: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return answers minus exact ones [%]: points (n, 3), volumes (n, 1), covariances (n, 9)."""
    trace = np.trace(truth.covariance, axis1=1, axis2=2)
    return tuple(100.0 * difference.reshape(len(edge), -1) / unit[:, None] for difference, unit in (
        (found.point - truth.point, edge), (found.volume - truth.volume, truth.volume),
        (found.covariance - truth.covariance, trace)))


def point_errors(points: np.ndarray, truth: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Return the errors (n,) of points (n, 3) alone, in % as in `ContactErrors`."""
    return 100.0 * distances(points, truth) / edge


def distances(points: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return how far points (n, 3) are from the true ones, (n,) [m]."""
    return lengths(points - truth)


def lengths(vectors: np.ndarray) -> np.ndarray:
    """Return how long vectors (n, k) are, (n,)."""
    return np.linalg.norm(vectors, axis=1)
