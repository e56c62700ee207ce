# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A tree of oriented boxes around a polygon soup, and the box tests that a query takes.

The tree is that of Gottschalk, Lin and Manocha (1996), whose library RAPID the paper uses. A node's
box has the axes of the covariance of its triangles' areas. The node is split across its longest
axis, at the mean. A query tests the roots, and then the children of each pair of boxes that
overlap; it descends into the longer box. RAPID counts these tests, python-fcl hands no number out.
"""
from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from box_contact_ros.models import soup
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.pose import rotation_matrix

from ..pose_sets import CUBE, Pairs, quaternion_multiply

THICKNESS = 1e-9  # of a box around triangles in one plane [m]
DIGITS = 12
"""Decimals of a covariance [m²] and of a triangle's place [m] along the longest axis. A cube's
triangles are symmetric: without a rounding, the last bit would choose axes and sides."""
PATTERNS = 64  # that are asked at a time


class Tree(NamedTuple):
    """The n boxes of a tree, in the soup's frame; the root is the first."""

    pose: np.ndarray  # (n, 7)
    size: np.ndarray  # (n, 3) full extents [m], the longest first but for rare small boxes
    children: np.ndarray  # (n, 2) numbers of the two boxes within, −1 of a triangle's own box


@cache
def tree(divisions: int) -> Tree:
    """Return the tree of a cube's soup of N divisions."""
    corners = soup.triangles(CUBE, divisions)  # (triangles, 3, 3)
    middle = corners.mean(axis=1)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(across, axis=1)
    # ∫ x xᵀ over a triangle of corners p and middle m: area / 12 · (9 m mᵀ + Σ p pᵀ).
    second = area[:, None, None] / 12.0 * (9.0 * np.einsum('ni,nj->nij', middle, middle)
                                           + np.einsum('nki,nkj->nij', corners, corners))
    nodes: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []  # centre, axes, size
    children: list[tuple[int, int]] = []

    def add(rows: np.ndarray) -> int:
        """Add the box around some triangles and all boxes within; return its number."""
        mean = area[rows] @ middle[rows] / area[rows].sum()
        covariance = second[rows].sum(axis=0) / area[rows].sum() - np.outer(mean, mean)
        axes = np.linalg.eigh(np.round(covariance, DIGITS))[1][:, ::-1].copy()
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
        reach = corners[rows].reshape(-1, 3) @ axes
        low, high = reach.min(axis=0), reach.max(axis=0)
        number = len(nodes)
        nodes.append((axes @ (0.5 * (low + high)), axes, high - low + THICKNESS))
        children.append((-1, -1))
        if len(rows) > 1:
            first = np.round((middle[rows] - mean) @ axes[:, 0], DIGITS) < 0.0
            if not first.any():
                first = np.arange(len(rows)) < len(rows) // 2
            children[number] = add(rows[first]), add(rows[~first])
        return number

    add(np.arange(len(corners)))
    centre, axes, size = map(np.array, zip(*nodes))
    return Tree(np.concatenate([centre, quaternion_from_matrix(axes)], axis=1), size,
                np.array(children))


def quaternion_from_matrix(rotation: np.ndarray) -> np.ndarray:
    """Return the quaternions (n, 4) xyzw of rotations (n, 3, 3).

    q is the eigenvector of the largest eigenvalue of K, qᵀ K q = trace(Rᵀ R(q)) (Bar-Itzhack 2000).
    """
    diagonal = np.diagonal(rotation, axis1=1, axis2=2)
    k = np.zeros((len(rotation), 4, 4))
    k[:, :3, :3] = rotation + rotation.swapaxes(1, 2)
    k[:, range(3), range(3)] = 2.0 * diagonal - diagonal.sum(axis=1, keepdims=True)
    k[:, 3, :3] = k[:, :3, 3] = (rotation[:, [2, 0, 1], [1, 2, 0]]
                                 - rotation[:, [1, 2, 0], [2, 0, 1]])
    k[:, 3, 3] = diagonal.sum(axis=1)
    return np.linalg.eigh(k)[1][:, :, -1]


def count_tests(boxes: Tree, pairs: Pairs) -> np.ndarray:
    """Return the box tests (n,) of queries on n pairs of cubes, A's frame that of both poses."""
    parts = range(0, len(pairs.size), PATTERNS)
    return np.concatenate([_count(boxes, pairs.pose_b[start:start + PATTERNS]) for start in parts])


def _count(boxes: Tree, pose_b: np.ndarray) -> np.ndarray:
    solver = ContactSolver(CUBE, CUBE)
    turn = rotation_matrix(pose_b[:, 3:])
    tests = np.zeros(len(pose_b), np.int64)
    query = np.arange(len(pose_b))  # of each pair of boxes to be tested
    a, b = np.zeros((2, len(query)), np.int64)  # its boxes
    while len(query):
        tests += np.bincount(query, minlength=len(tests))
        local = boxes.pose[b]
        placed = np.concatenate([
            pose_b[query, :3] + np.einsum('nij,nj->ni', turn[query], local[:, :3]),
            quaternion_multiply(pose_b[query, 3:], local[:, 3:])], axis=1)
        met = solver.batch(boxes.pose[a], placed, size_a=boxes.size[a], size_b=boxes.size[b],
                           patch=False).colliding
        query, a, b = query[met], a[met], b[met]
        leaf_a, leaf_b = (boxes.children[box, 0] < 0 for box in (a, b))
        inner = ~(leaf_a & leaf_b)
        into_a = leaf_b | ~leaf_a & (boxes.size[a, 0] > boxes.size[b, 0])
        query, a, b, into_a = query[inner], a[inner], b[inner], into_a[inner, None]
        a, b = (np.where(into, boxes.children[box], box[:, None]).ravel()
                for into, box in ((into_a, a), (~into_a, b)))
        query = np.repeat(query, 2)
    return tests
