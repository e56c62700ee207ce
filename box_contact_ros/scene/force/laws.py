# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From contacts to wrenches: laws that hold the patches between questions.

A simulator asks for contacts at some rate, and its answers come late. A law takes each answer with
the poses for which it was asked. Then it says which wrench acts on each body, from the patches that
it holds and from where the bodies are by now.

`HeldPatch` is for one load on boxes that are fixed. The simulator asks it at every physics step.
`SceneLaw` is the same for all bodies of a scene. `PatchLaw` is for clients that can only apply one
wrench until the next answer: `HeldWrench` then holds it.

All three are faces of the same code in libbox_contact; docs/explanation/force.md derives it. Its
source is an elastic foundation under each patch (Johnson, Contact Mechanics, section 4.3). Friction
has an anchor and a limit surface (Goyal, Ruina and Papadopoulos, 1991).

Conventions: those of `pose`; SI units. A pose (7,) is that of a body's box, as the solver takes it.
A velocity (6,) is linear [m/s], of the centre of mass, then angular [rad/s]. A wrench (6,) is a
force [N], then a torque [N m] about the centre of mass. All in the common frame.
"""
from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from ...core import native
from ...solver.checks import shown
from ...solver.contact import Contact
from ..scene_solver import Answer, Scene, id_of

GRAVITY = 9.81
"""Gravitational acceleration [m/s²]."""

FRICTION = 0.5
"""Coulomb's μ [1], steel on steel, dry."""

Touches = Contact | Mapping[str, Contact]
"""The contact of the only pair, or contacts by the names of their pairs."""

FIXED = -1  # place of a box that does not move


class Use(IntEnum):
    """What a program does with wrenches: `bc_use` of force.h."""

    HELD_PATCH = 0
    HELD_WRENCH = 1
    PREDICTED_WRENCH = 2


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


def native_law(bodies: Sequence[Body], use: Use, *, rate_hz: float, latency: float, step: float,
               friction: float, gravity: float) -> native.Law:
    """Return the library's law of some bodies; ValueError: names the field and its value."""
    mass, inertia, centre = (np.array([getattr(body, name) for body in bodies], dtype=float)
                             for name in ('mass', 'inertia', 'centre'))
    return native.Law(mass, inertia, centre, use, rate_hz, latency, step, friction, gravity)


def hold(law: native.Law, touches: Iterable[tuple[str, int, int, int, Contact]],
         poses: ArrayLike) -> None:
    """Hold touches: the name and id of a pair, the places of its bodies, its contact.

    ValueError: names the pair.
    """
    names, rows = {}, []
    for name, pair, a, b, contact in touches:
        names[f'pair {pair}:'] = name
        rows.append((pair, a, b, contact))
    try:
        law.hold(rows, poses)
    except ValueError as error:
        start, _, words = str(error).partition(': ')
        if f'{start}:' not in names:
            raise
        label = names[f'{start}:']
        raise ValueError(f'pair {label}: {words}' if label else words) from None


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


class _LoadLaw(_Law):
    """What the laws of one load share; made by their `for_loop`."""

    def __init__(self, law: native.Law) -> None:
        """Take over a native law of one body."""
        self._law = law

    @property
    def frequency(self) -> float:
        """Return Ω [1/s]; the load rests at the depth gravity / Ω² on a whole face."""
        return self._law.frequency

    def _hold(self, contacts: Touches, pose: ArrayLike, load: str) -> None:
        if load not in ('a', 'b'):
            raise ValueError(f"load must be 'a' or 'b', not {shown(load)}")
        a, b = (0, FIXED) if load == 'a' else (FIXED, 0)
        hold(self._law, [(name, id_of(name), a, b, contact)
                         for name, contact in _named(contacts).items()], pose)


class HeldPatch(_LoadLaw):
    """The wrench on one load, at every physics step, from the patches of the last answer.

    Make it with `for_loop`. A pair is known by its name, so friction remembers it from answer to
    answer, in whichever order they come.
    """

    @classmethod
    def for_loop(cls, load: Body, *, rate_hz: float, latency: float = 0.0, step: float = 0.001,
                 friction: float = FRICTION, gravity: float = GRAVITY) -> Self:
        """Return the law of a load whose contacts are asked for `rate_hz` times a second.

        latency: from a question to the use of its answer [s]. step: the physics step [s].
        ValueError: names the field and its value.
        """
        return cls(native_law([load], Use.HELD_PATCH, rate_hz=rate_hz, latency=latency, step=step,
                              friction=friction, gravity=gravity))

    def hold(self, contacts: Touches, pose: ArrayLike, *, load: Literal['a', 'b'] = 'a') -> None:
        """Hold the contacts that were asked for with the load at `pose` (7,); forget others.

        load: which of its pair's boxes the load is. ValueError: a contact without a patch (`fcl`,
        `soup`, `paper`), or a normal that cannot be meant for this load; nothing changes then.
        """
        self._hold(contacts, pose, load)

    def wrench(self, pose: ArrayLike, velocity: ArrayLike) -> np.ndarray:
        """Return force and torque (6,) at `pose` (7,) and `velocity` (6,), a step at a time.

        Friction follows the way from one call to the next.
        """
        wrench: np.ndarray = self._law.wrenches(pose, velocity)[0]
        return wrench


class PatchLaw(_LoadLaw):
    """The wrench on one load that a client holds from one answer to the next.

    Make it with `for_loop`, and hold its wrenches by `HeldWrench`. `HeldPatch` is better wherever
    the law can be asked at every physics step.
    """

    @classmethod
    def for_loop(cls, load: Body, *, rate_hz: float, latency: float = 0.0,
                 friction: float = FRICTION, gravity: float = GRAVITY,
                 predicted: bool = False) -> Self:
        """Return the law of a load whose contacts are asked for `rate_hz` times a second.

        latency: from a question to the use of its answer [s]. predicted: contacts, poses and
        velocities are those of a `Predictor`; latency is then what it may err by.
        """
        use = Use.PREDICTED_WRENCH if predicted else Use.HELD_WRENCH
        return cls(native_law([load], use, rate_hz=rate_hz, latency=latency, step=1.0 / rate_hz,
                              friction=friction, gravity=gravity))

    def wrench(self, contacts: Touches, pose: ArrayLike, velocity: ArrayLike, *,
               load: Literal['a', 'b'] = 'a') -> np.ndarray:
        """Return force and torque (6,) of contacts at this pose and velocity, once a tick.

        ValueError as `HeldPatch.hold`.
        """
        self._hold(contacts, pose, load)
        wrench: np.ndarray = self._law.wrenches(pose, velocity)[0]
        return wrench


class SceneLaw(_Law):
    """The wrenches on all bodies of a scene, at every physics step, from its last answer.

    Make it with `for_loop`. Boxes that move without a body in the law (a conveyor, a spreader on
    rails) push, and are not pushed.
    """

    def __init__(self, law: native.Law, scene: Scene, moving: Sequence[str]) -> None:
        """Take over a native law of the boxes `scene.moving`; see `for_loop`."""
        self._law, self._scene, self._free = law, scene, frozenset(moving)
        self._place = dict.fromkeys(scene.boxes, FIXED) | {
            name: place for place, name in enumerate(scene.moving)}

    @classmethod
    def for_loop(cls, scene: Scene, bodies: Mapping[str, Body | float], *, rate_hz: float,
                 latency: float = 0.0, step: float = 0.001, friction: float = FRICTION,
                 gravity: float = GRAVITY) -> Self:
        """Return the law of a scene whose contacts are asked for `rate_hz` times a second.

        bodies: by the names of their boxes; a number is the mass [kg] of a box of one density.
        latency: from a question to the use of its answer [s]. step: the physics step [s].
        ValueError: names the field and its value.
        """
        for name in bodies:
            if name not in scene.moving:
                raise ValueError(f'bodies: {shown(name)} is none of the boxes that move: '
                                 f'{shown(list(scene.moving))}')
        unmoved = Body(mass=0.0, inertia=np.zeros(3))
        each = []
        for name in scene.moving:
            body = bodies.get(name, unmoved)
            each.append(body if isinstance(body, Body)
                        else Body.of_box(scene.boxes[name].size, body))
        return cls(native_law(each, Use.HELD_PATCH, rate_hz=rate_hz, latency=latency, step=step,
                              friction=friction, gravity=gravity), scene, tuple(bodies))

    @property
    def frequency(self) -> float:
        """Return Ω [1/s]: no body oscillates faster on its patches."""
        return self._law.frequency

    def hold(self, answer: Answer, poses: ArrayLike) -> None:
        """Hold the answer of a `SceneSolver` to `poses` (n, 7), a row for each of `scene.moving`.

        Pairs that the answer does not list as touching lose patch and friction. So do stale ones:
        an answer with `stale` pairs whose boxes are still there is better not held.
        ValueError: a contact without a patch (`fcl`, `soup`, `paper`), or of a box that the scene
        lacks; nothing changes then.
        """
        place = self._place
        try:
            touches = [(pair.label, pair.id, place[pair.a], place[pair.b], contact)
                       for pair, contact in answer.touching
                       if pair.a in self._free or pair.b in self._free]
        except KeyError as error:
            raise ValueError(f'{shown(error.args[0])} is none of the boxes of this law') from None
        try:
            hold(self._law, touches, poses)
        except ValueError as error:
            raise self._naming_the_box(error, poses) from None

    def wrenches(self, poses: ArrayLike, velocities: ArrayLike) -> np.ndarray:
        """Return forces and torques (n, 6) at `poses` (n, 7) and `velocities` (n, 6), once a step.

        Rows are those of `scene.moving`. Friction follows the way from one call to the next.
        ValueError: a box without a pose. A law has all boxes of its scene: make another law for
        fewer.
        """
        try:
            return self._law.wrenches(poses, velocities)
        except ValueError as error:
            raise self._naming_the_box(error, poses) from None

    def _naming_the_box(self, error: ValueError, poses: ArrayLike) -> ValueError:
        """Return what to raise: where a box has no pose, None or NaN, its name."""
        rows = poses if isinstance(poses, Sequence | np.ndarray) else ()
        for name, pose in zip(self._scene.moving, rows):
            if pose is None or (isinstance(pose, np.ndarray) and pose.dtype.kind == 'f'
                                and np.isnan(pose).any()):
                return ValueError(f'{shown(name)} has no pose, and a law needs one for each of '
                                  f'{shown(list(self._scene.moving))}')
        return error
