# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scenes of boxes that stand, slide and fall: towers, piles, pallets, a gripper, a yard.

Lengths in m, masses in kg, times in s.
"""
from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from box_contact_ros.forces.patch_forces import GRAVITY
from box_contact_ros.solver.pose import rotation_matrix

from .loops import FLOOR, Boxes, Parts, Scene
from .pose_sets import CONTAINER, turned
from .scenes import packing_plans

PUSHED = 2.0  # how long every box of a real pallet is pushed [s]


def tower(count: int, jitter: float = 0.0) -> Scene:
    """Return cubes on each other, shifted by a share of the edge and turned about the vertical."""
    rng = np.random.default_rng(3)
    edge, rows = 0.5, [FLOOR]
    for k in range(count):
        x, y = jitter * edge * rng.uniform(-1, 1, 2)
        gap = 1e-4 * (k + 1) if jitter else 0.0
        rows.append(((edge,) * 3, 50.0, (x, y, edge * (k + 0.5) + gap),
                     turned((0, 0, 1), math.radians(100 * jitter * rng.uniform(-1, 1)))))
    return Scene(f'tower of {count}' + (', jittered' if jitter else ''), Boxes.of(rows), 8.0)


def wall() -> Scene:
    """Return a wall of bricks in running bond."""
    size, rows = (0.4, 0.2, 0.2), [FLOOR]
    for layer in range(10):
        for k in range(10):
            rows.append((size, 16.0, (size[0] * (k + 0.5 * (layer % 2)), 0.0,
                                      size[2] * (layer + 0.5))))
    return Scene('wall 10 × 10', Boxes.of(rows), 4.0)


def pyramid() -> Scene:
    """Return cubes in rows, each on two of the row below."""
    base, edge, rows = 10, 0.5, [FLOOR]
    for layer in range(base):
        for k in range(base - layer):
            rows.append(((edge,) * 3, 50.0, ((k - 0.5 * (base - layer)) * 1.1 * edge, 0.0,
                                            edge * (layer + 0.5))))
    return Scene('pyramid of 55', Boxes.of(rows), 5.0)


def pile() -> Scene:
    """Return boxes of random sizes and turns, dropped in layers."""
    rng, rows = np.random.default_rng(5), [FLOOR]
    for k in range(200):
        layer, place = divmod(k, 20)
        size = rng.uniform(0.15, 0.4, 3)
        q = rng.normal(size=4)
        rows.append((size, 500 * float(np.prod(size)),
                     (0.5 * (place % 5) - 1, 0.5 * (place // 5) - 1, 0.6 * layer + 0.5),
                     q / np.linalg.norm(q)))
    return Scene('pile of 200', Boxes.of(rows), 8.0)


def bars() -> Scene:
    """Return pairs of bars, each layer across the one below."""
    rng, rows = np.random.default_rng(6), [FLOOR]
    for layer in range(15):
        for side in (-1, 1):
            place = 0.35 * side
            at = (0.0, place) if layer % 2 else (place, 0.0)
            size = (1.0, 0.1, 0.1) if layer % 2 else (0.1, 1.0, 0.1)
            rows.append((size, 6.0, (*(at + 0.01 * rng.uniform(-1, 1, 2)), 0.1 * (layer + 0.5)),
                         turned((0, 0, 1), math.radians(rng.uniform(-1, 1)))))
    return Scene('30 crossed bars', Boxes.of(rows), 5.0)


def mixed() -> Scene:
    """Return boxes of random sizes on each other."""
    rng, rows, height = np.random.default_rng(7), [FLOOR], 0.0
    for _ in range(8):
        size = rng.uniform(0.2, 1.0, 3)
        rows.append((size, 400 * float(np.prod(size)),
                     (*(0.02 * rng.uniform(-1, 1, 2)), height + 0.5 * size[2]),
                     turned((0, 0, 1), math.radians(rng.uniform(-20, 20)))))
        height += size[2]
    return Scene('mixed sizes, 8', Boxes.of(rows), 5.0)


def pallet() -> Scene:
    """Return cartons on a pallet, each layer turned."""
    rows = [FLOOR, ((1.2, 0.8, 0.144), 25.0, (0.6, 0.4, 0.072))]
    for layer in range(10):
        long = layer % 2 == 0
        size = (0.4, 0.4, 0.2) if long else (0.6, 0.4, 0.2)
        for i in range(3 if long else 2):
            for j in range(2):
                rows.append((size, 8.0, (size[0] * (i + 0.5), size[1] * (j + 0.5),
                                         0.144 + 0.2 * (layer + 0.5))))
    return Scene('pallet of ten layers', Boxes.of(rows), 5.0)


def containers(gusts: bool) -> Scene:
    """Return five empty containers in a wind from the side, steady or in gusts of 0.8 Hz."""
    rows = [FLOOR]
    for k in range(5):
        rows.append((CONTAINER, 3800.0, (0.0, 0.0, CONTAINER[2] * (k + 0.5))))

    def wind(t: float, boxes: Boxes, *_: np.ndarray) -> np.ndarray:
        push = np.zeros((6, 6))
        # 0.08 of the weight: 0.85 of what tips the stack, whose width is 0.19 of its height.
        push[1:, 1] = 3800 * GRAVITY * 0.08 * (math.sin(2 * math.pi * 0.8 * t) if gusts else
                                           min(1.0, t))
        return push

    return Scene('five containers in ' + ('gusts' if gusts else 'wind'), Boxes.of(rows), 6.0,
                 act=wind)


def off_centre(share: float) -> Scene:
    """Return a cube whose centre of mass is off the middle by a share of the edge."""
    return Scene(f'centre of mass at {share:g}', Boxes.of([
        FLOOR, ((1.0, 1.0, 1.0), 100.0, (0, 0, 0.5), (0, 0, 0, 1), (share, 0, 0))]), 4.0)


def ratio(heavy: float) -> Scene:
    """Return a heavy cube on a light one."""
    return Scene(f'heavy on light 1:{heavy:g}', Boxes.of([
        FLOOR, ((1.0,) * 3, 10.0, (0, 0, 0.5)), ((1.0,) * 3, 10.0 * heavy, (0, 0, 1.5))]), 4.0)


def cube_on_four() -> Scene:
    """Return a cube of 20 m on four of 1 m, all of one density."""
    feet = [((1.0,) * 3, 500.0, (x, y, 0.5)) for x, y in product((-9.0, 9.0), repeat=2)]
    return Scene('cube on four, 1:8000', Boxes.of([
        FLOOR, *feet, ((20.0,) * 3, 8000 * 500.0, (0, 0, 11.0))]), 4.0)


def twist_locks() -> Scene:
    """Return two loaded containers, each on four twist-locks that nothing fastens."""
    lock, rows, height = (0.16, 0.12, 0.05), [FLOOR], 0.0
    for _ in range(2):
        rows += [(lock, 5.0, (x, y, height + 0.5 * lock[2]))
                 for x, y in product((-5.9, 5.9), (-1.1, 1.1))]
        rows.append((CONTAINER, 25_000.0, (0, 0, height + lock[2] + 0.5 * CONTAINER[2])))
        height += lock[2] + CONTAINER[2]
    return Scene('containers on loose twist-locks', Boxes.of(rows), 5.0)


def heap(count: int = 30) -> Scene:
    """Return bars of any direction, dropped on a heap."""
    rng, rows = np.random.default_rng(8), [FLOOR]
    for k in range(count):
        q = rng.normal(size=4)
        rows.append(((1.0, 0.1, 0.1), 6.0, (*rng.uniform(-0.3, 0.3, 2), 0.6 + 0.3 * k),
                     q / np.linalg.norm(q)))
    return Scene('heap of 30 bars', Boxes.of(rows), 12.0)


def packed_pallets() -> Scene:
    """Return pallets side by side, each with 40 cartons that touch their neighbours."""
    base, carton, rows = (1.2, 0.8, 0.144), (0.3, 0.4, 0.25), [FLOOR]
    for k in range(3):
        corner = np.array([0.0, 0.8 * k, 0.0])
        rows.append((base, 25.0, corner + 0.5 * np.array(base)))
        for x, y, z in product(range(4), range(2), range(5)):
            rows.append((carton, 9.0, corner + (0.0, 0.0, base[2]) + carton * np.array(
                [x + 0.5, y + 0.5, z + 0.5])))
    return Scene('three packed pallets', Boxes.of(rows), 4.0)


def spreader() -> Scene:
    """Return a spreader with four twist-locks that stands on a loaded container."""
    base, lock = (12.192, 2.3, 0.6), (0.16, 0.12, 0.15)
    low = 0.5 * (base[2] + lock[2])
    boxes = Boxes.of([FLOOR, (CONTAINER, 25_000.0, (0, 0, 0.5 * CONTAINER[2])),
                      (base, 12_000.0, (0, 0, CONTAINER[2] + lock[2] + 0.5 * base[2]))])
    at = [(x, y, -low, 0, 0, 0, 1) for x, y in product((-5.9, 5.9), (-1.0, 1.0))]
    boxes.parts = Parts(np.full(4, 2), np.tile(lock, (4, 1)), np.array(at, dtype=float))
    return Scene('spreader on a container', boxes, 4.0)


def turntable() -> Scene:
    """Return a tower of three cubes on a plate that turns once in ten seconds."""
    rows = [((6.0, 6.0, 0.2), 0.0, (0.0, 0.0, -0.1))]
    rows += [((0.5,) * 3, 50.0, (2.0, 0.0, 0.5 * k + 0.25)) for k in range(3)]
    boxes = Boxes.of(rows)
    boxes.velocity[:, 5] = 2.0 * math.pi / 10.0
    boxes.velocity[1:, 1] = 2.0 * boxes.velocity[1:, 5]
    return Scene('turntable', boxes, 10.0)


def slope(kind: str) -> Scene:
    """Return boxes on a slope below the angle of friction and of tipping."""
    degrees = {'plate': 25.0, 'tall': 15.0, 'five': 8.0}[kind]
    q = turned((0, 1, 0), math.radians(degrees))
    up = rotation_matrix(q)[:, 2]
    sizes = {'plate': [(1.0, 1.0, 0.1)], 'tall': [(0.5, 0.5, 1.5)], 'five': [(0.5,) * 3] * 5}[kind]
    rows, height = [((20.0, 20.0, 1.0), 0.0, -0.5 * up, q)], 0.0
    for size in sizes:
        rows.append((size, 50.0, (height + 0.5 * size[2]) * up, q))
        height += size[2]
    return Scene(f'slope: {kind} on {degrees:g}°', Boxes.of(rows), 5.0)


def gripper(force: float) -> Scene:
    """Two fingers of 0.5 kg, guided by springs, press a cube of 0.1 kg and carry its weight."""
    finger = (0.02, 0.04, 0.05)
    rows = [(finger, 0.5, (-0.035, 0, 0.1)), (finger, 0.5, (0.035, 0, 0.1)),
            ((0.05,) * 3, 0.1, (0, 0, 0.1))]
    home = np.array([row[2] for row in rows[:2]])

    def act(t: float, boxes: Boxes, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        push = np.zeros((3, 6))
        push[:2, 2] = 0.5 * GRAVITY + 0.05 * GRAVITY
        push[:2, 1:3] += 5e3 * (home - pose[:2, :3])[:, 1:] - 30.0 * velocity[:2, 1:3]
        push[:2, 3:] -= 8.0 * pose[:2, 3:6] + 0.01 * velocity[:2, 3:]
        push[0, 0], push[1, 0] = force, -force
        return push

    return Scene(f'gripper, {force:g} N', Boxes.of(rows), 3.0, act=act)


def supported(boxes: Boxes, margin: float = 0.1) -> list[int]:
    """Return the boxes of a packing plan that stand on boxes that stand; box 0 is the floor.

    A box stands if its middle is inside the hull of its supports, by a margin relative to its
    shorter edge.
    """
    low, high = boxes.pose[:, :3] - 0.5 * boxes.size, boxes.pose[:, :3] + 0.5 * boxes.size
    standing = [0]
    for k in np.argsort(low[:, 2], kind='stable'):
        if k == 0:
            continue
        corners = []
        for j in standing:
            start, end = np.maximum(low[j, :2], low[k, :2]), np.minimum(high[j, :2], high[k, :2])
            if abs(high[j, 2] - low[k, 2]) < 1e-6 and (end > start).all():
                corners += list(product(*zip(start, end)))
        angles = np.radians(np.arange(0.0, 360.0, 1.0))
        ways = np.stack([np.cos(angles), np.sin(angles)])
        if corners and ((np.array(corners) - boxes.pose[k, :2]) @ ways).max(axis=0).min() > (
                margin * boxes.size[k, :2].min()):
            standing.append(int(k))
    return standing


def real_pallet(order: str) -> Scene:
    """Return the boxes of a real order that stand, as its packing plan places them."""
    corner, size, mass = np.split(packing_plans()[order], [3, 6], axis=1)
    rows = [FLOOR, *zip(1e-3 * size, mass[:, 0], 1e-3 * (corner + 0.5 * size))]
    boxes = Boxes.of(rows)
    kept = supported(boxes)
    return Scene(f'order {order}, {len(kept) - 1} of {len(rows) - 1} boxes',
                 Boxes.of([rows[k] for k in kept]), 5.0)


def sideways(order: str, share: float) -> Scene:
    """Return a real pallet whose boxes are all pushed along x by a share of their weight."""
    scene = real_pallet(order)
    push = np.zeros((len(scene.boxes.mass), 6))
    push[:, 0] = share * GRAVITY * scene.boxes.mass
    return replace(scene, seconds=PUSHED, act=lambda *_: push)


ORDERS = ('00100408', '00100001', '00100002', '00100003', '00100004')
SCENES: tuple[Callable[[], Scene], ...] = (
    partial(tower, 20), partial(tower, 20, jitter=0.03), wall, pyramid, pile, bars, mixed, pallet,
    partial(containers, False), partial(containers, True), partial(off_centre, 0.4),
    partial(off_centre, 0.45), partial(ratio, 10.0), partial(ratio, 100.0),
    cube_on_four, twist_locks, heap, packed_pallets, spreader, turntable,
    partial(slope, 'plate'), partial(slope, 'tall'), partial(slope, 'five'),
    *(partial(gripper, force) for force in (2.0, 5.0, 20.0, 50.0)),
    *(partial(real_pallet, order) for order in ORDERS))
