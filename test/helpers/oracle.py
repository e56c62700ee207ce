# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Slow, obvious truth for two boxes, in 60-digit arithmetic. Shares no code with the package.

Inputs are the very doubles a solver gets; everything after them is MPFR: quaternions are
normalised to 60 digits, the 15 axes are tested as the textbook writes them, and the overlap's
moments come from its faces: each face of either box, clipped by the other box's six half-spaces, is
one side of a pyramid whose apex lies inside. Pyramids are cut into tetrahedra.
"""
from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from gmpy2 import get_context, mpfr, sqrt

BITS = 203
"""60 digits, as mpmath counts them: the stored truth was made with so many bits."""
get_context().precision = BITS
ZERO, ONE = mpfr(0), mpfr(1)
SAME = mpfr(10)**-40
"""Lengths below this are zero: 20 digits above the rounding of 60-digit arithmetic, and 20 below
anything that doubles can express between boxes of everyday sizes."""


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def add(a, b, factor=1):
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


def scaled(a, factor):
    return (a[0] * factor, a[1] * factor, a[2] * factor)


@dataclass(frozen=True)
class Box:
    """Centre, unit axes (as rows) and half extents, all in 60 digits."""

    centre: tuple
    axes: tuple
    half: tuple

    def face(self, k, sign):
        """Corners of the face `sign` times axis k, in cyclic order."""
        i, j = (k + 1) % 3, (k + 2) % 3
        middle = add(self.centre, self.axes[k], sign * self.half[k])
        return [add(add(middle, self.axes[i], s * self.half[i]), self.axes[j], t * self.half[j])
                for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]

    def width(self, axis):
        """Half width of the projection on a unit axis."""
        return sum(h * abs(dot(e, axis)) for h, e in zip(self.half, self.axes))


def make_box(pose, size):
    assert get_context().precision == BITS  # a thread's own: another one rounds to 53
    x, y, z, qx, qy, qz, qw = (mpfr(float(v)) for v in pose)
    n2 = qx * qx + qy * qy + qz * qz + qw * qw
    s = 2 / n2
    axes = ((1 - s * (qy * qy + qz * qz), s * (qx * qy + qw * qz), s * (qx * qz - qw * qy)),
            (s * (qx * qy - qw * qz), 1 - s * (qx * qx + qz * qz), s * (qy * qz + qw * qx)),
            (s * (qx * qz + qw * qy), s * (qy * qz - qw * qx), 1 - s * (qx * qx + qy * qy)))
    return Box((x, y, z), axes, tuple(mpfr(float(v)) / 2 for v in size))


def axis_gaps(a, b):
    """Yield number, unit axis from A to B and gap of every axis: 0–2, 3–5, 6 + 3 i + j."""
    t = add(b.centre, a.centre, -1)
    found = []
    candidates = list(a.axes) + list(b.axes) + [cross(u, v) for u in a.axes for v in b.axes]
    for number, axis in enumerate(candidates):
        length = sqrt(dot(axis, axis))
        if length < SAME:
            continue
        axis = scaled(axis, 1 / length)
        along = dot(t, axis)
        if along < 0:
            axis, along = scaled(axis, -1), -along
        found.append((number, axis, along - a.width(axis) - b.width(axis)))
    return found


def separation(a, b):
    """Largest gap over the axes."""
    return max(gap for _, _, gap in axis_gaps(a, b))


def nearest(a, b):
    """Return the distance of two boxes apart, a nearest point on each, and the distance's doubt.

    Where no edges cross, a vertex of one box is nearest to the other: 16 vertices are clamped, and
    the crossings of all 144 pairs of edges tried. The gap along the way found is a lower bound of
    the distance; the doubt is what it stays below.
    """
    found = [*_clamped(a, b), *((p, q) for q, p in _clamped(b, a)), *_crossings(a, b)]
    p, q = min(found, key=lambda points: dot(*2 * [add(points[1], points[0], -1)]))
    way = add(q, p, -1)
    distance = sqrt(dot(way, way))
    direction = scaled(way, 1 / distance)
    gap = dot(add(b.centre, a.centre, -1), direction) - a.width(direction) - b.width(direction)
    return distance, p, q, distance - gap


def _clamped(a, b):
    """Yield each vertex of A and its nearest point on B."""
    for signs in itertools.product((-1, 1), repeat=3):
        vertex = a.centre
        for sign, half, axis in zip(signs, a.half, a.axes):
            vertex = add(vertex, axis, sign * half)
        point = b.centre
        for half, axis in zip(b.half, b.axes):
            along = dot(add(vertex, b.centre, -1), axis)
            point = add(point, axis, max(-half, min(half, along)))
        yield vertex, point


def _edges(box):
    """Yield the middle, unit direction and half length of each edge."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        for s, t in itertools.product((-1, 1), repeat=2):
            middle = add(add(box.centre, box.axes[i], s * box.half[i]), box.axes[j],
                         t * box.half[j])
            yield middle, box.axes[k], box.half[k]


def _crossings(a, b):
    """Yield the nearest points of the lines of two edges, where both are within their edges."""
    for middle_a, u, half_a in _edges(a):
        for middle_b, v, half_b in _edges(b):
            normal, between = cross(u, v), add(middle_b, middle_a, -1)
            length2 = dot(normal, normal)
            if length2 < SAME * SAME:
                continue
            on_a = dot(cross(between, v), normal) / length2
            on_b = dot(cross(between, u), normal) / length2
            if abs(on_a) <= half_a and abs(on_b) <= half_b:
                yield add(middle_a, u, on_a), add(middle_b, v, on_b)


def _clip(polygon, axis, bound, drop_on_plane):
    """Cut a polygon to dot(axis, p) ≤ bound; a polygon IN the plane goes or stays."""
    excess = [dot(axis, p) - bound for p in polygon]
    if all(abs(e) < SAME for e in excess):
        return [] if drop_on_plane else polygon
    kept = []
    for i, (p, e) in enumerate(zip(polygon, excess)):
        q, f = polygon[i - 1], excess[i - 1]
        if (e > 0) != (f > 0):
            kept.append(add(q, add(p, q, -1), f / (f - e)))
        if e <= 0:
            kept.append(p)
    return kept


def overlap_faces(a, b):
    """Return the faces of A∩B as polygons. Where faces of A and B lie in one plane, A's counts."""
    faces = []
    for box, other in ((a, b), (b, a)):
        for k in range(3):
            for sign in (1, -1):
                polygon = box.face(k, sign)
                outward = scaled(box.axes[k], sign)
                for m in range(3):
                    for s in (1, -1):
                        axis = scaled(other.axes[m], s)
                        bound = dot(axis, other.centre) + other.half[m]
                        # In one plane: looking the same way, it is one face of the overlap and
                        # must count once; looking opposite ways, the overlap has no volume there.
                        same_way = dot(axis, outward) > 0
                        if polygon:
                            polygon = _clip(polygon, axis, bound, same_way and box is b)
                if len(polygon) >= 3:
                    faces.append(polygon)
    return faces


def pyramids(faces, apex):
    """Yield the tetrahedra of a convex body: three corners from its apex, and the volume."""
    for face in faces:
        p = add(face[0], apex, -1)
        for i in range(1, len(face) - 1):
            q, r = add(face[i], apex, -1), add(face[i + 1], apex, -1)
            yield p, q, r, abs(dot(p, cross(q, r))) / 6


def moments(a, b):
    """Return volume, centroid and covariance of A∩B; None for both where there is no volume.

    A tetrahedron of corners p, q, r, s from any origin has ∫ x xᵀ dV = v/20 · (p pᵀ + q qᵀ + r rᵀ +
    s sᵀ + m mᵀ), with v its volume and m the sum of its corners. Here s is the centroid of A∩B.
    """
    faces = overlap_faces(a, b)
    corners = [p for face in faces for p in face]
    if not corners:
        return ZERO, None, None
    apex = scaled((sum(p[0] for p in corners), sum(p[1] for p in corners),
                   sum(p[2] for p in corners)), ONE / len(corners))
    volume, moment = ZERO, (ZERO, ZERO, ZERO)
    for p, q, r, v in pyramids(faces, apex):
        volume += v
        moment = add(moment, add(add(p, q), r), v / 4)
    if volume <= 0:
        return ZERO, None, None
    centroid = add(apex, moment, 1 / volume)
    total = [[ZERO] * 3 for _ in range(3)]
    for p, q, r, v in pyramids(faces, centroid):
        m = add(add(p, q), r)
        for j in range(3):
            for k in range(j + 1):
                total[j][k] += v / 20 * (p[j] * p[k] + q[j] * q[k] + r[j] * r[k] + m[j] * m[k])
    covariance = tuple(tuple(total[max(j, k)][min(j, k)] / volume for k in range(3))
                       for j in range(3))
    return volume, centroid, covariance


def pressed(a, b, axis, depth, floor):
    """B moved against `axis` (from A to B) until the depth is `floor`, where it is less."""
    return b if depth >= floor else Box(add(b.centre, axis, depth - floor), b.axes, b.half)


def contact_moments(a, b, axis, depth, size):
    """Return volume, centroid, covariance of A∩B, pressed in to 1e-9 · size: the definition.

    Volume and covariance are None where several axes have gap zero, and pressing along the normal
    leaves less than half of that depth: the package goes on along the others.
    """
    floor = mpfr(10)**-9 * mpfr(float(size))
    moved = pressed(a, b, axis, depth, floor)
    volume, centroid, covariance = moments(a, moved)
    if depth < floor and separation(a, moved) > -0.51 * floor:
        return None, centroid, None
    return volume, centroid, covariance


def as_array(vector):
    return np.array([float(v) for v in vector])
