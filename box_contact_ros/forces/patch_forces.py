# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From contacts to forces: the patches of all pairs as velocity constraints.

`PatchForces` finds the contacts of boxes at every physics step, or takes answers of others with the
poses of the question. It moves all bodies, or gives the wrenches that move them. One load on fixed
boxes is a scene like any other.

It is a face of code in libbox_contact; docs/explanation/force.md describes the method, sequential
impulses (Catto, 2005).

Conventions: those of `pose`; SI units. A pose (7,) is that of a body: of its box, if it has one.
A velocity (6,) is linear [m/s], of the centre of mass, then angular [rad/s]. A wrench (6,) is a
force [N], then a torque [N m] about the centre of mass. All in the common frame.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from ..core import (
    INERTIA_SLACK,
    LENGTH_MAX,
    MASS_MAX,
    MASS_MIN,
    SUBSTEPS_MAX,
    THREADS_MAX,
    native,
)
from ..solver.checks import (
    as_floats,
    as_number,
    as_pairs,
    as_size,
    as_whole,
    as_wholes,
    pose_fault,
    short_repr,
    size_fault,
)
from ..solver.contact import Contacts
from ..solver.pose import rotation_matrix
from ..solver.poses import as_poses

GRAVITY = 9.81
"""Gravitational acceleration [m/s²]."""

FRICTION = 0.5
"""Coulomb's μ [1], steel on steel, dry."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """What the forces know of a body. It equals itself alone, as its fields may be arrays.

    Raises ValueError, with field and value, for a mass outside 1e-50 to 1e50 kg. Moments of inertia
    that no body has and a centre that is not finite are refused as well.
    """

    mass: float
    """[kg]. A body of mass 0 is moved by no force, but by its velocity, or by the caller."""
    inertia: Sequence[float] | np.ndarray
    """(3,) principal moments about the body's own axes through the centre of mass [kg m²]."""
    centre: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)
    """(3,) centre of mass, in the body's own frame [m]."""

    def __post_init__(self) -> None:
        mass = as_number(self.mass, 'mass')
        if mass and not MASS_MIN <= mass <= MASS_MAX:
            raise ValueError(f'mass must be 0, or within {MASS_MIN:g} to {MASS_MAX:g} kg, not '
                             f'{mass:g}')
        inertia = as_floats(self.inertia, 'inertia', 'three principal moments', (3,))
        words = f'inertia ({", ".join(f"{moment:g}" for moment in inertia)})'
        is_moment = (MASS_MIN <= inertia) & (inertia <= MASS_MAX) | ((mass == 0.0) & (inertia == 0))
        if not is_moment.all():
            raise ValueError(f'{words} is not within {MASS_MIN:g} to {MASS_MAX:g} kg m²')
        if inertia.sum() < (2.0 - INERTIA_SLACK) * inertia.max():
            raise ValueError(f'{words} has a moment that exceeds the sum of the others')
        centre = as_floats(self.centre, 'centre', 'three coordinates', (3,))
        if not (np.abs(centre) <= LENGTH_MAX).all():
            raise ValueError(f'centre ({", ".join(f"{x:g}" for x in centre)}) is not finite, or '
                             f'exceeds {LENGTH_MAX:g} m')

    @classmethod
    def fixed(cls) -> Self:
        """Return a body of mass 0, which no force moves: ground, or what the caller moves."""
        return cls(mass=0.0, inertia=(0.0, 0.0, 0.0))

    @classmethod
    def of_box(cls, size: Sequence[float] | np.ndarray, mass: float) -> Self:
        """Return the body of a box of full extents (3,) [m] and of one density."""
        squares = np.square(as_size(size, 'size')[0])
        mass = as_number(mass, 'mass')
        return cls(mass=mass, inertia=mass / 12.0 * (squares.sum() - squares))

    @classmethod
    def of_boxes(cls, sizes: ArrayLike, poses: ArrayLike, masses: ArrayLike) -> Assembly:
        """Return the body of boxes of one density each, fixed to each other.

        sizes: full extents (m, 3) [m]. poses: (m, 7) in a frame of the boxes. masses: (m,) [kg].
        The body's axes are principal: turned against that frame where need be, as for an L.
        ValueError: names field and value.
        """
        size, pose = _as_rows(sizes, 'sizes', 3), _as_rows(poses, 'poses', 7)
        mass = _as_rows(masses, 'masses')
        if not len(size) == len(pose) == len(mass) > 0:
            raise ValueError(f'sizes, poses and masses must be equally many, not {len(size)}, '
                             f'{len(pose)} and {len(mass)}')
        for k, (row, each) in enumerate(zip(pose, size)):
            fault, field = pose_fault(row), f'poses[{k}]'
            if not fault:
                fault, field = size_fault(each), f'sizes[{k}]'
            if fault:
                raise ValueError(f'{field} {fault}')
        if not (mass.min() >= 0.0 and 0.0 < mass.sum() < math.inf):
            raise ValueError(f'masses must be 0 or more, and not all 0, not {short_repr(mass)}')
        centre = mass @ pose[:, :3] / mass.sum()
        axes, arm, squares = rotation_matrix(pose[:, 3:]), pose[:, :3] - centre, size**2
        own = mass[:, None] / 12.0 * (squares.sum(axis=1, keepdims=True) - squares)
        inertia = np.einsum('nij,nj,nkj->ik', axes, own, axes) + np.einsum(
            'n,nij->ij', mass, (arm**2).sum(axis=1)[:, None, None] * np.eye(3)
            - arm[:, :, None] * arm[:, None])
        turn, own_poses = np.array([0.0, 0.0, 0.0, 1.0]), pose
        if np.abs(inertia - np.diag(np.diag(inertia))).max() > INERTIA_SLACK * inertia.max():
            principal = _principal_axes(inertia)
            turn = _quaternion(principal)
            inertia, centre = principal.T @ inertia @ principal, centre @ principal
            own_poses = np.array([[*(row[:3] @ principal), *_quaternion(principal.T @ each)]
                                  for row, each in zip(pose, axes)])
        return Assembly(cls(mass=float(mass.sum()), inertia=np.diag(inertia), centre=centre),
                        own_poses, turn)


class Assembly(NamedTuple):
    """A body of several boxes, and where they are in its frame."""

    body: Body
    """Its axes are principal."""
    poses: np.ndarray
    """(m, 7) of the boxes in the body's frame, as `PatchForces.set_boxes` takes them."""
    turn: np.ndarray
    """(4,) quaternion x y z w of the body's frame in that of the boxes; both have one origin."""


class Motion(NamedTuple):
    """What a step leads to: a row for each body."""

    poses: np.ndarray
    """(n, 7) at the end of the step."""
    velocities: np.ndarray
    """(n, 6) at the end of the step."""
    wrenches: np.ndarray
    """(n, 6) of contacts, their mean over the step, with what pushes overlaps out. A simulator that
    moves the bodies by itself calls `PatchForces.wrenches`."""
    awake: np.ndarray
    """(n,) bool. False where a body was laid down, or has no mass and does not move: its pose is
    the one that was given, its velocity 0."""


_NOT_WANTED = np.zeros((0, 6)), np.zeros(0, bool)
"""Wrenches and awake of a motion that has none."""


class Loads(NamedTuple):
    """What each contact carried, the mean over the last step: a row for each pair of boxes.

    Forces are those on box B; A gets the opposite. All is zero where nothing presses.
    With `set_boxes`, the patches of two bodies share as rubber pads do. All bodies of mass 0 are
    one support.
    """

    pairs: np.ndarray
    """(k, 2) boxes A and B, by the lower and then the higher one."""
    pressing: np.ndarray
    """(k,) along the normal from A to B [N]."""
    friction: np.ndarray
    """(k, 3) [N]."""
    torsion: np.ndarray
    """(k,) of friction, along the normal [N m]."""
    centre: np.ndarray
    """(k, 3) of pressure [m]."""
    corners: np.ndarray
    """(k, 4, 3) of a rectangle, in turn [m]. With `set_boxes` it is around the patch of the faces
    that are within 0.1 mm. Without, it has the moments of the overlap, which at rest is a wedge: it
    may reach beyond the rim."""
    corner_loads: np.ndarray
    """(k, 4) the part of `pressing` at each corner, never below 0 [N]: bilinear about `centre`."""
    too_deep: np.ndarray
    """(k,) bool, whether the patch is deeper than `most_depth`, or, with `set_boxes`, than a tenth
    of the thinner box."""


class PatchForces:
    """The forces of patches on all bodies, a physics step at a time, by sequential impulses.

    Bodies are known by their places 0 to n − 1, and so are boxes. Unless `set_boxes` says
    otherwise, box k is body k. Poses (n, 7) are those of bodies, `x y z qx qy qz qw`. Velocities
    (n, 6) are linear, of the centre of mass, then angular. Wrenches (n, 6) are a force, then a
    torque about the centre of mass. All are in the common frame.

    It may find the pairs of boxes that touch by itself::

        forces = PatchForces(bodies)
        forces.set_boxes(sizes, find_pairs=True)
        while True:
            poses, velocities, _, awake = forces.advance(dt, poses, velocities, gravity)

    To take a body out of the middle, put the last one in its place, `forget` both, and
    `set_bodies` without the last. Where `set_boxes` was called, call it before with the boxes that
    are left; with those of a new body, after.
    """

    def __init__(self, bodies: Sequence[Body], *, friction: float = FRICTION, substeps: int = 4,
                 threads: int = 1, most_depth: float = 1e-3, rest: bool = True) -> None:
        """Begin without patches.

        friction: Coulomb's μ of boxes without their own.
        substeps: equal parts of the longest step lately, more if 5 ms are exceeded; up to 1,000.
        threads: at most. They change no bit.
        most_depth: how deep what rests may be [m], where a load is large for the lighter body.
        With contacts of one's own, its island makes up to 64 times as many sub-steps. `loads`
        tells where that is not enough.
        rest: whether bodies at rest are laid down. `advance` then returns their poses as they were
        given until an input of theirs differs. At rest is what was slower than 0.1 mm/s, by its
        energy, for half a second.
        ValueError: names the field and its value.
        """
        self._native = native.PatchForces(
            *_columns(bodies), as_whole(substeps, 'substeps', 1, SUBSTEPS_MAX),
            as_whole(threads, 'threads', 1, THREADS_MAX), as_number(friction, 'friction'),
            as_number(most_depth, 'most_depth'), bool(rest))

    def set_bodies(self, bodies: Sequence[Body]) -> None:
        """Change masses, add bodies at the end, or drop bodies there with their patches."""
        self._native.set_bodies(*_columns(bodies))

    def set_boxes(self, sizes: ArrayLike, *, body: ArrayLike | None = None,
                  poses: ArrayLike | None = None, find_pairs: bool = False) -> None:
        """Say which boxes the bodies have; pairs are then of boxes, and poses of bodies.

        sizes: full extents (m, 3) [m]. body: of each box (m,); None: box k is body k. poses: of the
        boxes (m, 7) in the frames of their bodies; None: those frames. Patches of boxes that stay
        with their body stay; pairs without contacts are forgotten. find_pairs: each `advance` finds
        the pairs that touch, and solves them by `exact`; `hold` is refused. Boxes of one body are
        never a pair. Boxes that overlap across the normal by no more than 0.1 mm, and what they
        have sunk, only pass each other: they have no patch.
        ValueError: names the field and its value.
        """
        self._native.set_boxes(_as_rows(sizes, 'sizes', 3),
                               None if body is None else as_wholes(body, 'body'),
                               None if poses is None else _as_rows(poses, 'poses', 7),
                               bool(find_pairs))

    def set_surface(self, box: int, velocity: ArrayLike | None = None,
                    friction: float | None = None) -> None:
        """Set how the surface of a box moves and rubs, until it is set again; None: as before.

        velocity: (3,) beside that of its body, as of a belt, in the common frame [m/s]. It lasts
        under late answers, too. `surface_velocity` of `hold` is added.
        friction: Coulomb's μ. A pair has the lesser of both boxes, unless `hold` has one for it. A
        box without its own, or with NaN, has that of the forces.
        ValueError: names the field and its value.
        """
        self._native.set_surface(
            int(as_wholes([box], 'box')[0]), None if velocity is None else as_floats(
                velocity, 'velocity', 'three numbers', (3,)),
            None if friction is None else as_number(friction, 'friction'))

    def hold(self, pairs: ArrayLike, contacts: Contacts | None = None,
             poses: ArrayLike | None = None, *,
             friction: ArrayLike | None = None, surface_velocity: ArrayLike | None = None,
             age: float = 0.0, period: float = 0.0) -> None:
        """Take the contacts of pairs of boxes (k, 2), asked for at `poses`; forget other pairs.

        Without contacts, they are one's own: `exact` solves the pairs at the start of each
        `advance`. That needs `set_boxes`, and no poses, age or period. Holding the same pairs at
        each step wakes nobody.
        A contact whose separation is NaN is stale: the patch of its pair stays. Contacts of boxes
        that are of one body by now are passed over.
        friction: μ (k,); None: the lesser of both boxes.
        surface_velocity: (k, 3) of B's surface relative to A's [m/s], as of a belt. That of the
        bodies is added.
        age: how long ago the answer was asked for [s].
        period: from one question to the next [s]. 0 is the least of the last intervals between
        answers.
        ValueError: names field and value, such as a contact without a patch, or a pair that comes
        twice; nothing changes then.
        """
        if contacts is None:
            if poses is not None or age or period:
                raise ValueError('contacts must be those of poses, age and period, not None')
            self._native.hold_pairs(as_pairs(pairs, 'pairs'),
                                    *_columns_of_pairs(friction, surface_velocity))
            return
        if not isinstance(contacts, Contacts):
            raise ValueError(f'contacts must be Contacts, not {short_repr(contacts)}')
        if poses is None:
            raise ValueError('poses must be those of the question, not None')
        times = as_number(age, 'age'), as_number(period, 'period')
        rows = (contacts.separation, contacts.normal, contacts.point, contacts.volume,
                contacts.covariance, poses, friction, surface_velocity, *times)
        # Where all are plain arrays, no time is lost to checks; pairs alone often are not.
        if self._native.hold(pairs, *rows) or self._native.hold(as_pairs(pairs, 'pairs'), *rows):
            return
        self._native.hold(
            as_pairs(pairs, 'pairs'), _as_rows(contacts.separation, 'separation'),
            _as_rows(contacts.normal, 'normal', 3), _as_rows(contacts.point, 'point', 3),
            _as_rows(contacts.volume, 'volume'), _as_rows(contacts.covariance, 'covariance', 3, 3),
            _as_rows(poses, 'poses', 7),
            *_columns_of_pairs(friction, surface_velocity), *times)

    def advance(self, dt: float, poses: ArrayLike, velocities: ArrayLike,
                wrenches: ArrayLike | None = None, *, changed: ArrayLike | None = None,
                out: Sequence[np.ndarray | None] | None = None) -> Motion:
        """Return where the bodies are after a step of `dt` [s], and what contacts did.

        poses, velocities: at its start. wrenches: all but those of contacts, gravity among them.
        changed: (k,) places of those bodies at rest that may be given otherwise than at the end of
        the last step. The others are not read: they stay where they were. None: all may be.
        out: arrays for poses and velocities, and perhaps for wrenches and awake, that are written
        and returned; without one, or with None, there are no rows. Where those of poses and
        velocities are the arguments, and there is none for wrenches, rows at rest are not written:
        with `changed` they take no time.
        A body of mass 0 without a velocity goes from where it ended to the pose that is given:
        that of the step's end. `forget` what is put elsewhere.
        Call `advance` once a step. Steps of less than 1 s may differ in length.
        ValueError: names field and value; nothing changes then.
        """
        named = None if changed is None else as_wholes(changed, 'changed')
        if out is None:
            return Motion._make(_step(self._native.advance, dt, poses, velocities, wrenches, named))
        if not 2 <= len(out) <= 4 or out[0] is None or out[1] is None:
            raise ValueError(f'out must be (poses, velocities, …), not {short_repr(out)}')
        rows = (*out, None, None)[:4]
        _step(self._native.advance, dt, poses, velocities, wrenches, named, rows)
        return Motion(out[0], out[1], *(none if row is None else row
                                        for row, none in zip(rows[2:], _NOT_WANTED)))

    def ahead(self, dt: float, poses: ArrayLike, velocities: ArrayLike) -> np.ndarray:
        """Return the poses (n, 7) at which to take the wrenches of ropes and springs.

        Wrenches are constant over the n sub-steps of an `advance`. At the poses themselves, springs
        gain energy; at poses later by (n − 1)/2n · dt, they keep it. Nothing changes, so each step
        of a load on a rope is as follows; a damper takes `velocities` as they are::

            at = forces.ahead(dt, poses, velocities)
            poses, velocities, _, _ = forces.advance(dt, poses, velocities, gravity + rope(at))

        ValueError: names field and value.
        """
        return self._native.ahead(as_number(dt, 'dt'), _as_rows(poses, 'poses', 7),
                                  _as_rows(velocities, 'velocities', 6))

    def wrenches(self, dt: float, poses: ArrayLike, velocities: ArrayLike,
                 wrenches: ArrayLike | None = None) -> np.ndarray:
        """Return what moves the bodies in a step: the mean wrenches of contacts (n, 6).

        Call it instead of `advance`, with the same arguments. The next call takes the velocities to
        which these wrenches led, and removes the speed of pushing out from them.
        ValueError: names field and value; nothing changes then.
        """
        return _step(self._native.wrenches, dt, poses, velocities, wrenches)

    def loads(self) -> Loads:
        """Return what each pair carried in the last step.

        No rows if bodies or boxes were changed, or patches forgotten, since.
        """
        return Loads._make(self._native.loads())

    def forget(self, bodies: ArrayLike) -> None:
        """Forget the patches of bodies (k,), which were put elsewhere."""
        self._native.forget(as_wholes(bodies, 'bodies'))

    def reset(self) -> None:
        """Forget all patches."""
        self._native.reset()

    def __copy__(self) -> Self:
        """Return forces with the same bodies, patches and impulses."""
        twin = object.__new__(type(self))
        twin._native = self._native.copy()
        return twin

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Return the same as a copy: nothing is shared."""
        return self.__copy__()


def _step(step: Callable[..., Any], dt: float, poses: ArrayLike, velocities: ArrayLike,
          wrenches: ArrayLike | None, changed: np.ndarray | None = None,
          out: tuple[np.ndarray | None, ...] | None = None) -> Any:
    """Return what a step of C++ gives; it converts nothing, and gives None for other arrays."""
    dt = as_number(dt, 'dt')
    found = step(dt, poses, velocities, wrenches, changed, out)
    if found is not None:
        return found
    return step(dt, _as_rows(poses, 'poses', 7), _as_rows(velocities, 'velocities', 6),
                None if wrenches is None else _as_rows(wrenches, 'wrenches', 6), changed, out)


def _principal_axes(inertia: np.ndarray) -> np.ndarray:
    """Return principal axes, near those of the frame, as the columns of a rotation (3, 3)."""
    axes = np.linalg.eigh(inertia)[1]
    orders = permutations(range(3))
    axes = axes[:, max(orders, key=lambda order: np.abs(axes[range(3), order]).sum())]
    axes = axes * np.where(np.diag(axes) < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        axes[:, np.abs(np.diag(axes)).argmin()] *= -1.0
    return axes


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    """Return the quaternion x y z w of a rotation (3, 3)."""
    # Four times the squares of the components; from the largest, the others by products of two.
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    products = np.array([[1.0 + xx - yy - zz, xy + yx, xz + zx, zy - yz],
                         [xy + yx, 1.0 - xx + yy - zz, yz + zy, xz - zx],
                         [xz + zx, yz + zy, 1.0 - xx - yy + zz, yx - xy],
                         [zy - yz, xz - zx, yx - xy, 1.0 + xx + yy + zz]])
    row = products[np.diag(products).argmax()]
    return row / np.linalg.norm(row)


def _columns(bodies: Sequence[Body]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return masses (n,), inertias (n, 3) and centres (n, 3)."""
    if not isinstance(bodies, Sequence):
        raise ValueError(f'bodies must be a sequence of Body, not {short_repr(bodies)}')
    for k, body in enumerate(bodies):
        if not isinstance(body, Body):
            raise ValueError(f'bodies[{k}] must be a Body, not {short_repr(body)}')
    n = len(bodies)
    return (np.array([body.mass for body in bodies], dtype=float).reshape(n),
            np.array([body.inertia for body in bodies], dtype=float).reshape(n, 3),
            np.array([body.centre for body in bodies], dtype=float).reshape(n, 3))


def _columns_of_pairs(friction: ArrayLike | None, surface_velocity: ArrayLike | None,
                      ) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return what pairs may have of their own, checked."""
    return (None if friction is None else _as_rows(friction, 'friction'),
            None if surface_velocity is None else _as_rows(surface_velocity, 'surface_velocity', 3))


def _as_rows(value: ArrayLike, name: str, *shape: int) -> np.ndarray:
    """Return a row for each body or contact; C++ compares how many there are."""
    if shape == (7,) and (type(value) is not np.ndarray or value.ndim > 2):
        return as_poses(value, name)
    shapes = f'({", ".join(("n", *map(str, shape)))})' if shape else '(n,)'
    return as_floats(value, name, f'an array {shapes}', (None, *shape))
