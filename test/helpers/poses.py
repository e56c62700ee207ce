# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Families of poses that many tests draw from. Every one is seeded and stored as doubles."""
from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros.solver.contact import FIELDS
from box_contact_ros.solver.contact_solver import ContactSolver

CONTAINER = (12.192, 2.438, 2.591)
CUBE = (2.0, 2.0, 2.0)
IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
HARD_POSES = Path(__file__).resolve().parents[2] / 'benchmarks' / 'hard_poses.npz'


class Pairs(NamedTuple):
    """n pairs: poses (n, 7), full extents (n, 3)."""

    pose_a: np.ndarray
    pose_b: np.ndarray
    size_a: np.ndarray
    size_b: np.ndarray

    def first(self, count: int) -> Pairs:
        return Pairs(*(part[:count] for part in self))


def fields(found):
    """Return the fields of a Contact or of Contacts as a tuple."""
    return tuple(getattr(found, name) for name in FIELDS)


def assert_same_bits(one, other, *names, where=None):
    """Check that two Contact or Contacts have equal fields: all, or those that are named."""
    for name in names or FIELDS:
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), (
            name, where)


def joined(*parts: tuple[np.ndarray, ...]) -> Pairs:
    return Pairs(*(np.ascontiguousarray(np.concatenate(columns)) for columns in zip(*parts)))


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


def at_depth(size, n=4000, depth=0.0, seed=9):
    """Pairs of equal boxes in any orientation, `depth` [m] deep along SAT's normal."""
    rng = np.random.default_rng(seed)
    a = np.concatenate([rng.uniform(-9, 9, (n, 3)), unit_quaternions(rng, n)], axis=1)
    within = rotate(a[:, 3:], rng.uniform(-0.5, 0.5, (n, 3)) * size)
    turn = unit_quaternions(rng, n)
    within_b = rotate(turn, rng.uniform(-0.5, 0.5, (n, 3)) * size)
    b = np.concatenate([a[:, :3] + within - within_b, turn], axis=1)
    found = ContactSolver(size, size).batch(a, b)
    assert found.colliding.all()
    b[:, :3] += (-found.separation - depth)[:, None] * found.normal
    return a, b


def near_parallel_pairs(rng, n):
    """Stacked boxes: tilt 0 and 1e-16 to 0.1 rad about axes of all kinds, gap ±1e-12 to ±1e-1 m.

    Lateral offsets: none, exactly flush sides (half an extent), or random. Half of the pairs are
    then moved rigidly, so that no axis is a coordinate axis.
    """
    size = np.array(CONTAINER)
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


def flush_pairs(rng, n):
    """Stacked containers with sides in one plane, but for 60 ulps and a tilt of 1e-17 to 1e-11 rad.

    The upper one is as large, or half as long and at one end. A third of the pairs is turned.
    """
    size = np.array(CONTAINER)
    size_a, size_b = np.tile(size, (n, 1)), np.tile(size, (n, 1))
    halved = rng.random(n) < 0.5
    size_b[halved, 0] /= 2
    along = rng.choice([0.0, 0.5, -0.5], (n, 2)) * size[:2]
    along[halved, 0] = rng.choice([-0.25, 0.25], int(halved.sum())) * size[0]
    along += rng.integers(-60, 61, (n, 2)) * np.spacing(size.max()) / 2
    axes = rng.normal(size=(n, 3))
    kind = rng.integers(0, 4, n)
    for k, axis in enumerate(np.eye(3)):
        axes[kind == k] = axis
    angles = 10.0**rng.uniform(-17, -11, n) * rng.choice([-1.0, 0.0, 1.0], n, p=[0.45, 0.1, 0.45])
    deep = 10.0**rng.uniform(-9, 0, n)
    b = np.concatenate([along, (size[2] - deep)[:, None], small_rotations(axes, angles)], axis=1)
    a = np.tile(IDENTITY, (n, 1))
    turn = unit_quaternions(rng, n)
    turn[rng.random(n) < 0.67] = IDENTITY[3:]
    return (*(moved(pose, np.zeros((n, 3)), turn) for pose in (a, b)), size_a, size_b)


def equal_thickness(rng, n):
    """Boxes of one thickness, turned about a common axis, flush on both sides, in any orientation.

    Half have the same middle, half of those the same size too, and some the same pose. Rounding
    makes a saddle of a face that lies in the other box's far face.
    """
    size_a, size_b = np.exp(rng.uniform(-1, 1, (2, n, 3)))
    kind = rng.integers(0, 4, n)
    size_b[kind < 2] = size_a[kind < 2]
    size_b[:, 2] = size_a[:, 2] = size_a[:, 2] * rng.choice([1.0, 0.1], n)
    reach = np.minimum(size_a[:, :2], size_b[:, :2]).min(axis=1)
    place = np.zeros((n, 3))
    place[:, :2] = (rng.uniform(-0.5, 0.5, (n, 2)) * reach[:, None]) * (kind % 2)[:, None]
    yaw = rng.uniform(-np.pi, np.pi, n) * (rng.random(n) < 0.8)
    b = np.concatenate([place, small_rotations(np.tile([0.0, 0, 1], (n, 1)), yaw)], axis=1)
    a = np.tile(IDENTITY, (n, 1))
    turn, zero = unit_quaternions(rng, n), np.zeros((n, 3))
    return moved(a, zero, turn), moved(b, zero, turn), size_a, size_b


def ridges(rng, n):
    """Return a box with an edge down on another's face, turned, and cut off by the face's rim.

    Most are hardly inclined: of such slivers, as thin as they are deep, a millionth of their length
    and less, the oblique ends have to be right too.
    """
    size_a, size_b = np.exp(rng.uniform(-1, 1, (2, n, 3)))
    x, y, z = np.eye(3)[:, None]
    inclined = 10.0**rng.uniform(-10, -1, n) * rng.choice([-1, 0, 1], n)
    turn = multiply(small_rotations(z, rng.uniform(-np.pi, np.pi, n)), multiply(
        small_rotations(y, inclined), small_rotations(x, rng.uniform(0.2, 1.37, n))))
    reach = 0.5 * sum(abs(rotate(turn, axis)[:, 2]) * extent
                      for axis, extent in zip((x, y, z), size_b.T))
    deep = 10.0**rng.uniform(-9, -2, n) * rng.choice([0, 1], n, p=[0.2, 0.8])
    along = rng.uniform(-0.6, 0.6, (n, 2)) * size_a[:, :2]
    b = np.concatenate([along, (0.5 * size_a[:, 2] + reach - deep)[:, None], turn], axis=1)
    whole = unit_quaternions(rng, n)
    return (*(moved(pose, np.zeros((n, 3)), whole)
              for pose in (np.tile(IDENTITY, (n, 1)), b)), size_a, size_b)


def cards(rng, n):
    """Plates of 1e-6 to 0.1 of their size, through each other: rods, cut off obliquely."""
    size_a, size_b = np.exp(rng.uniform(-1, 1, (2, n, 3)))
    size_a[:, 0] *= 10.0**rng.uniform(-6, -1, n)
    size_b[:, 2] *= 10.0**rng.uniform(-6, -1, n)
    a, b = (np.concatenate([place, unit_quaternions(rng, n)], axis=1)
            for place in (np.zeros((n, 3)), rng.normal(size=(n, 3)) * 0.3))
    return a, b, size_a, size_b


NEEDLE = ((0, 0, 0, -.6680072783375012, -.5329684740396613, -.003947982704248489,
           -.5193219571715855),
          (.3551259815683192, .1129042864546822, -.4845977124395742, -.6966290338400403,
           -.516764130576864, -.06430381572748332, -.49348540185411327),
          (1, 2.5298221281347034e-06, 3.162277660168379e-06), (3.162277660168379e-06, .7, 1))
"""A pair whose covariance clipping had wrong by 4.5 % of the trace."""


COLUMNS = (
    (((-2.1202866097269535, -2.6849996044871727, -0.753068148279078, 0.12294126595601719,
       0.1303906082373647, -0.026166878391238855, 0.9834627745287974),
      (-1.7781878462167713, -3.9056239636911863, -0.09994410102567175, 0.026027695392891126,
       0.9833145457514334, 0.1229708073981175, -0.131503778326109)),
     ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))),
    (((-2.7844951447516024, 0.01312863852103238, -0.5307414244043476, -0.21170182374521077,
       0.5942941918858717, -0.7038253491907077, 0.3265373319396245),
      (-2.808905416988041, -0.07567636910175973, 2.1746033339004187, 0.703601556755608,
       0.3270192664733305, -0.2112947748312134, -0.5944390354067912)),
     ((0.1974258591217482, 0.4371672889577224, 0.18898132588375582),
      (0.6734337125695316, 4.832516349295209, 1.005292752857484))),
    (((1.0258078530031718, 3.290794650061599, 0.5795457440239902, 0.6248795324990188,
       -0.024218795097991647, 0.7793152726699801, 0.04008398197688978),
      (0.32113388309052515, 0.7083567101965413, 1.1876449473685313, 0.0850948064206749,
       0.06934627527088572, -0.6699530857427856, -0.7342430326056912)),
     ((1.1001268510936384, 5.145611642899582, 0.5189853541614936),
      (0.14199844396911854, 0.13223909082101476, 2.6488273527072463))))
"""Pairs whose overlap is a column, thin along two axes. Planes had their covariances wrong by 1.9,
2.0 and 4.6 times the bound; the third one was clipped by an older rule."""


SMALL_ON_LARGE = (
    (((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0),
      (311.0063914474065, 0.3693097171655872, -258.0000197747159, 0.060483689629763505,
       0.24478058841482744, 0.9675645900005595, -0.015593299879129567)),
     ((619.9919811607696, 201.97106256235233, 515.3443006624155),
      (2.0872070950608475, 0.8383097639808081, 1.064924939772842))),
    (((-3.2093002708699925, 6.014857882930009, -3.8998299991626295, -0.2866095989034997,
       0.6700178849757219, 0.06056630708916049, -0.6821016742939551),
      (349.9362635385414, -102.318672696867, -97.7341703536447, -0.02858008542172766,
       -0.7002695900264765, -0.2647738107945535, -0.6623448566409926)),
     ((1.175793185820693, 0.4727014836899446, 0.5240180923227566),
      (438.2600140692474, 482.16845915235234, 589.8423783038813))))
"""Pairs whose overlap is thin and pointed: an edge of the small box dips into the large one. Planes
had their covariances wrong by 1.5 and 1.6 times the bound."""


def needles(rng, n, aspect):
    """Needles, plates of this aspect and other boxes, deep in each other, many almost parallel."""
    sizes = []
    for _ in range(2):
        size = np.exp(rng.uniform(-0.5, 0.5, (n, 3)))
        thin = rng.integers(0, 3, n)[:, None] > np.arange(3)  # none, one or two extents
        size[thin] /= aspect
        sizes.append(rng.permuted(size, axis=1))
    turn_a = unit_quaternions(rng, n)
    angle = 10.0**rng.uniform(-np.log10(aspect) - 1.0, 0.0, n)
    near = turn_a + rng.normal(size=(n, 4)) * angle[:, None]
    turn_b = np.where((rng.random(n) < 2 / 3)[:, None], near, unit_quaternions(rng, n))
    turn_b /= np.linalg.norm(turn_b, axis=1)[:, None]
    in_a, in_b = (rng.uniform(-0.5, 0.5, (n, 3)) * size for size in sizes)
    place = rotate(turn_a, in_a) - rotate(turn_b, in_b)
    return (np.concatenate([np.zeros((n, 3)), turn_a], axis=1),
            np.concatenate([place, turn_b], axis=1), *sizes)


def sharing_an_axis(rng, n):
    """Boxes turned about an axis of both, with an edge of one exactly in a side of the other.

    Or the two edges on each other; in a third of the pairs two more faces are in one plane.
    """
    size_a, size_b = np.exp(rng.uniform(-1, 1, (2, n, 3)))
    turn = small_rotations(np.eye(3)[None, 2], rng.uniform(-np.pi, np.pi, n))
    on_a, on_b = (rng.choice([-0.5, 0.5], (n, 3)) * size for size in (size_a, size_b))
    on_b[:, 0] *= np.where(rng.random(n) < 0.5, rng.uniform(-1, 1, n), 1.0)
    offset = on_a - rotate(turn, on_b)
    flush = rng.random(n) < 1 / 3
    offset[:, 2] = np.where(flush, rng.choice([-0.5, 0.5], n) * (size_a - size_b)[:, 2],
                            rng.uniform(-0.45, 0.45, n) * (size_a + size_b)[:, 2])
    return (np.tile(IDENTITY, (n, 1)), np.concatenate([offset, turn], axis=1), size_a, size_b)


def corners_that_touch(rng, n):
    """Boxes in any orientation, a corner of one exactly on a corner of the other, disjoint else.

    A plane across a random direction separates them. Returns the pairs and the corners (n, 3).
    """
    size_a, size_b = np.exp(rng.uniform(-1, 1, (2, n, 3)))
    turn_a, turn_b = unit_quaternions(rng, n), unit_quaternions(rng, n)
    across = rng.normal(size=(n, 3))
    minus = (-1, -1, -1, 1)
    corner_a = 0.5 * size_a * np.sign(rotate(turn_a * minus, across))
    corner_b = -0.5 * size_b * np.sign(rotate(turn_b * minus, across))
    a = np.hstack([np.zeros((n, 3)), turn_a])
    corners = rotate(turn_a, corner_a)
    b = np.hstack([corners - rotate(turn_b, corner_b), turn_b])
    return (a, b, size_a, size_b), corners


def columns_that_touch(rng, n):
    """Boxes upright on two levels, the top of one on the level of the other's bottom.

    Seen from above, a corner of one is on a corner or on a side of the other, so two axes or more
    have a gap of zero at once. Returns the pairs and the points where they touch (n, 3).
    """
    size_a, size_b = np.exp(rng.uniform(-1, 1, (2, n, 3)))
    yaw = 0.5 * np.pi * rng.integers(0, 4, n) + rng.uniform(0.1, 0.5 * np.pi - 0.1, n)
    turn = small_rotations(np.tile([0.0, 0, 1], (n, 1)), yaw)
    across = rng.normal(size=(n, 3)) * (1, 1, 0)
    on_side = rng.random(n) < 0.5
    across[on_side] = rotate(turn, np.tile([1.0, 0, 0], (n, 1)))[on_side]
    at_a = 0.5 * size_a * np.sign(across) + 0.5 * size_a * (0, 0, 1)
    at_b = -0.5 * size_b * np.sign(rotate(turn * (-1, -1, -1, 1), across) + (0, 0, 1e-9))
    at_b[on_side, 1] *= rng.uniform(-1, 1, int(on_side.sum()))
    b = np.hstack([at_a - rotate(turn, at_b), turn])
    whole = unit_quaternions(rng, n)
    whole[rng.random(n) < 1 / 3] = IDENTITY[3:]
    zero = np.zeros((n, 3))
    return (moved(np.tile(IDENTITY, (n, 1)), zero, whole), moved(b, zero, whole), size_a,
            size_b), rotate(whole, at_a)


def hard_pairs():
    """Return all stored hard poses; none where benchmarks/ is not there."""
    if not HARD_POSES.is_file():
        return Pairs(*(np.empty((0, width)) for width in (7, 7, 3, 3)))
    with np.load(HARD_POSES) as stored:
        return joined(*([stored[f'{name}.{part}'] for part in Pairs._fields]
                        for name in sorted({key.partition('.')[0] for key in stored})))


def of_all_kinds(n, seed):
    """Draw n pairs of each family above, but for those that touch exactly."""
    return joined(*(family(np.random.default_rng([seed, number]), n)
                    for number, family in enumerate((
                        random_pairs, near_parallel_pairs, flush_pairs, equal_thickness, ridges,
                        cards, sharing_an_axis))))


BAD_NUMBERS = np.array([np.nan, -np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-320, 5e-324, 1e50, -1e50,
                        1.1e50, 1e-50, 1e-51, 1e154, 1e-154, 1.7e308, -1.0, 2.2e-308])
"""What a simulator may send when it goes wrong."""


def extreme_pairs(rng, n):
    """Boxes of 1e-50 to 1e50 m that touch, overlap or miss; some rows are refused.

    Places are as far as 1e50 m, quaternions have lengths of 1e-99 to 1e99, some numbers went
    through float32, and one row in eight has a number of BAD_NUMBERS.
    """
    def log_uniform(low, high, shape=n):
        return np.exp(rng.uniform(np.log(low), np.log(high), shape))

    def drawn_turns():
        thirds = rng.integers(-1, 2, (n, 4)).astype(float)
        thirds[~thirds.any(axis=1)] = IDENTITY[3:]
        turn = np.where((rng.random(n) < 1 / 3)[:, None], thirds, rng.uniform(-1, 1, (n, 4)))
        return np.where((rng.random(n) < 0.4)[:, None], IDENTITY[3:], turn)

    ranges = np.array([(0.1, 10)] * 6 + [(1e-50, 1e50), (1e-3, 1e3), (1e-50, 1e-48), (1e48, 1e50)])
    low, high = ranges[rng.integers(0, 10, n)].T[..., None]
    size_a, size_b = (log_uniform(low, high, (n, 3)) for _ in range(2))
    size_b = np.where((rng.random(n) < 1 / 3)[:, None], size_a, size_b)
    cubes = rng.random(n) < 1 / 8
    size_a[cubes] = size_b[cubes] = CUBE

    far = np.where(rng.random(n) < 1 / 4, log_uniform(1e-50, 1e50), log_uniform(0.1, 1e7))
    place = rng.uniform(-1, 1, (n, 3)) * (far * (rng.random(n) < 1 / 2))[:, None]
    turn_a, turn_b = drawn_turns(), drawn_turns()
    tilt = log_uniform(1e-17, 1.0) * (rng.random(n) < 1 / 3)
    turn_b[:, :3] += rng.uniform(-1, 1, (n, 3)) * tilt[:, None]

    # Along each of A's axes: the same middle, touching, flush, overlapping, some ulps, or anything.
    both, least = 0.5 * (size_a + size_b), np.minimum(size_a, size_b)
    offset = np.choose(rng.integers(0, 6, (n, 3)), [
        np.zeros((n, 3)), both, 0.5 * (size_a - size_b),
        both - least * log_uniform(1e-16, 1, (n, 3)),
        both * (1.0 + rng.integers(0, 9, (n, 3)) * 2.0**-52), both * rng.random((n, 3))])
    offset *= rng.choice([-1.0, 1.0], (n, 3))
    unit_a = turn_a / np.linalg.norm(turn_a, axis=1, keepdims=True)
    a = np.hstack([place, turn_a])
    b = np.hstack([place + rotate(unit_a, offset), multiply(turn_a, turn_b)])
    rounded = (rng.random(n) < 1 / 4) & (np.abs(place).max(axis=1) < 1e30)
    rounded &= both.max(axis=1) < 1e30
    for pose in (a, b):
        pose[rounded] = pose[rounded].astype(np.float32)
        scaled = rng.random(n) < 1 / 16
        pose[scaled, 3:] *= log_uniform(1e-99, 1e99)[scaled, None]
    rows = np.flatnonzero(rng.random(n) < 1 / 8)
    for row in rows:
        values = (a, b, size_a, size_b)[rng.integers(4)][row]
        values[rng.integers(len(values))] = rng.choice(BAD_NUMBERS)
    return Pairs(a, b, size_a, size_b)


def on_the_way(start, end, centre, s):
    """Return poses (n, 7) at times s (n,), by the definition of the motion."""
    turn_a, turn_b = (pose[:, 3:] / np.linalg.norm(pose[:, 3:], axis=1)[:, None]
                      for pose in (start, end))
    relative = multiply(turn_b, turn_a * [-1, -1, -1, 1])
    relative *= np.where(relative[:, 3:] < 0.0, -1.0, 1.0)
    length = np.linalg.norm(relative[:, :3], axis=1)
    half = s * np.arctan2(length, relative[:, 3])
    axis = relative[:, :3] / np.maximum(length, 1e-300)[:, None]
    turn = multiply(np.column_stack([np.sin(half)[:, None] * axis, np.cos(half)]), turn_a)
    low, high = start[:, :3] + rotate(turn_a, centre), end[:, :3] + rotate(turn_b, centre)
    place = low + s[:, None] * (high - low)
    return np.hstack([place - rotate(turn, centre), turn])
