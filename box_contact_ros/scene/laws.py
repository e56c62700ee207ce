# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From contacts to wrenches: laws that hold the patches between questions.

A simulator asks for contacts at some rate, and its answers come late. A law takes each answer with
the poses for which it was asked. Then it says which wrench acts on each body, from the patches that
it holds and from where the bodies are by now.

`HeldPatch` is for one load on boxes that are fixed. The simulator asks it at every physics step.
`SceneLaw` is the same for all bodies of a scene.

Both are faces of the same code in libbox_contact; docs/explanation/force.md derives it. Its
source is an elastic foundation under each patch (Johnson, Contact Mechanics, section 4.3). Friction
has an anchor and a limit surface (Goyal, Ruina and Papadopoulos, 1991).

Conventions: those of `pose`; SI units. A pose (7,) is that of a body's box, as the solver takes it.
A velocity (6,) is linear [m/s], of the centre of mass, then angular [rad/s]. A wrench (6,) is a
force [N], then a torque [N m] about the centre of mass. All in the common frame.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from ..solver.checks import as_floats, short_repr
from ..solver.contact import Contact
from .scene_solver import Answer, Pair, Scene

GRAVITY = 9.81
"""Gravitational acceleration [m/s²]."""

FRICTION = 0.5
"""Coulomb's μ [1], steel on steel, dry."""

Touches = Contact | Mapping[str, Contact]
"""The contact of the only pair, or contacts by the names of their pairs."""

FIXED = -1  # place of a box that does not move


@dataclass(frozen=True, kw_only=True)
class Body:
    """A body that forces move, of one box.

    mass     [kg]
    inertia  principal moments (3,) about the box's own axes through the centre of mass [kg m²]
    centre   of mass (3,), in the box's own frame [m]
    """

    mass: float
    inertia: Sequence[float] | np.ndarray
    centre: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)

    @classmethod
    def of_box(cls, size: Sequence[float] | np.ndarray, mass: float) -> Self:
        """Return the body of a box of full extents (3,) [m] and of one density."""
        squares = np.square(np.asarray(size, dtype=float))
        return cls(mass=mass, inertia=mass / 12.0 * (squares.sum() - squares))


def native_law(bodies: Sequence[Body], *, rate_hz: float, latency: float, step: float,
               friction: float, gravity: float) -> native.Law:
    """Return the library's law of some bodies; ValueError: names the field and its value."""
    mass, inertia, centre = (
        as_floats([getattr(body, name) for body in bodies], name, shape, *accepted)
        for name, shape, accepted in (('mass', 'a number for each body', ((None,),)),
                                      ('inertia', 'three numbers for each body', ((None, 3),)),
                                      ('centre', 'three numbers for each body', ((None, 3),))))
    return native.Law(mass, inertia, centre, rate_hz, latency, step, friction, gravity)


def _hold(law: native.Law, touches: Sequence[tuple[str, int, int, int, Contact | None]],
          poses: ArrayLike) -> None:
    """Hold touches: the name and number of a pair, the places of its bodies, its contact.

    None for a contact keeps the patch of its pair. ValueError: names the pair.
    """
    try:
        law.hold([(number, a, b, contact) for _, number, a, b, contact in touches],
                 _unmasked(poses, 'poses'))
    except ValueError as error:
        start, _, words = str(error).partition(': ')
        labels = {f'pair {number}': name for name, number, *_ in touches}
        if start not in labels:
            raise
        raise ValueError(f'pair {labels[start]}: {words}' if labels[start] else words) from None


def _unmasked(rows: ArrayLike, name: str) -> ArrayLike:
    """Return rows, or raise ValueError for masked ones, whose mask NumPy would drop."""
    if isinstance(rows, np.ma.MaskedArray):
        raise ValueError(f'{name} must be numbers without a mask, not {short_repr(rows)}')
    return rows


def _named(contacts: Touches) -> Mapping[str, Contact]:
    """Return contacts by the names of their pairs; ValueError where friction could mix them up."""
    if isinstance(contacts, Contact):
        return {'': contacts}
    if isinstance(contacts, Mapping):
        return contacts
    raise ValueError(f'contacts must be one Contact, or a dict by the names of their pairs, not a '
                     f'{type(contacts).__name__}: friction has to know each pair again')


class _Law:
    """What all laws share."""

    _law: native.Law

    def reset(self) -> None:
        """Forget all patches: bodies were put elsewhere."""
        self._law.reset()

    def copy(self) -> Self:
        """Return a law with the same patches and friction."""
        twin = object.__new__(type(self))
        twin.__dict__ |= self.__dict__ | {'_law': self._law.copy()}
        return twin

    __copy__ = copy

    def __deepcopy__(self, memo: object) -> Self:
        """Return a law with the same patches and friction."""
        return self.copy()


class HeldPatch(_Law):
    """The wrench on one load, at every physics step, from the patches of the last answer.

    Make it with `at_rate`. A pair is known by its name, so friction remembers it from answer to
    answer, in whichever order they come.
    """

    def __init__(self, law: native.Law) -> None:
        """Take over a native law of one body."""
        self._law = law
        self._numbers: dict[str, int] = {}  # of pairs, by name

    @classmethod
    def at_rate(cls, load: Body, *, rate_hz: float, latency: float = 0.0, step: float = 0.001,
                friction: float = FRICTION, gravity: float = GRAVITY) -> Self:
        """Return the law of a load whose contacts are asked for `rate_hz` times a second.

        latency: from a question to the use of its answer [s]. step: the physics step [s].
        ValueError: names the field and its value.
        """
        return cls(native_law([load], rate_hz=rate_hz, latency=latency, step=step,
                              friction=friction, gravity=gravity))

    @property
    def frequency(self) -> float:
        """Return Ω [1/s]; the load rests at the depth gravity / Ω² on a whole face."""
        return self._law.frequency

    def hold(self, contacts: Touches, pose: ArrayLike, *, load: Literal['a', 'b'] = 'a') -> None:
        """Hold the contacts that were asked for with the load at `pose` (7,); forget others.

        load: which of its pair's boxes the load is. ValueError: a contact without a patch (of
        `soup` or `paper`), or a normal that cannot be meant for this load; nothing changes then.
        """
        if load not in ('a', 'b'):
            raise ValueError(f"load must be 'a' or 'b', not {short_repr(load)}")
        a, b = (0, FIXED) if load == 'a' else (FIXED, 0)
        _hold(self._law, [(name, self._numbers.setdefault(name, len(self._numbers)), a, b, contact)
                          for name, contact in _named(contacts).items()], pose)

    def wrench(self, pose: ArrayLike, velocity: ArrayLike) -> np.ndarray:
        """Return force and torque (6,) at `pose` (7,) and `velocity` (6,), a step at a time.

        Friction follows the way from one call to the next.
        """
        wrench: np.ndarray = self._law.wrenches(_unmasked(pose, 'pose'),
                                                _unmasked(velocity, 'velocity'))[0]
        return wrench


class SceneLaw(_Law):
    """The wrenches on all bodies of a scene, at every physics step, from its last answer.

    Make it with `at_rate`. Boxes that move without a body in the law (a conveyor, a spreader on
    rails) push, and are not pushed.
    """

    def __init__(self, law: native.Law, scene: Scene, moving: Sequence[str]) -> None:
        """Take over a native law of the boxes `scene.moving`; see `at_rate`."""
        self._law, self._scene, self._free = law, scene, frozenset(moving)
        self._numbers: dict[Pair, int] = {}  # of pairs, as they come
        self._place = dict.fromkeys(scene.boxes, FIXED) | {
            name: place for place, name in enumerate(scene.moving)}

    @classmethod
    def at_rate(cls, scene: Scene, bodies: Mapping[str, Body | float], *, rate_hz: float,
                latency: float = 0.0, step: float = 0.001, friction: float = FRICTION,
                gravity: float = GRAVITY) -> Self:
        """Return the law of a scene whose contacts are asked for `rate_hz` times a second.

        bodies: by the names of their boxes; a number is the mass [kg] of a box of one density.
        latency: from a question to the use of its answer [s]. step: the physics step [s].
        ValueError: names the field and its value.
        """
        for name in bodies:
            if name not in scene.moving:
                raise ValueError(f'bodies: {short_repr(name)} is none of the boxes that move: '
                                 f'{short_repr(list(scene.moving))}')
        unmoved = Body(mass=0.0, inertia=np.zeros(3))
        each = []
        for name in scene.moving:
            body = bodies.get(name, unmoved)
            each.append(body if isinstance(body, Body)
                        else Body.of_box(scene.boxes[name].size, body))
        return cls(native_law(each, rate_hz=rate_hz, latency=latency, step=step,
                              friction=friction, gravity=gravity), scene, tuple(bodies))

    @property
    def frequency(self) -> float:
        """Return Ω [1/s]: no body oscillates faster on its patches."""
        return self._law.frequency

    def hold(self, answer: Answer, poses: ArrayLike) -> None:
        """Hold the answer of a `SceneSolver` to `poses` (n, 7), a row for each of `scene.moving`.

        Pairs that the answer does not list as touching lose patch and friction, but stale ones keep
        both. ValueError: a contact without a patch (of `soup` or `paper`), or of a pair that the
        scene lacks; nothing changes then.
        """
        place = self._place
        contacts: list[tuple[Pair, Contact | None]] = [
            *answer.named()[:answer.touching], *((pair, None) for pair in answer.named_stale())]
        for pair, _ in contacts:
            if pair.a not in place or pair.b not in place:
                raise ValueError(f'{short_repr(pair)} is no pair of the scene of this law')
        touches = [(pair.label, self._numbers.setdefault(pair, len(self._numbers)),
                    place[pair.a], place[pair.b], contact)
                   for pair, contact in contacts
                   if pair.a in self._free or pair.b in self._free]
        try:
            _hold(self._law, touches, poses)
        except ValueError as error:
            raise self._naming_the_box(error, poses) from None

    def wrenches(self, poses: ArrayLike, velocities: ArrayLike) -> np.ndarray:
        """Return forces and torques (n, 6) at `poses` (n, 7) and `velocities` (n, 6), once a step.

        Rows are those of `scene.moving`. Friction follows the way from one call to the next.
        ValueError: a box without a pose. A law has all boxes of its scene: make another law for
        fewer.
        """
        try:
            return self._law.wrenches(_unmasked(poses, 'poses'),
                                      _unmasked(velocities, 'velocities'))
        except ValueError as error:
            raise self._naming_the_box(error, poses) from None

    def _naming_the_box(self, error: ValueError, poses: ArrayLike) -> ValueError:
        """Return what to raise: where a box has no pose, None or NaN, its name."""
        rows = poses if isinstance(poses, Sequence | np.ndarray) else ()
        for name, pose in zip(self._scene.moving, rows):
            if pose is None or (isinstance(pose, np.ndarray) and pose.dtype.kind == 'f'
                                and np.isnan(pose).any()):
                return ValueError(f'{short_repr(name)} has no pose, and a law needs one for each '
                                  f'of {short_repr(list(self._scene.moving))}')
        return error
