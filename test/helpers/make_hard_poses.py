# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write the hard poses, with their truth in 60 digits: benchmarks/hard_poses.npz.

    python test/helpers/make_hard_poses.py [FAMILY ...]

Families that are not named stay as they are: another machine may round a recipe differently. Once
written, the file is what tests and reports read (see `hard_poses.py` beside it).
"""
from __future__ import annotations

import argparse
import sys
from importlib import import_module
from pathlib import Path

import hard_pose_recipes as recipes
import numpy as np
import oracle
from gmpy2 import mpfr
from tqdm import tqdm

sys.path.append(str(Path(__file__).resolve().parents[2]))  # for benchmarks/
hard_poses = import_module('benchmarks.hard_poses')

FLOOR = mpfr(10)**-9
"""Depth, of the size, below which the point is that of boxes pressed in: no truth for it here."""


def truth(a, b, size_a, size_b):
    """Largest gap, and the overlap's centroid from A's position, volume and covariance."""
    box_a, box_b = oracle.make_box(a, size_a), oracle.make_box(b, size_b)
    gap = oracle.separation(box_a, box_b)
    size = mpfr(float(max(*size_a, *size_b)))
    centroid = None
    if gap < -FLOOR * size:
        volume, centroid, spread = oracle.moments(box_a, box_b)
    if centroid is None:
        return float(gap), np.full(3, np.nan), np.nan, np.full((3, 3), np.nan)
    covariance = np.array([oracle.as_array(row) for row in spread])
    centroid = oracle.as_array(oracle.add(centroid, box_a.centre, -1))
    return float(gap), centroid, float(volume), covariance


def judged(name):
    """Return a family's arrays as its recipe draws it, every case judged."""
    pairs = recipes.generate(name)
    found = zip(*(truth(*row) for row in zip(*pairs)))
    return {f'{name}.{part}': values for part, values in pairs._asdict().items()} | {
        f'{name}.{part}': np.array(values) for part, values in zip(
            hard_poses.Cases._fields[1:], found, strict=True)}


def main():
    """Write all families, those that are named anew."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('families', nargs='*', metavar='FAMILY', help='names of recipes')
    chosen = parser.parse_args().families or list(recipes.FAMILIES)
    if unknown := set(chosen) - set(recipes.FAMILIES):
        parser.error(f'no recipe: {", ".join(sorted(unknown))}')
    with np.load(hard_poses.FILE) as stored:
        kept = {key: values for key, values in stored.items()
                if key.partition('.')[0] not in chosen}
    arrays = {}
    for name in tqdm(recipes.FAMILIES, unit='family'):
        arrays |= judged(name) if name in chosen else {
            key: values for key, values in kept.items() if key.partition('.')[0] == name}
    np.savez_compressed(hard_poses.FILE, **arrays)
    total = sum(len(values) for key, values in arrays.items() if key.endswith('.gap'))
    print(f'{hard_poses.FILE}: {total} cases, {hard_poses.FILE.stat().st_size / 1e6:.2f} MB')


if __name__ == '__main__':
    main()
