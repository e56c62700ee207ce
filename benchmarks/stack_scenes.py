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
    """Return a wall of bricks in running bond, nine on ten, so that none overhangs."""
    size, rows = (0.4, 0.2, 0.2), [FLOOR]
    for layer in range(10):
        for k in range(10 - layer % 2):
            rows.append((size, 16.0, (size[0] * (k + 0.5 * (layer % 2)), 0.0,
                                      size[2] * (layer + 0.5))))
    return Scene('wall of 95', Boxes.of(rows), 4.0)


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


def landed_pallet(order: str) -> Scene:
    """Return a real pallet of boxes of 0.2 to 100 kg that is set down with a tilt of 0.4°."""
    scene = real_pallet(order)
    boxes, tilt = scene.boxes, turned((1, 2, 0), math.radians(0.4))
    turn = rotation_matrix(tilt)
    boxes.pose[1:, :3] = boxes.pose[1:, :3] @ turn.T
    boxes.pose[1:, 3:] = tilt
    reach = 0.5 * boxes.size[1:] @ np.abs(turn[2])
    boxes.pose[1:, 2] -= (boxes.pose[1:, 2] - reach).min()
    boxes.mass[1:] = 0.2 * 500.0 ** np.random.default_rng(1).random(len(boxes.mass) - 1)
    return replace(scene, name=f'order {order}, landed, 0.2 to 100 kg', seconds=6.0)


def sideways(order: str, share: float) -> Scene:
    """Return a real pallet whose boxes are all pushed along x by a share of their weight."""
    scene = real_pallet(order)
    push = np.zeros((len(scene.boxes.mass), 6))
    push[:, 0] = share * GRAVITY * scene.boxes.mass
    return replace(scene, seconds=PUSHED, act=lambda *_: push)


# --- carriers, and what acts for a time -----------------------------------------------------------

def rolling_deck(degrees: float = 20.0) -> Scene:
    """Return a container on a deck that rolls by an angle to either side, ten seconds a period.

    Without friction it would slide: the tangent of 20° is 0.36, and μ is 0.5.
    """
    rate, most = 2.0 * math.pi * 0.1, math.radians(degrees)

    def drive(t: float) -> tuple[float, ...]:
        return 0.0, 0.0, 0.0, most * rate * math.cos(rate * t), 0.0, 0.0

    boxes = Boxes.of([((30.0, 20.0, 1.0), 0.0, (0, 0, -0.5)),
                      (CONTAINER, 20_000.0, (0, 0, 0.5 * CONTAINER[2]))])
    boxes.velocity[:, 3] = most * rate
    boxes.velocity[1, 1] = -most * rate * (0.5 + 0.5 * CONTAINER[2])
    return Scene(f'deck that rolls by {degrees:g}°', boxes, 20.0, drive=drive)


def braking_lorry(braking: float = 0.4) -> Scene:
    """Return a crate, and two on each other, on a lorry that brakes [g] from 15 m/s to rest."""
    crate = (1.0, 1.0, 0.5)

    def drive(t: float) -> tuple[float, ...]:
        return max(0.0, 15.0 - braking * GRAVITY * t), 0.0, 0.0, 0.0, 0.0, 0.0

    boxes = Boxes.of([((12.0, 2.5, 1.0), 0.0, (0, 0, -0.5)), (crate, 200.0, (-3, 0, 0.25)),
                      *((crate, 200.0, (3, 0, 0.5 * k + 0.25)) for k in range(2))])
    boxes.velocity[:, 0] = 15.0
    return Scene(f'lorry that brakes by {braking:g} g', boxes, 6.0, drive=drive)


def reach_stacker() -> Scene:
    """Return five containers on each other, of which the upmost is lifted by 2 m after a second."""
    mass, start = 20_000.0, 4.5 * CONTAINER[2]
    boxes = Boxes.of([FLOOR, *((CONTAINER, mass, (0, 0, CONTAINER[2] * (k + 0.5)))
                               for k in range(5))])

    def lift(t: float, _: Boxes, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        push = np.zeros((6, 6))
        if t > 1.0:
            high = start + min(2.0, t - 1.0)
            push[5, 2] = mass * (GRAVITY + 25.0 * (high - pose[5, 2]) - 10.0 * velocity[5, 2])
        return push

    return Scene('the fifth of five is lifted', boxes, 6.0, act=lift)


def dammed_belt() -> Scene:
    """Return ten parcels on a belt, at a dam that takes μ·m·g of each, 392.4 N in all."""
    parcel = (0.4, 0.3, 0.3)
    rows = [FLOOR, ((0.1, 1.0, 0.5), 0.0, (0.05, 0, 0.25))]
    rows += [(parcel, 8.0, (-parcel[0] * (k + 0.5), 0, 0.15)) for k in range(10)]
    return Scene('ten parcels, dammed on a belt', Boxes.of(rows), 4.0, belt=(0.35, 0.0, 0.0))


def dominoes(count: int = 50) -> Scene:
    """Return dominoes, of which the first is pushed."""
    size = (0.1, 0.5, 1.0)
    rows = [FLOOR, *((size, 10.0, (0.3 * k - 7.5, 0, 0.5)) for k in range(count))]

    def push(t: float, *_: object) -> np.ndarray:
        found = np.zeros((count + 1, 6))
        found[1, 4] = 30.0 if t < 0.2 else 0.0  # six times what tips it
        return found

    return Scene(f'{count} dominoes', Boxes.of(rows), 8.0, act=push)


# --- what hardly stands ---------------------------------------------------------------------------

def card_house(storeys: int = 5) -> Scene:
    """Return pairs of cards that lean on each other by 20°, on cards that lie on the pairs below.

    Edges alone touch, as in a house of real cards.
    """
    long, wide, thick, lean = 0.2, 0.2, 0.004, math.radians(20.0)
    half = 0.5 * (long * math.sin(lean) + thick * math.cos(lean))  # of a leaning card's width
    high = long * math.cos(lean) + thick * math.sin(lean)
    rows, level = [FLOOR], 0.0
    for pairs in range(storeys, 0, -1):
        first = -2.0 * half * (pairs - 1)
        for k in range(pairs):
            for side in (-1, 1):
                rows.append(((thick, wide, long), 0.1, (first + 4.0 * half * k + side * half, 0,
                                                        level + 0.5 * high),
                             turned((0, 1, 0), -side * lean)))
        level += high
        for k in range(pairs - 1):
            rows.append(((4.0 * half, wide, thick), 0.1, (first + 2.0 * half * (2 * k + 1), 0,
                                                          level + 0.5 * thick)))
        level += thick
    return Scene(f'card house of {storeys}', Boxes.of(rows), 5.0)


def seesaw(heavier: float = 0.005) -> Scene:
    """Return a plank on a bar of 6 mm, with cubes at its ends, one heavier by a share.

    The plank of 10 kg and the cubes of 50 kg, 1 m from the middle, tip where the middle of all is
    beyond 3 mm: from a share of 0.66 % on.
    """
    cube, plank, bar = (0.2,) * 3, (2.4, 0.3, 0.05), (0.006, 0.3, 0.1)
    top = bar[2] + plank[2] + 0.5 * cube[2]
    return Scene(f'seesaw, {100 * heavier:g} % heavier', Boxes.of([
        FLOOR, (bar, 0.0, (0, 0, 0.5 * bar[2])), (plank, 10.0, (0, 0, bar[2] + 0.5 * plank[2])),
        (cube, 50.0, (-1, 0, top)), (cube, 50.0 * (1.0 + heavier), (1, 0, top))]), 4.0)


def timbers(tiers: int = 1, across: int = 4, drop: float = 0.0) -> Scene:
    """Return containers of 24 t, each on timbers of 8 kg; the first is dropped by a height [m]."""
    timber, rows, height = (0.1, 2.4, 0.1), [FLOOR], 0.0
    places = np.linspace(-2.2, 2.2, across) if across > 2 else (-2.0, 2.0)
    for _ in range(tiers):
        rows += [(timber, 8.0, (x, 0, height + 0.05)) for x in places]
        rows.append((CONTAINER, 24_000.0, (0, 0, height + drop + 0.1 + 0.5 * CONTAINER[2])))
        height += 0.1 + CONTAINER[2]
    return Scene((f'{tiers} tiers on timbers' if tiers > 1 else '24 t on four timbers')
                 + (f', dropped by {drop:g} m' if drop else ''), Boxes.of(rows), 5.0)


def full_on_empty(speed: float = 0.0) -> Scene:
    """Return a container of 30 t on an empty one of 2.3 t, which it meets at a speed [m/s]."""
    boxes = Boxes.of([FLOOR, (CONTAINER, 2_300.0, (0, 0, 0.5 * CONTAINER[2])),
                      (CONTAINER, 30_000.0, (0, 0, 1.5 * CONTAINER[2] + (1e-6 if speed else 0)))])
    boxes.velocity[2, 2] = -speed
    return Scene('30 t on an empty container' + (f', at {speed:g} m/s' if speed else ''), boxes,
                 4.0)


def flush_pallet() -> Scene:
    """Return 48 cartons of 0.2 to 100 kg, four layers whose sides touch."""
    rng, carton = np.random.default_rng(1), (0.4, 0.3, 0.3)
    return Scene('flush pallet, 0.2 to 100 kg', Boxes.of([FLOOR, *(
        (carton, 0.2 * 500.0 ** rng.random(), (0.4 * i, 0.3 * j, 0.3 * k + 0.15))
        for k, i, j in product(range(4), range(3), range(4)))]), 5.0)


def gaps(count: int = 20, gap: float = 1e-9) -> Scene:
    """Return a tower of cubes with a gap below each [m]."""
    return Scene(f'tower of {count}, gaps of {gap:g} m', Boxes.of([FLOOR, *(
        ((0.5,) * 3, 50.0, (0, 0, 0.5 * (k + 0.5) + gap * (k + 1))) for k in range(count))]), 3.0)


def wide_floor(slope: float = 0.0) -> Scene:
    """Return a cube of 1 m on a floor of 1 km, which has a slope (its tangent)."""
    q = turned((0, 1, 0), math.atan(slope))
    up = rotation_matrix(q)[:, 2]
    return Scene('cube on a floor of 1 km' + (f', slope {slope:.2g}' if slope else ''), Boxes.of([
        ((1000.0, 1000.0, 1.0), 0.0, -0.5 * up, q), ((1.0,) * 3, 50.0, 0.5 * up, q)]), 3.0)


FEET = ((-0.3, -0.2), (0.5, -0.2), (0.1, 0.4))  # of the table [m]
SPREADER_FEET = tuple(product((-6.0, -0.2, 0.2, 6.0), (-1.0, 1.0)))  # of the twin spreader [m]


def on_feet(name: str, feet: tuple[tuple[float, float], ...], size: tuple[float, float, float],
            foot: tuple[float, float, float], mass: float, centre: tuple[float, float]) -> Scene:
    """Return a plate of a size on feet; `centre` is the place of its mass [m]."""
    boxes = Boxes.of([FLOOR, (size, mass, (0, 0, foot[2] + 0.5 * size[2]), (0, 0, 0, 1),
                              (*centre, 0.0))])
    low = -0.5 * (size[2] + foot[2])
    boxes.parts = Parts(np.ones(len(feet), dtype=int), np.tile(foot, (len(feet), 1)),
                        np.array([(x, y, low, 0, 0, 0, 1) for x, y in feet], dtype=float))
    return Scene(name, boxes, 3.0)


def table() -> Scene:
    """Return a table of 56 kg on three feet of 6 cm, its mass aside."""
    return on_feet('table on three feet', FEET, (1.2, 1.0, 0.05), (0.06, 0.06, 0.5), 56.0,
                   (0.12, 0.08))


def twin_spreader() -> Scene:
    """Return a twin spreader of 10 t on its eight twist-locks, its mass 0.9 m aside."""
    return on_feet('twin spreader', SPREADER_FEET, (12.4, 2.3, 0.6), (0.16, 0.12, 0.15), 10_000.0,
                   (0.9, 0.0))


# --- all ------------------------------------------------------------------------------------------

ORDERS = ('00100408', '00100001', '00100002', '00100003', '00100004')
SCENES: tuple[Callable[[], Scene], ...] = (
    partial(tower, 20), partial(tower, 20, jitter=0.03), wall, pyramid, pile, bars, mixed, pallet,
    partial(containers, False), partial(containers, True), partial(off_centre, 0.4),
    partial(off_centre, 0.45), partial(ratio, 10.0), partial(ratio, 100.0),
    cube_on_four, twist_locks, heap, packed_pallets, spreader, turntable,
    partial(slope, 'plate'), partial(slope, 'tall'), partial(slope, 'five'),
    *(partial(gripper, force) for force in (2.0, 5.0, 20.0, 50.0)),
    *(partial(make, order) for make in (real_pallet, landed_pallet) for order in ORDERS),
    rolling_deck, braking_lorry, reach_stacker, dammed_belt, dominoes, card_house,
    partial(tower, 200), seesaw, timbers, partial(timbers, 5, 2), full_on_empty, flush_pallet,
    gaps, wide_floor, partial(wide_floor, 1.0 / 3.0), table, twin_spreader)
