# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kinds of motions of two boxes: everyday ones, and ones that are hard for a time of impact.

A box is drawn as a body: its origin goes on a line, its axes turn at constant rate, and its own
centre is off the origin by a lever. Grazing motions come as near as is asked: B is moved aside
until the least distance is that.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.motion import Approaches, Sweep
from box_contact_ros.solver.pose import rotation_matrix

from .pose_sets import CONTAINER, log_uniform, quaternion_multiply, turns, unit_quaternions

TOLERANCE = 1e-6  # of reports [m]
UTM = np.array([5e5, 4e6, 10.0])  # where coordinates of maps are large [m]
GRAZE_ROUNDS, GRAZED = 12, 1e-3  # moves aside, and how near to the wanted distance is enough


class Motions(NamedTuple):
    """n motions: poses (n, 7), full extents (n, 3), centres of turning (n, 3), clearances (n,)."""

    start_a: np.ndarray
    end_a: np.ndarray
    start_b: np.ndarray
    end_b: np.ndarray
    size_a: np.ndarray
    size_b: np.ndarray
    centre_a: np.ndarray
    centre_b: np.ndarray
    clearance: np.ndarray

    def rows(self, chosen: np.ndarray | slice) -> Motions:
        """Return some of the motions, in contiguous arrays."""
        return Motions(*(np.ascontiguousarray(part[chosen]) for part in self))

    def sweeps(self) -> tuple[Sweep, Sweep]:
        """Return the ways of A and B."""
        return (Sweep(self.start_a, self.end_a, self.centre_a),
                Sweep(self.start_b, self.end_b, self.centre_b))

    def least(self, tolerance: float = TOLERANCE) -> Approaches:
        """Return the least distances of all."""
        return ContactSolver().least_distance_batch(
            *self.sweeps(), size_a=self.size_a, size_b=self.size_b, tolerance=tolerance)

    def first(self, clearance: float, tolerance: float = TOLERANCE) -> Approaches:
        """Return the times of impact of all, with one clearance."""
        return ContactSolver().time_of_impact_batch(
            *self.sweeps(), size_a=self.size_a, size_b=self.size_b, clearance=clearance,
            tolerance=tolerance)


class Body(NamedTuple):
    """n boxes on their ways: vectors (n, 3), quaternions (n, 4)."""

    half: np.ndarray
    place: np.ndarray
    way: np.ndarray
    start: np.ndarray
    turn: np.ndarray  # axis times angle [rad]
    lever: np.ndarray  # from the origin to the box's centre, in the box's axes [m]


def body(half: np.ndarray, place: np.ndarray, way: np.ndarray, start: np.ndarray | None = None,
         turn: np.ndarray | None = None, lever: np.ndarray | None = None) -> Body:
    """Return bodies; what is left out is zero."""
    n = len(place)
    none = np.zeros((n, 3))
    half = np.broadcast_to(half, (n, 3)).copy()
    return Body(half, place, np.broadcast_to(way, (n, 3)).copy(),
                np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)) if start is None else start,
                none if turn is None else turn, none if lever is None else lever)


def motions(a: Body, b: Body, clearance: np.ndarray | float = 0.0) -> Motions:
    """Return the motions of two bodies. Turns of more than half a circle are cut to 3.1 rad."""
    poses: list[np.ndarray] = []
    for one in (a, b):
        angle = np.linalg.norm(one.turn, axis=1)
        turn = one.turn * np.where(angle < np.pi - 2e-9, 1.0, 3.1 / np.maximum(angle, 1.0))[:, None]
        by = turns(np.where(angle[:, None] > 0.0, turn, [0.0, 0.0, 1.0]),
                   np.linalg.norm(turn, axis=1))
        for place, quaternion in ((one.place, one.start),
                                  (one.place + one.way, quaternion_multiply(by, one.start))):
            arm = np.einsum('nij,nj->ni', rotation_matrix(quaternion), one.lever)
            poses.append(np.hstack([place + arm, quaternion]))
    return Motions(*poses, 2.0 * a.half, 2.0 * b.half, -a.lever, -b.lever,
                   np.broadcast_to(np.asarray(clearance, float), len(a.place)).copy())


def moved(found: Motions, way: np.ndarray) -> Motions:
    """Return motions whose box B is moved by ways (n, 3) as a whole."""
    starts, ends = found.start_b.copy(), found.end_b.copy()
    starts[:, :3] += way
    ends[:, :3] += way
    return found._replace(start_b=starts, end_b=ends)


def grazing(found: Motions, wanted: np.ndarray) -> Motions:
    """Move boxes B aside until least distances are those wanted (n,) [m]."""
    left = np.arange(len(wanted))
    for _ in range(GRAZE_ROUNDS):
        some = found.rows(left)
        near = some.least(1e-8).nearest
        off = wanted[left] - near.distance
        touching = near.distance <= 1e-8
        step = np.where(touching, 0.3, off)[:, None] * near.normal
        keep = touching | (np.abs(off) > GRAZED * wanted[left])
        way = np.zeros((len(wanted), 3))
        way[left[keep]] = step[keep]
        found, left = moved(found, way), left[keep]
        if not left.size:
            break
    return found


Rng = np.random.Generator
HALF_CONTAINER = np.array(CONTAINER) / 2.0


def _units(rng: Rng, n: int) -> np.ndarray:
    vectors = rng.normal(size=(n, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _yaw(angle: np.ndarray) -> np.ndarray:
    return turns((0, 0, 1), angle)


def _column(values: np.ndarray) -> np.ndarray:
    return values[:, None]


def _tumblers(rng: Rng, n: int, lever: float = 0.0) -> tuple[Body, Body]:
    """Draw boxes of some decimetres to a metre that cross the same room, and turn."""
    def one() -> Body:
        place = 4.0 * rng.normal(size=(n, 3))
        return body(rng.uniform(0.2, 1.2, (n, 3)), place, 2.0 * rng.normal(size=(n, 3)) - place,
                    unit_quaternions(rng, n), rng.normal(size=(n, 3)),
                    lever * rng.normal(size=(n, 3)))
    return one(), one()


def tumbling(rng: Rng, n: int) -> Motions:
    """Draw boxes that both turn."""
    return motions(*_tumblers(rng, n))


def plates_and_bullets(rng: Rng, n: int) -> Motions:
    """Draw small boxes that fly at thin plates, and turn."""
    way = 20.0 * _units(rng, n)
    return motions(body([1.0, 1.0, 0.005], np.zeros((n, 3)), 0.0, unit_quaternions(rng, n)),
                   body([0.02, 0.02, 0.02], rng.normal(size=(n, 3)) - way, 2.0 * way,
                        unit_quaternions(rng, n), 3.0 * rng.normal(size=(n, 3))))


def swinging_containers(rng: Rng, n: int) -> Motions:
    """Draw containers on a crane beside ones that stand."""
    place = rng.normal(size=(n, 3)) * [1.0, 6.0, 0.0]
    place[:, 2] = rng.uniform(2.0, 4.0, n)
    way = rng.normal(size=(n, 3)) * [2.0, 6.0, 0.0]
    way[:, 2] = -rng.uniform(0.0, 1.5, n)
    return motions(body(HALF_CONTAINER, np.zeros((n, 3)), 0.0, _yaw(0.02 * rng.normal(size=n))),
                   body(HALF_CONTAINER, place, way, _yaw(0.1 * rng.normal(size=n)),
                        rng.normal(size=(n, 3)) * [0.05, 0.05, 0.1]))


def lowered_between_stacks(rng: Rng, n: int) -> Motions:
    """Draw containers that are lowered beside others, with 0 to 5 cm between."""
    beside, above = np.zeros((n, 3)), np.zeros((n, 3))
    beside[:, 1] = 2.438 + rng.uniform(0.0, 0.05, n)
    above[:, 0], above[:, 2] = 0.1 * rng.normal(size=n), 4.0
    return motions(body(HALF_CONTAINER, beside, 0.0),
                   body(HALF_CONTAINER, above, [0.0, 0.0, -4.0], _yaw(0.003 * rng.normal(size=n)),
                        rng.normal(size=(n, 3)) * [0.002, 0.002, 0.003]))


def slides_along_a_face(rng: Rng, n: int) -> Motions:
    """Draw containers that go over others, 2 to 4 cm above them."""
    place, way = np.tile([-15.0, 0.0, 2.591], (n, 1)), np.tile([30.0, 0.0, 0.0], (n, 1))
    place[:, 2] += rng.uniform(0.02, 0.04, n)
    way[:, 2] = 0.01 * rng.normal(size=n)
    return motions(body(HALF_CONTAINER, np.zeros((n, 3)), 0.0),
                   body(HALF_CONTAINER, place, way,
                        turn=rng.normal(size=(n, 3)) * [0.0, 0.001, 0.02]))


def bars_that_turn_by(rng: Rng, n: int) -> Motions:
    """Draw bars that turn past an edge, a micron to a millimetre beside it."""
    bars = body([3.0, 0.05, 0.05], 3.0 * _units(rng, n), 0.2 * rng.normal(size=(n, 3)),
                unit_quaternions(rng, n), _column(rng.uniform(1.0, 3.0, n)) * _units(rng, n))
    cubes = body([1.0, 1.0, 1.0], np.zeros((n, 3)), 0.0, unit_quaternions(rng, n))
    return grazing(motions(cubes, bars), log_uniform(rng, 1e-6, 1e-3, n))


def in_utm(rng: Rng, n: int) -> Motions:
    """Draw boxes that both turn, at coordinates of a map."""
    return _at_utm(rng, tumbling(rng, n))


def a_nanometre_apart(rng: Rng, n: int) -> Motions:
    """Draw boxes that hardly move, 1e-9 m apart."""
    a, b = (one._replace(way=1e-3 * one.way, turn=1e-3 * one.turn) for one in _tumblers(rng, n))
    return grazing(motions(a, b), np.full(n, 1e-9))


def grazing_tumbling(rng: Rng, n: int) -> Motions:
    """Draw boxes that both turn, and graze."""
    return grazing(tumbling(rng, n), _beside(rng, np.zeros(n)))


def grazing_the_clearance(rng: Rng, n: int) -> Motions:
    """Draw boxes that both turn, and graze a clearance of 1 to 300 mm."""
    clearance = log_uniform(rng, 1e-3, 0.3, n)
    return grazing(tumbling(rng, n), _beside(rng, clearance))._replace(clearance=clearance)


def slides_at_the_clearance(rng: Rng, n: int) -> Motions:
    """Draw containers that slide over others at the clearance, to a nanometre or a millimetre."""
    clearance = 0.1
    place = np.tile([-15.0, 0.0, 2.591 + clearance], (n, 1))
    place[:, 1] = rng.normal(size=n)
    place[:, 2] += rng.choice([-1.0, 1.0], n) * log_uniform(rng, 1e-9, 1e-3, n)
    turn = np.zeros((n, 3))
    turn[:, 2] = rng.choice([0.0, 0.1], n) * rng.normal(size=n)
    # Half of them in a frame that is turned.
    frame = np.where(rng.random((n, 1)) < 0.5, unit_quaternions(rng, n), [0.0, 0.0, 0.0, 1.0])
    by = rotation_matrix(frame)
    place, way, turn = (np.einsum('nij,nj->ni', by, vectors)
                        for vectors in (place, np.tile([30.0, 0.0, 0.0], (n, 1)), turn))
    return motions(body(HALF_CONTAINER, np.zeros((n, 3)), 0.0, frame),
                   body(HALF_CONTAINER, place, way, frame, turn), clearance)


def turns_near_pi(rng: Rng, n: int) -> Motions:
    """Draw boxes that turn by nearly half a circle."""
    a, b = (one._replace(turn=_column(np.pi - log_uniform(rng, 3e-9, 0.1, n)) * _units(rng, n))
            for one in _tumblers(rng, n))
    return motions(a, b)


def sizes_1_to_1000(rng: Rng, n: int) -> Motions:
    """Draw small boxes that fly at large ones."""
    return motions(
        body(rng.uniform(30.0, 330.0, (n, 3)), 100.0 * rng.normal(size=(n, 3)),
             100.0 * rng.normal(size=(n, 3)), unit_quaternions(rng, n),
             0.5 * rng.normal(size=(n, 3))),
        body(rng.uniform(0.03, 0.33, (n, 3)), 500.0 * _units(rng, n),
             300.0 * rng.normal(size=(n, 3)), unit_quaternions(rng, n), rng.normal(size=(n, 3))))


def grazing_in_utm(rng: Rng, n: int) -> Motions:
    """Draw boxes that graze at coordinates of a map, half of them a clearance."""
    clearance = np.where(rng.random(n) < 0.5, log_uniform(rng, 1e-3, 0.3, n), 0.0)
    found = grazing(tumbling(rng, n), _beside(rng, clearance))
    return _at_utm(rng, found._replace(clearance=clearance))


def no_motion(rng: Rng, n: int) -> Motions:
    """Draw boxes that stay where they are."""
    a, b = (one._replace(way=0.0 * one.way, turn=0.0 * one.turn) for one in _tumblers(rng, n))
    return motions(a, b)


def equal_motions(rng: Rng, n: int) -> Motions:
    """Draw boxes that go the same way and turn the same way, half of them near each other."""
    a, b = _tumblers(rng, n)
    near = a.place + _column(log_uniform(rng, 0.1, 10.0, n)) * _units(rng, n)
    return motions(a, b._replace(way=a.way, turn=a.turn,
                                 place=np.where(rng.random((n, 1)) < 0.5, near, b.place)))


def edges_nearly_parallel(rng: Rng, n: int) -> Motions:
    """Draw long boxes whose edges are parallel to 1e-9 to 1e-2 rad, which graze."""
    a, b = (one._replace(half=one.half * [5.0, 1.0, 1.0], turn=np.where(
        rng.random((n, 1)) < 0.5, 0.0, _column(log_uniform(rng, 1e-6, 1.0, n))
        * rng.normal(size=(n, 3)))) for one in _tumblers(rng, n))
    tilt = turns(_units(rng, n), log_uniform(rng, 1e-9, 1e-2, n))
    about = turns((1, 0, 0), 2.0 * rng.normal(size=n))
    along = rotation_matrix(a.start)[:, :, 0]
    turn = np.where(rng.random((n, 1)) < 0.5, _column(rng.normal(size=n)) * along, b.turn)
    start = quaternion_multiply(tilt, quaternion_multiply(a.start, about))
    return grazing(motions(a, b._replace(start=start, turn=turn)), log_uniform(rng, 1e-6, 1e-3, n))


def bodies(rng: Rng, n: int) -> Motions:
    """Draw boxes of bodies, whose centres go on arcs."""
    return motions(*_tumblers(rng, n, 1.0))


def grazing_bodies(rng: Rng, n: int) -> Motions:
    """Draw boxes of bodies that graze."""
    return grazing(bodies(rng, n), log_uniform(rng, 1e-6, 1e-3, n))


def _beside(rng: Rng, clearance: np.ndarray) -> np.ndarray:
    """Return least distances (n,) beside clearances, one in five below."""
    n = len(clearance)
    off = np.minimum(0.5 * (clearance + 1e-6), log_uniform(rng, 1e-6, 1e-3, n))
    return np.asarray(clearance + np.where(rng.random(n) < 0.2, -off, off))


def _at_utm(rng: Rng, found: Motions) -> Motions:
    way = UTM + rng.uniform(0.0, 1e5, (len(found.clearance), 3)) * [1.0, 1.0, 0.0]
    starts, ends = found.start_a.copy(), found.end_a.copy()
    starts[:, :3] += way
    ends[:, :3] += way
    return moved(found._replace(start_a=starts, end_a=ends), way)


Kind = Callable[[Rng, int], Motions]
EVERYDAY: dict[str, Kind] = {
    'containers that swing': swinging_containers,
    'lowered between stacks': lowered_between_stacks,
    'slides along a face': slides_along_a_face,
    'bars that turn by': bars_that_turn_by,
    'plates and bullets': plates_and_bullets,
    'both turning': tumbling,
    '1e-9 m apart': a_nanometre_apart,
    'UTM coordinates': in_utm}
HARD: dict[str, Kind] = {
    'grazing': grazing_tumbling,
    'grazing the clearance': grazing_the_clearance,
    'slides at the clearance': slides_at_the_clearance,
    'turns near π': turns_near_pi,
    'no motion': no_motion,
    'equal motions': equal_motions,
    'sizes 1:1,000': sizes_1_to_1000,
    'grazing, UTM': grazing_in_utm,
    'edges nearly parallel': edges_nearly_parallel,
    'boxes of bodies': bodies,
    'boxes of bodies, grazing': grazing_bodies}
KINDS = {**EVERYDAY, **HARD}


def draw(kind: str, seed: int, n: int) -> Motions:
    """Draw n motions of a kind."""
    return KINDS[kind](np.random.default_rng([seed, *kind.encode()]), n)
