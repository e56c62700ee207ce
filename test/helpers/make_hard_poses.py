"""Write box_contact_ros/verification/hard_poses.npz: the hard poses, with their truth in 60 digits.

    python test/helpers/make_hard_poses.py

Once written, the file is what tests and reports read
(see `box_contact_ros.verification.hard_poses`).
"""
from __future__ import annotations

import hard_pose_recipes as recipes
import numpy as np
import oracle
from gmpy2 import mpfr
from tqdm import tqdm

from box_contact_ros.verification import hard_poses

FLOOR = mpfr(10)**-9
"""Depth, of the size, below which the point is that of boxes pressed in: no truth for it here."""


def truth(a, b, size_a, size_b):
    """Largest gap, and the overlap's centroid from A's position, volume and covariance."""
    box_a, box_b = oracle.make_box(a, size_a), oracle.make_box(b, size_b)
    gap = oracle.separation(box_a, box_b)
    size = mpfr(float(max(*size_a, *size_b)))
    centroid = None
    if gap < -FLOOR * size:
        volume, centroid = oracle.overlap(box_a, box_b)
    if centroid is None:
        return float(gap), np.full(3, np.nan), np.nan, np.full((3, 3), np.nan)
    covariance = np.array([oracle.as_array(row) for row in oracle.covariance(box_a, box_b)])
    centroid = oracle.as_array(oracle.add(centroid, box_a.centre, -1))
    return float(gap), centroid, float(volume), covariance


def main():
    """Generate all families and judge every case."""
    arrays = {}
    for name in tqdm(recipes.FAMILIES, unit='family'):
        pairs = recipes.generate(name)
        found = zip(*(truth(*row) for row in zip(*pairs)))
        arrays |= {f'{name}.{part}': values for part, values in pairs._asdict().items()}
        arrays |= {f'{name}.{part}': np.array(values) for part, values in zip(
            hard_poses.Cases._fields[1:], found, strict=True)}
    np.savez_compressed(hard_poses.FILE, **arrays)
    total = sum(len(values) for key, values in arrays.items() if key.endswith('.gap'))
    print(f'{hard_poses.FILE}: {total} cases, {hard_poses.FILE.stat().st_size / 1e6:.2f} MB')


if __name__ == '__main__':
    main()
