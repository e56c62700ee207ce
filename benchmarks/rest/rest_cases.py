# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cases of the rest report: what is done, and what is expected of it beforehand.

Lengths in m, masses in kg, times in s. A case has gates. A gate measures one figure of a run, and
has the most that the figure may be. NaN is never within a limit.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from box_contact_ros.scene.force.laws import FRICTION, GRAVITY
from box_contact_ros.scene.pose import rotation_matrix

from ..pose_sets import CONTAINER
from .columns import STOPPED, stop_times
from .simulator import CORNERS, Log, Part, Push, Setup

MASS = 20_000.0  # of a container
FLOOR = Part(name='floor', size=(60.0, 60.0, 1.0), position=(0.0, 0.0, -0.5))


@dataclass(frozen=True)
class Gate:
    """A figure, and the most that it may be."""

    name: str  # with its unit
    limit: float | tuple[float, float, float]
    """One limit, or those at less than 200 Hz, less than 1 kHz, and from there on."""
    measure: Callable[[Log], float]

    @property
    def limits(self) -> tuple[float, ...]:
        """All limits, those of slow loops first."""
        return self.limit if isinstance(self.limit, tuple) else (self.limit,)

    def limit_at(self, rate_hz: float) -> float:
        """Return the limit of a loop; that of the slowest for MuJoCo, whose rate is 0."""
        return self.limits[min((rate_hz >= 200.0) + (rate_hz >= 1000.0), len(self.limits) - 1)]


@dataclass(frozen=True)
class RestCase:
    """What is simulated, and what is expected of it."""

    kind: str
    name: str
    expected: str
    setup: Setup
    gates: tuple[Gate, ...]


# --- figures --------------------------------------------------------------------------------------


def worst(values: Sequence[float] | np.ndarray) -> float:
    """Return the largest value; NaN if there is one, unlike `max`."""
    return float(np.max(values))


def corner_speeds(log: Log, name: str, start: float, end: float = math.inf) -> np.ndarray:
    """Return the speed of a box's fastest corner at every step, (n,) [m/s]."""
    part, poses, velocities = log.of(name, start, end)
    axes = rotation_matrices(poses)
    arms = np.einsum('nij,kj->nki', axes, CORNERS * part.size - part.centre)
    turning = np.cross(velocities[:, None, 3:], arms)
    return np.linalg.norm(velocities[:, None, :3] + turning, axis=2).max(axis=1)


def rotation_matrices(poses: np.ndarray) -> np.ndarray:
    """Return the axes (n, 3, 3) of poses (n, 7)."""
    x, y, z, w = poses[:, 3:].T
    return np.moveaxis(np.array([
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]]), 2, 0)


def speed(log: Log, start: float, end: float = math.inf) -> float:
    """Return the speed of the fastest corner of all free boxes [mm/s]."""
    return 1e3 * worst([corner_speeds(log, name, start, end).max() for name in log.free])


def rms_speed(log: Log, start: float) -> float:
    """Return the root mean square of the fastest corner's speed [mm/s]."""
    return 1e3 * worst([np.sqrt(np.mean(np.square(corner_speeds(log, name, start))))
                        for name in log.free])


def creep(log: Log, start: float) -> float:
    """Return how fast a free box is carried away from `start` to the end, on average [mm/s]."""
    ways = [np.linalg.norm(poses[-1, :3] - poses[0, :3])
            for poses in (log.of(name, start)[1] for name in log.free)]
    return 1e3 * worst(ways) / (log.setup.seconds - start)


def tilt(log: Log, upright: float = 0.0) -> float:
    """Return the angle of a free box's z axis to the vertical at the end, off `upright` [°]."""
    up = [rotation_matrices(log.of(one)[1][-1:])[0, 2, 2] for one in log.free]
    return worst(np.abs(np.degrees(np.arccos(np.clip(up, -1.0, 1.0))) - upright))


def gaps(log: Log, name: str) -> np.ndarray:
    """Return how far a box's lowest corner is above the floor at every step, (n,) [m]."""
    part, poses, _ = log.of(name)
    axes = rotation_matrices(poses)
    return poses[:, 2] + np.einsum('nj,kj->nk', axes[:, 2], CORNERS * part.size).min(axis=1)


def rebound(log: Log, height: float) -> float:
    """Return how high a load comes after its first touch [% of the height that it fell]."""
    after = gaps(log, 'load')
    after = after[int(np.argmax(after <= 0.0)):]
    return 100.0 * float(np.maximum(0.0, after.max())) / height


def energies(log: Log) -> np.ndarray:
    """Return the energy of all free boxes at every step, without that of patches, (n,) [J]."""
    total = np.zeros(len(log.times))
    for name in log.free:
        part, poses, velocities = log.of(name)
        axes = rotation_matrices(poses)
        own = np.einsum('nij,ni->nj', axes, velocities[:, 3:])
        height = poses[:, 2] + axes[:, 2] @ part.centre
        total += 0.5 * part.mass * np.square(velocities[:, :3]).sum(axis=1) + (
            0.5 * np.square(own) @ np.asarray(part.body.inertia)) + part.mass * GRAVITY * height
    return total


def gain(log: Log, height: float) -> float:
    """Return by how much the energy ever exceeds that at release [% of that of the fall]."""
    energy = energies(log)
    mass = sum(part.mass for part in log.setup.parts)
    return 100.0 * float(np.max(energy - energy[0])) / (mass * GRAVITY * height)


def acceleration_error(log: Log, along: np.ndarray, start: float, expected: float,
                       end: float = math.inf) -> float:
    """Return the error of the mean acceleration of all free boxes from `start` to `end` [%]."""
    speeds = np.mean([log.of(name, start, end)[2][:, :3] @ along for name in log.free], axis=0)
    found = (speeds[-1] - speeds[0]) / (log.step * (len(speeds) - 1))
    return 100.0 * abs(float(found) / expected - 1.0)


def stop_error(log: Log, motion: int, expected: float) -> float:
    """Return the error of the time at which slide (0) or spin (1) has stopped [%]."""
    _, _, velocities = log.of('load')
    speeds = np.linalg.norm(velocities[:, :2], axis=1) if motion == 0 else np.abs(velocities[:, 5])
    stopped = speeds < STOPPED * speeds[0]
    return 100.0 * abs(float(log.times[np.argmax(stopped)]) / expected - 1.0) if (
        stopped.any()) else math.nan


def shifted(log: Log, start: float) -> float:
    """Return how far along the floor a free box is at the end from where it was at `start` [mm]."""
    return 1e3 * worst([np.linalg.norm(poses[-1, :2] - poses[0, :2])
                        for poses in (log.of(name, start)[1] for name in log.free)])


def shear(log: Log, start: float) -> float:
    """Return by how much boxes have moved along x against each other, [mm]."""
    ways = [poses[-1, 0] - poses[0, 0]
            for poses in (log.of(part.name, start)[1] for part in log.setup.moving)]
    return 1e3 * float(np.ptp(ways))


# --- gates that several kinds have ----------------------------------------------------------------


def at_rest(start: float) -> tuple[Gate, ...]:
    """Return the gates of a load that rests from `start` on."""
    return (Gate('corner [mm/s]', 1e-4, partial(speed, start=start)),
            Gate('creep [mm/s]', 1e-5, partial(creep, start=start)),
            Gate('tilt [°]', (0.06, 0.01, 0.003), tilt))


def quaternion(axis: Sequence[float], degrees: float) -> np.ndarray:
    """Return x y z w (4,) of a turn about an axis (3,)."""
    half = 0.5 * math.radians(degrees)
    return np.append(math.sin(half) * np.array(axis, dtype=float) / np.linalg.norm(axis),
                     math.cos(half))


def over_floor(size: tuple[float, float, float], mass: float, height: float = 0.0,
               turned: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0, 1.0), **more: object) -> Part:
    """Return a load whose lowest corner is so high above the floor [m]."""
    axes = rotation_matrix(np.array(turned, dtype=float))
    low = float((CORNERS * size @ axes.T)[:, 2].min())
    return Part(name='load', size=size, mass=mass, quaternion=turned,
                position=(0.0, 0.0, height - low), **more)  # type: ignore[arg-type]


# --- the cases ------------------------------------------------------------------------------------

CUBE, CUBE_MASS = (2.0, 2.0, 2.0), 8000.0
BLOCK, BLOCK_MASS = (2.0, 2.0, 1.0), 1000.0
TALL, TALL_MASS = (1.0, 1.0, 4.0), 1000.0
LEVEL = quaternion((0, 0, 1), 0.0)
LONG_EDGE = quaternion((1, 0, 0), 20.0)


def drops() -> list[RestCase]:
    """Return drops, level, on an edge and on a corner."""
    poses = [('container', CONTAINER, MASS, 'level', LEVEL),
             ('container', CONTAINER, MASS, 'on an edge', quaternion((0, 1, 0), 5.0)),
             ('container', CONTAINER, MASS, 'on a corner', quaternion((1, 2, 0), 5.0)),
             ('2 m cube', CUBE, CUBE_MASS, 'level', LEVEL),
             ('2 m cube', CUBE, CUBE_MASS, 'on an edge', quaternion((0, 1, 0), 44.0)),
             ('2 m cube', CUBE, CUBE_MASS, 'on a corner', quaternion((1, -1, 0), 54.0))]
    return [RestCase(
        'drop', f'{name} {how}, {1e3 * height:g} mm', 'stays down, gains no energy',
        Setup(parts=(FLOOR, over_floor(size, mass, height, turned)), seconds=4.0),
        (Gate('rebound [% of the drop]', 5.0, partial(rebound, height=height)),
         Gate('energy gain [% of the drop]', 1.0, partial(gain, height=height))))
        for name, size, mass, how, turned in poses for height in (0.005, 0.05, 0.5)]


def light_contacts() -> list[RestCase]:
    """Return loads that ropes carry for the most part, and that wind presses against another."""
    cases = []
    for share in (0.02, 0.1, 0.2, 0.5):
        ropes = Push(name='load', force=(0.0, 0.0, (1.0 - share) * MASS * GRAVITY))
        cases.append(RestCase(
            'light', f'ropes leave {100 * share:g} % of the weight', 'rests',
            Setup(parts=(FLOOR, over_floor(CONTAINER, MASS, 0.005)), pushes=(ropes,), seconds=12.0),
            (Gate('rms speed [mm/s]', 1e-3, partial(rms_speed, start=8.0)),)))
    for force in (1500.0, 6000.0):
        neighbour = Part(name='neighbour', size=CONTAINER, position=(0.7, CONTAINER[1] + 0.01, 0.3))
        load = Part(name='load', size=CONTAINER, position=(0.0, 0.0, 0.0), mass=MASS)
        push = Push(name='load', force=(0.0, force, MASS * GRAVITY))
        cases.append(RestCase(
            'light', f'wind of {force:g} N against a neighbour', 'rests',
            Setup(parts=(neighbour, load), pushes=(push,), seconds=20.0),
            (Gate('rms speed [mm/s]', 1e-3, partial(rms_speed, start=15.0)),)))
    return cases


def on_slope(size: tuple[float, float, float], mass: float, degrees: float, seconds: float,
             ) -> Setup:
    """Return a load that is put on a slope."""
    turned = quaternion((0, 1, 0), degrees)
    axes = rotation_matrix(turned)
    slope = Part(name='slope', size=(200.0, 40.0, 1.0), position=-0.5 * axes[:, 2],
                 quaternion=turned)
    load = Part(name='load', size=size, mass=mass, position=0.5 * size[2] * axes[:, 2],
                quaternion=turned)
    return Setup(parts=(slope, load), seconds=seconds)


def slopes() -> list[RestCase]:
    """Return slopes below and beyond friction."""
    loads = [('2 × 2 × 1 m', BLOCK, BLOCK_MASS), ('container', CONTAINER, MASS),
             ('0.1 m cube', (0.1, 0.1, 0.1), 1.0), ('1 × 1 × 4 m', TALL, TALL_MASS)]
    cases = [RestCase('slope', f'{name} on {degrees:g}°', 'stays',
                      on_slope(size, mass, degrees, 12.0),
                      (Gate('creep after 10 s [mm/s]', 1e-6, partial(creep, start=10.0)),))
             for name, size, mass in loads for degrees in (5.0, 15.0, 25.0)
             if size is not TALL or degrees == 5.0]  # it topples from 14° on
    for degrees in (30.0, 40.0):
        angle = math.radians(degrees)
        expected = GRAVITY * (math.sin(angle) - FRICTION * math.cos(angle))
        along = np.array([math.cos(angle), 0.0, -math.sin(angle)])
        cases.append(RestCase(
            'slope', f'2 × 2 × 1 m on {degrees:g}°', 'slides by g (sin θ − μ cos θ)',
            on_slope(BLOCK, BLOCK_MASS, degrees, 4.0),
            (Gate('acceleration, error [%]', 1.0, partial(
                acceleration_error, along=along, start=1.0, expected=expected)),)))
    return cases


def pushes() -> list[RestCase]:
    """Return pushes along the floor, and at the top of a tall box."""
    cases = []
    for share in (0.5, 0.9, 1.1):
        push = Push(name='load', force=(share * FRICTION * BLOCK_MASS * GRAVITY, 0, 0), start=1.0)
        beyond = (share - 1.0) * FRICTION * GRAVITY
        setup = Setup(parts=(FLOOR, over_floor(BLOCK, BLOCK_MASS)), pushes=(push,),
                      seconds=12.0 if beyond < 0.0 else 6.0)
        gate = Gate('creep after 9 s [mm/s]', 1e-5, partial(creep, start=10.0))
        if beyond > 0.0:
            gate = Gate('acceleration, error [%]', 1.0, partial(
                acceleration_error, along=np.eye(3)[0], start=2.0, expected=beyond))
        cases.append(RestCase('push', f'2 × 2 × 1 m by {share:g} μmg', 'stays' if beyond < 0.0 else
                              'slides by 0.1 μg', setup, (gate,)))
    tips = TALL_MASS * GRAVITY * TALL[0] / (2.0 * TALL[2])
    push = Push(name='load', force=(0.5 * tips, 0.0, 0.0), at=(0.0, 0.0, 0.5 * TALL[2]))
    cases.append(RestCase(
        'push', '1 × 1 × 4 m, at its top, by half of what tips it', 'rests',
        Setup(parts=(FLOOR, over_floor(TALL, TALL_MASS)), pushes=(push,), seconds=20.0),
        (Gate('corner [mm/s]', 1e-4, partial(speed, start=15.0)),
         Gate('creep [mm/s]', 1e-5, partial(creep, start=15.0)))))
    return cases


def spins() -> list[RestCase]:
    """Return boxes that spin and slide to a stop; low ones, whose pressure is uniform."""
    cases = []
    for name, size, slide, spin in (
            ('container', CONTAINER, 0.0, 1.0), ('2 × 2 m', (2.0, 2.0, 0.2), 0.0, 6.0),
            ('2 × 2 m', (2.0, 2.0, 0.2), 1.0, 0.0), ('2 × 2 m', (2.0, 2.0, 0.2), 1.0, 2.0),
            ('2 × 2 m', (2.0, 2.0, 0.2), 1.0, 6.0), ('6 × 1 m', (6.0, 1.0, 0.2), 1.0, 1.0)):
        times = stop_times(size, slide, spin, FRICTION)
        gates = tuple(Gate(f'{what} stops, error [%]', 5.0,
                           partial(stop_error, motion=motion, expected=times[motion]))
                      for motion, what in enumerate(('slide', 'spin')) if times[motion] > 0.0)
        load = over_floor(size, BLOCK_MASS, velocity=(slide, 0.0, 0.0, 0.0, 0.0, spin))
        cases.append(RestCase(
            'spin', f'{name} at {slide:g} m/s and {spin:g} rad/s', 'stops as the columns do',
            Setup(parts=(FLOOR, load), seconds=math.ceil(np.nanmax(times) + 1.0)), gates))
    return cases


def topples() -> list[RestCase]:
    """Return boxes that are hit with a share of the energy that topples them over an edge."""
    cases = []
    for name, size, mass in (('2 m cube', CUBE, CUBE_MASS), ('1 × 1 × 4 m', TALL, TALL_MASS)):
        arm = np.array([-0.5 * size[0], 0.0, 0.5 * size[2]])  # from the edge to the centre
        load = over_floor(size, mass)
        about_edge = load.body.inertia[1] + mass * arm @ arm
        for share in (0.9, 1.05):
            needed = share * mass * GRAVITY * (np.linalg.norm(arm) - arm[2])
            turning = np.array([0.0, math.sqrt(2.0 * needed / about_edge), 0.0])
            pushed = replace(load, velocity=(*np.cross(turning, arm), *turning))
            # So rough that the edge does not slip.
            setup = Setup(parts=(FLOOR, pushed), seconds=40.0 if share < 1.0 else 8.0, friction=2.0)
            cases.append(RestCase(
                'topple', f'{name}, {share:g} of the energy that topples it',
                'stands' if share < 1.0 else 'falls on its side', setup,
                (Gate('tilt off [°]', 0.1, partial(tilt, upright=0.0 if share < 1.0 else 90.0)),)))
    return cases


def loads() -> list[RestCase]:
    """Return unusual loads and rests, let fall by 5 mm."""
    small, length = (6.058, 2.438, 2.591), CONTAINER[0]
    off = (0.1 * length, 0.1 * CONTAINER[1], -0.2)
    found = {'0.1 m cube, 1 kg': (FLOOR, over_floor((0.1, 0.1, 0.1), 1.0, 0.005)),
             '100 t, 6 × 3 × 3 m': (FLOOR, over_floor((6.0, 3.0, 3.0), 1e5, 0.005)),
             'plate, 6 × 2.4 m, 20 mm': (FLOOR, over_floor((6.0, 2.4, 0.02), 2260.0, 0.005)),
             'mass off the middle by 10 % of length and width': (
                 FLOOR, over_floor(CONTAINER, MASS, 0.005, centre=off))}
    casting = (0.178, 0.162, 0.118)
    corners = [(x, y) for x in (-1, 1) for y in (-1, 1)]
    castings = [Part(name=f'casting {x:+d} {y:+d}', size=casting, position=(
        0.5 * x * (small[0] - casting[0]), 0.5 * y * (small[1] - casting[1]), -0.5 * casting[2]))
        for x, y in corners]
    found['20 ft on four castings'] = (*castings, over_floor(small, MASS, 0.005))
    for share in (0.3, 0.4):
        stack = Part(name='stack', size=CONTAINER,
                     position=(share * length, 0.0, -0.5 * CONTAINER[2]))
        found[f'overhanging by {100 * share:g} % of the length'] = (
            stack, over_floor(CONTAINER, MASS, 0.005))
    return [RestCase('load', name, 'rests', Setup(parts=parts, seconds=15.0), at_rest(14.0))
            for name, parts in found.items()]


def stacked(masses: Sequence[float], seconds: float, pushes: tuple[Push, ...] = (), *,
            tilted: float = 0.1, aside: float = 0.1) -> Setup:
    """Return containers that fall onto each other by 10 mm each, the lowest one first.

    tilted [°] and aside [m]: how far from level, and off the middle.
    """
    rng = np.random.default_rng(1)
    parts = [FLOOR]
    low = 0.5 * CONTAINER[0] * math.radians(tilted)
    for number, mass in enumerate(masses):
        heading = rng.uniform(0.0, 2.0 * math.pi)
        x, y = rng.uniform(-aside, aside, 2)
        parts.append(Part(
            name=f'{number}', size=CONTAINER, mass=mass,
            quaternion=quaternion((math.cos(heading), math.sin(heading), 0.0), tilted),
            position=(x, y, CONTAINER[2] * (number + 0.5) + (number + 1) * (0.01 + low))))
    return Setup(parts=tuple(parts), seconds=seconds, pushes=pushes)


def stacks() -> list[RestCase]:
    """Return stacks of containers: at rest, pushed, and of unequal masses."""
    cases = []
    for count in (2, 5):
        cases.append(RestCase(
            'stack', f'{count} containers', 'still within 6 s', stacked([MASS] * count, 8.0),
            (Gate('corner after 6 s [mm/s]', 1.0, partial(speed, start=6.0)),)))
    cases += pushed_stacks()
    for ratio in (3.0, 15.0):
        for below, above in ((30_000.0 / ratio, 30_000.0), (30_000.0, 30_000.0 / ratio)):
            cases.append(RestCase(
                'stack', f'{1e-3 * above:g} t on {1e-3 * below:g} t', 'still within 6 s',
                stacked([below, above], 8.0),
                (Gate('corner after 6 s [mm/s]', 1.0, partial(speed, start=6.0)),)))
    return cases


def pushed_stacks() -> list[RestCase]:
    """Return five containers that are pushed, below friction and beyond.

    The push is a jerk, and springs answer a jerk with twice its force. So 0.3 is below friction.
    """
    weight, names = 5 * MASS * GRAVITY, [f'{number}' for number in range(5)]

    def pushed(*shares: tuple[float, float, float], on: Sequence[str]) -> Setup:
        return stacked([MASS] * 5, 16.0, tuple(
            Push(name=name, force=(share * FRICTION * weight / len(on), 0.0, 0.0), start=start,
                 end=end) for name in on for share, start, end in shares), tilted=0.0, aside=0.0)

    cases = [RestCase(
        'stack', f'5 containers, 0.3 of friction pushes {who} for 2 s', 'stay',
        pushed((0.3, 6.0, 8.0), on=on), (Gate('shifted [mm]', 1.0, partial(shifted, start=5.9)),))
        for who, on in (('the lowest', names[:1]), ('all', names))]
    # Beyond friction for a second, then a little below it, so that the upper ones need not hold on
    # by more friction than there is.
    return [*cases, RestCase(
        'stack', '5 containers, 1.2 of friction pushes the lowest for 1 s, then 0.9',
        'move as one by 0.2 μg', pushed((1.2, 6.0, 7.0), (0.9, 7.0, 11.0), on=names[:1]),
        (Gate('acceleration, error [%]', 1.0, partial(
            acceleration_error, along=np.eye(3)[0], start=6.5, end=7.0,
            expected=0.2 * FRICTION * GRAVITY)),
         Gate('against each other [mm]', 2.0, partial(shear, start=5.9)),
         Gate('corner at the end [mm/s]', 1.0, partial(speed, start=15.0))))]


def ride(time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return position and velocity of a platform that goes 2 m aside and up within 6 s."""
    rate = math.pi / 6.0
    inside = min(time, 6.0)
    share, change = 0.5 * (1.0 - math.cos(rate * inside)), 0.5 * rate * math.sin(rate * inside)
    way = np.array([2.0, 0.0, 0.5])
    return way * share - np.array([0.0, 0.0, 0.5]), way * change


def several() -> list[RestCase]:
    """Return a platform that rides with its load, a spreader on its load, a pile of crates."""
    platform = Part(name='platform', size=(14.0, 4.0, 1.0), position=(0.0, 0.0, -0.5), path=ride)
    rope = Push(name='spreader', force=(0.0, 0.0, 0.8 * 10_000.0 * GRAVITY))
    spreader = Part(name='spreader', size=(CONTAINER[0], CONTAINER[1], 0.5), mass=10_000.0,
                    position=(0.1, 0.0, CONTAINER[2] + 0.27))
    cases = [
        RestCase('several', 'load on a platform that goes 2 m aside and 0.5 m up', 'rides with it',
                 Setup(parts=(platform, over_floor(CONTAINER, MASS)), seconds=21.0),
                 (Gate('against each other [mm]', 0.1, partial(shear, start=0.0)),
                  *at_rest(20.0))),
        RestCase('several', 'spreader on its load, ropes carry 80 % of it', 'rest',
                 Setup(parts=(FLOOR, over_floor(CONTAINER, MASS, 0.005), spreader), pushes=(rope,),
                       seconds=15.0), at_rest(14.0))]
    rng = np.random.default_rng(2)
    crates = [FLOOR]
    for row, count in enumerate((4, 3, 2, 1)):
        for place in range(count):
            heading = rng.uniform(0.0, 2.0 * math.pi)
            crates.append(Part(
                name=f'crate {row} {place}', size=(1.0, 1.0, 1.0), mass=500.0,
                position=(1.1 * (place - 0.5 * count) + rng.uniform(-0.02, 0.02),
                          rng.uniform(-0.02, 0.02), 0.53 + 1.04 * row),
                quaternion=quaternion((math.cos(heading), math.sin(heading), 0.0), 0.5)))
    cases.append(RestCase(
        'several', 'pile of ten crates, 4 + 3 + 2 + 1', 'still within 6 s',
        Setup(parts=tuple(crates), seconds=8.0),
        (Gate('corner after 6 s [mm/s]', 1.0, partial(speed, start=6.0)),
         Gate('tilt [°]', 1.0, tilt))))
    return cases


CASES = {case.name: case for case in (
    *drops(), *light_contacts(), *slopes(), *pushes(), *spins(), *topples(), *loads(), *stacks(),
    *several())}
"""By name, which the table has."""
