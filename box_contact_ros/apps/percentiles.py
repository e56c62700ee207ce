"""Figures of what a program received, for its log and its report."""
from __future__ import annotations

import math

import numpy as np


def percentile(values: np.ndarray, percent: float) -> float:
    """A percentile of some values (n,); NaN of none."""
    return float(np.percentile(values, percent)) if values.size else math.nan


def angles(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Angles (n,) [deg] between rows of vectors (n, 3); by atan2, as acos loses small angles."""
    sines = np.linalg.norm(np.cross(first, second), axis=1)
    return np.degrees(np.arctan2(sines, np.sum(first * second, axis=1)))
