# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the forces end: a figure for each hard case, beside the line that it must not cross.

`python -m benchmarks.force_lines` runs the cases of eleven subjects by `PatchForces` with contacts
of its own: uneven steps, heavy bodies on light ones, impacts, carriers, gaps of a nanometre, a wide
floor, loads of feet, tipping, friction off the centre, a rope, and thin plates. It prints and
writes force_lines.md, which also lists the tuned numbers of the forces, and force_lines.csv. The
lines of impacts, feet, tipping, friction and the rope come from theory; the other ones say what a
user may expect. The exit status is 1 if a figure is beyond its line. `--only SUBJECT` runs some of
the subjects.
"""
from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from box_contact_ros.forces.patch_forces import FRICTION, GRAVITY

from . import output
from .loops import FLOOR, FRAME, Boxes, Ours, Scene, Timing, corner_speeds, steps
from .stack_scenes import (
    FEET,
    braking_lorry,
    flush_pallet,
    full_on_empty,
    gaps,
    ratio,
    table,
    timbers,
    twin_spreader,
    wide_floor,
)
from .stacks import REST_SPEED

MINUTE, QUICK_MINUTE = 61.0, 6.0  # how long the pallet of uneven steps stands [s]
MILLISECOND = Timing.uneven((0.001,))
FRAMES = {'1 ms': MILLISECOND, '1/120 s': Timing.uneven((0.5 * FRAME,)),
          '1/60 s': Timing.uneven((FRAME,))}
"""Timings by name, with contacts of their own at each step."""


@dataclass(frozen=True, kw_only=True)
class Line:
    """A figure of a case, and the line: how large it may be."""

    subject: str
    case: str
    what: str
    """What the figure is, with its unit."""
    figure: float
    line: float

    @property
    def is_met(self) -> bool:
        """Return whether the figure is a number, and not beyond the line."""
        return self.figure <= self.line


def runs(scene: Scene, timing: Timing, **options: int) -> Iterator[Ours]:
    """Yield the loop of a scene after each step."""
    for loop in steps(scene, timing, **options):
        assert isinstance(loop, Ours)
        if loop.tick:
            yield loop


# --- uneven steps ---------------------------------------------------------------------------------

def patterns() -> dict[str, tuple[tuple[float, ...], float]]:
    """Return lengths of steps [s] by name, each with the line of creep [mm]."""
    rng = np.random.default_rng(4)
    return {
        'equal 1 ms': ((0.001,), 0.05),
        '1 to 4 ms at random': (tuple(rng.uniform(0.001, 0.004, 1000)), 0.05),
        '3, 3, 3, 7.67 ms': ((0.003,) * 3 + (FRAME - 0.009,), 0.05),
        '3, 3, 3, 3, 4.67 ms': ((0.003,) * 4 + (FRAME - 0.012,), 0.05),
        'six of 1 ms, one of 10 ms': ((0.001,) * 6 + (0.01,), 0.05),
        '1 µs to 20 ms at random': (
            tuple(np.exp(rng.uniform(math.log(1e-6), math.log(0.02), 1000))), 0.3)}


def uneven_steps(*, quick: bool) -> Iterator[Line]:
    """Yield how a flush pallet stands for a minute."""
    seconds = QUICK_MINUTE if quick else MINUTE
    for name, (lengths, line) in patterns().items():
        scene = flush_pallet()
        scene.seconds, start, fastest = seconds, None, 0.0
        for loop in runs(scene, Timing.uneven(lengths)):
            if start is None and loop.time >= 1.0:
                start = loop.boxes.pose[:, :3].copy()
            if loop.time >= seconds - 1.0:
                fastest = max(fastest, corner_speeds(loop.boxes).max())
        assert start is not None
        creep = np.linalg.norm(scene.boxes.pose[:, :3] - start, axis=1).max()
        yield Line(subject='uneven steps', case=name, what='creep after 1 s [mm]',
                   figure=1e3 * creep, line=line)
        yield Line(subject='uneven steps', case=name, what='fastest of the last second [mm/s]',
                   figure=1e3 * fastest, line=0.1)


# --- heavy on light -------------------------------------------------------------------------------

def sunk(scene: Scene, timing: Timing, settled: float = 0.0) -> tuple[float, float]:
    """Return how far the lowest box sank in the end [m], and since when all is slow [s].

    settled: the way that a scene falls before it touches [m].
    """
    high, rest = scene.boxes.pose[:, 2].copy(), math.nan
    for loop in runs(scene, timing):
        if not corner_speeds(loop.boxes).max() <= REST_SPEED:
            rest = math.nan
        elif math.isnan(rest):
            rest = loop.time
    return float((high - scene.boxes.pose[:, 2]).max()) - settled, rest


def heavy_on_light(*, quick: bool) -> Iterator[Line]:
    """Yield how deep boxes sink at 1/60 s, containers on timbers among them."""
    cases = [(partial(ratio, 3_000.0), 0.0, 1.0), (partial(ratio, 10_000.0), 0.0, 1.0),
             (timbers, 0.0, 0.5), (partial(timbers, drop=0.1), 0.1, 0.5),
             (partial(timbers, 5, 2), 0.0, 1.5), (flush_pallet, 0.0, 1.5)]
    for make, settled, line in cases:
        scene = make()
        depth, rest = sunk(scene, FRAMES['1/60 s'], settled)
        yield Line(subject='heavy on light', case=scene.name, what='sinks [mm]',
                   figure=1e3 * depth, line=line)
        if scene.name.startswith('heavy'):
            yield Line(subject='heavy on light', case=scene.name, what='rests after [s]',
                       figure=rest, line=0.5)


def plates(count: int = 60, thick: float = 0.005) -> Scene:
    """Return flush plates on each other, of 37 kg each."""
    return Scene(f'{count} plates of {1e3 * thick:g} mm', Boxes.of([FLOOR, *(
        ((1.2, 0.8, thick), 37.0, (0, 0, thick * (k + 0.5))) for k in range(count))]), 2.0)


def thin_plates(*, quick: bool) -> Iterator[Line]:
    """Yield how far thin plates sink into each other at 1/60 s."""
    depth, rest = sunk(plates(), FRAMES['1/60 s'])
    yield Line(subject='thin', case=plates().name, what='sinks [mm]', figure=1e3 * depth, line=10.0)
    yield Line(subject='thin', case=plates().name, what='rests after [s]', figure=rest, line=1.5)


# --- impacts --------------------------------------------------------------------------------------

def cubes_meet(heavier: float, speed: float) -> Scene:
    """Return a cube of a mass [kg] that meets one of 1 kg on the floor at a speed [m/s]."""
    boxes = Boxes.of([FLOOR, ((1.0,) * 3, 1.0, (0, 0, 0.5)),
                      ((1.0,) * 3, heavier, (0, 0, 1.5 + 1e-6))])
    boxes.velocity[2, 2] = -speed
    return Scene(f'cubes 1:{heavier:g}, {speed:g} m/s', boxes, 0.5)


def impacts(*, quick: bool) -> Iterator[Line]:
    """Yield how impacts bounce, and what energy they gain."""
    for scene in (*(cubes_meet(heavier, 0.5) for heavier in (1.0, 2.0, 10.0, 100.0)),
                  full_on_empty(0.5)):
        speed, scene.seconds = -scene.boxes.velocity[2, 2], 0.5
        up = max(loop.boxes.velocity[2, 2] for loop in runs(scene, MILLISECOND))
        yield Line(subject='impact', case=scene.name, what='speed up / speed down',
                   figure=max(0.0, up / speed), line=0.05)
    scene = cubes_meet(100.0, 0.1)
    first = energy(scene.boxes)
    most = max(energy(loop.boxes) for loop in runs(scene, MILLISECOND, substeps=64))
    kinetic = 0.5 * 100.0 * 0.1**2
    yield Line(subject='impact', case=f'{scene.name}, 64 sub-steps',
               what='energy gained [%]', figure=100.0 * (most - first) / kinetic, line=1e-6)


def energy(boxes: Boxes) -> float:
    """Return the energy of boxes that do not turn: of motion, and of height [J]."""
    return float(boxes.mass @ (0.5 * (boxes.velocity[:, :3]**2).sum(axis=1)
                               + GRAVITY * boxes.pose[:, 2]))


# --- carriers, gaps and floors --------------------------------------------------------------------

def carriers(*, quick: bool) -> Iterator[Line]:
    """Yield how far cargo slides on a lorry that brakes by less than friction holds."""
    for name, line in (('1 ms', 0.01), ('1/60 s', 0.8)):
        scene = braking_lorry()
        scene.seconds = 2.0
        start = scene.boxes.pose[1:, 0] - scene.boxes.pose[0, 0]
        for _ in runs(scene, FRAMES[name]):
            pass
        slid = scene.boxes.pose[1:, 0] - scene.boxes.pose[0, 0] - start
        yield Line(subject='carrier', case=f'{scene.name}, {name}', what='slides in 2 s [mm]',
                   figure=1e3 * float(np.abs(slid).max()), line=line)


def gaps_of_a_nanometre(*, quick: bool) -> Iterator[Line]:
    """Yield how far the top of a tower with gaps falls."""
    for name in ('1 ms', '1/60 s'):
        scene = gaps()
        scene.seconds, high = 2.0, scene.boxes.pose[-1, 2]
        low = min(loop.boxes.pose[-1, 2] for loop in runs(scene, FRAMES[name]))
        yield Line(subject='gaps', case=f'{scene.name}, {name}', what='top falls by [mm]',
                   figure=1e3 * float(high - low), line=40.0)


def wide_floors(*, quick: bool) -> Iterator[Line]:
    """Yield how a cube on a floor of 1 km hops and creeps."""
    scene = wide_floor()
    fastest = max(abs(float(loop.boxes.velocity[1, 2])) for loop in runs(scene, MILLISECOND)
                  if loop.time > 1.0)
    yield Line(subject='wide floor', case=scene.name, what='hops at [mm/s]', figure=1e3 * fastest,
               line=1e-3)
    scene, start = wide_floor(1.0 / 3.0), np.zeros(3)
    for loop in runs(scene, MILLISECOND):
        if loop.time <= 1.0:
            start = loop.boxes.pose[1, :3].copy()
    way = float(np.linalg.norm(scene.boxes.pose[1, :3] - start))
    yield Line(subject='wide floor', case=scene.name, what='creeps at [µm/s]',
               figure=1e6 * way / (scene.seconds - 1.0), line=0.1)


# --- feet -----------------------------------------------------------------------------------------

def shares(scene: Scene, timing: Timing) -> np.ndarray:
    """Return the share of its weight that each foot of body 1 bears in the end."""
    *_, loop = runs(scene, timing)
    loads = loop.forces.loads()
    found = np.zeros(len(scene.boxes.every_box().body))
    found[loads.pairs[:, 1]] = loads.pressing / (GRAVITY * scene.boxes.mass[1])
    return found[len(scene.boxes.mass):]


def feet(*, quick: bool) -> Iterator[Line]:
    """Yield how far loads of three feet are from statics, and how those of eight differ by step."""
    statics = np.linalg.solve(np.vstack([np.ones(3), np.transpose(FEET)]),
                              [1.0, *table().boxes.centre[1, :2]])
    for name, timing in FRAMES.items():
        found = shares(table(), timing)
        yield Line(subject='feet', case=f'three, {name}', what='load of a foot off [%]',
                   figure=100.0 * float(np.abs(found / statics - 1.0).max()), line=3.0)
    each = np.array([shares(twin_spreader(), timing) for timing in FRAMES.values()])
    yield Line(subject='feet', case='twin spreader', what='loads differ by step [%]',
               figure=100.0 * float(np.ptp(each, axis=0).max() / each.mean()), line=1.0)


# --- tipping --------------------------------------------------------------------------------------

def tips(share: float) -> bool:
    """Return whether a box of 1 × 1 × 2 m tips that is pushed at 1.5 m.

    share: of the force by which it tips, a third of its weight.
    """
    mass, push = 100.0, np.zeros((2, 6))
    force = share * mass * GRAVITY / 3.0
    push[1, 0], push[1, 4] = force, 0.5 * force
    scene = Scene('pushed', Boxes.of([FLOOR, ((1.0, 1.0, 2.0), mass, (0, 0, 1))]), 4.0,
                  act=lambda *_: push)
    return any(loop.boxes.pose[1, 2] > 1.02 for loop in runs(scene, MILLISECOND))


def tipping(*, quick: bool) -> Iterator[Line]:
    """Yield the force that tips a box, and when one falls that stands beyond an edge."""
    stands, falls = 0.9, 1.3
    for _ in range(4 if quick else 7):
        middle = 0.5 * (stands + falls)
        stands, falls = (stands, middle) if tips(middle) else (middle, falls)
    yield Line(subject='tipping', case='1 × 1 × 2 m, pushed at 1.5 m',
               what='force that tips / that of theory', figure=falls, line=1.02)
    cube = Scene('cube 20 mm beyond an edge', Boxes.of([
        ((4.0, 4.0, 1.0), 0.0, (0, 0, -0.5)), ((1.0,) * 3, 50.0, (2.02, 0, 0.5))]), 3.0)
    tipped = next((loop.time for loop in runs(cube, MILLISECOND) if loop.boxes.pose[1, 2] < 0.3),
                  math.inf)
    yield Line(subject='tipping', case=cube.name, what='falls within [s]', figure=tipped, line=3.0)


# --- friction -------------------------------------------------------------------------------------

def pushed(name: str, aside: float, degrees: float) -> Scene:
    """Return a plate of 1 t that lands and is pushed by 0.99 of what friction holds after 1 s.

    Its mass is aside [m], and it falls 2 mm where it is tilted.
    """
    mass, tilt = 1000.0, math.radians(degrees)
    push = np.zeros((2, 6))
    push[1, 0] = 0.99 * FRICTION * mass * GRAVITY
    height = 0.2 + math.sin(tilt) + (0.002 if tilt else 0.0)
    return Scene(name, Boxes.of([
        ((200.0, 50.0, 1.0), 0.0, (0, 0, -0.5)),
        ((2.0, 2.0, 0.4), mass, (0, 0, height), (math.sin(0.5 * tilt), 0, 0, math.cos(0.5 * tilt)),
         (0.0, aside, -0.19))]), 2.5, act=lambda t, *_: push * (t > 1.0))


def friction(*, quick: bool) -> Iterator[Line]:
    """Yield how far a plate slides below Coulomb's limit, and how far one turns that is thrown."""
    for name in ('1 ms', '1/60 s'):
        for case, aside, degrees in (('mass 0.8 m aside', 0.8, 0.0), ('landed tilted', 0.0, 0.1)):
            scene, start = pushed(case, aside, degrees), np.zeros(3)
            for loop in runs(scene, FRAMES[name]):
                if loop.time <= 1.0:
                    start = loop.boxes.pose[1, :3].copy()
            way = float(np.linalg.norm(scene.boxes.pose[1, :3] - start))
            yield Line(subject='friction', case=f'{case}, {name}', what='slides [mm]',
                       figure=1e3 * way, line=2.0)
        scene = pushed('thrown', 0.8, 0.0)
        scene.seconds, scene.boxes.velocity[1, 0] = 1.0, 3.0
        for _ in runs(scene, FRAMES[name]):
            pass
        turned = 2.0 * math.degrees(abs(math.asin(scene.boxes.pose[1, 5])))
        yield Line(subject='friction', case=f'mass 0.8 m aside, 3 m/s, {name}', what='turns by [°]',
                   figure=turned, line=1.0)


# --- ropes ----------------------------------------------------------------------------------------

def load_on_rope(degrees: float = 5.0, length: float = 20.0) -> Scene:
    """Return a load of 18 t that swings on a rope of 3 MN/m, damped along itself."""
    mass, stiffness, angle = 18e3, 3e6, math.radians(degrees)
    damping, slack = 0.6 * math.sqrt(stiffness * mass), length - mass * GRAVITY / stiffness

    def act(t: float, boxes: Boxes, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        far, pull = np.linalg.norm(pose[0, :3]), np.zeros((1, 6))
        up = -pose[0, :3] / far
        pull[0, :3] = (stiffness * (far - slack) - damping * (velocity[0, :3] @ up)) * up
        return pull

    at = length * math.sin(angle), 0, -length * math.cos(angle)
    return Scene('18 t on 20 m', Boxes.of([((6.0, 2.4, 2.6), mass, at)]), 600.0, act=act)


def ropes(*, quick: bool) -> Iterator[Line]:
    """Yield how the angle changes by which a load swings, in ten minutes."""
    for name in ('1/60 s', '1/120 s'):
        scene, widest = load_on_rope(), 0.0
        scene.seconds = 60.0 if quick else 600.0
        for loop in runs(scene, FRAMES[name]):
            if loop.time > scene.seconds - 10.0:
                widest = max(widest, abs(loop.boxes.pose[0, 0]))
        yield Line(subject='rope', case=f'{scene.name}, {name}', what='angle changes by [%]',
                   figure=100.0 * abs(math.degrees(math.asin(widest / 20.0)) / 5.0 - 1.0), line=1.0)


# --- the numbers of the method --------------------------------------------------------------------

TUNING = output.ROOT / 'box_contact_ros/core/src/force/tuning.hpp'


class Number(NamedTuple):
    """Tuned numbers that share a comment."""

    subject: str
    names: str
    values: str
    meaning: str


def tuned_numbers(text: str) -> list[Number]:
    """Return the constants of a header, each with its subject and the comment above it."""
    found: list[Number] = []
    subject = comment = ''
    for line in text.splitlines():
        if heading := re.fullmatch('// --- (.*) ---', line):
            subject, comment = heading[1], ''
        elif line.startswith('//'):
            comment = f'{comment} {line[2:].strip()}'.strip()
        elif line.startswith('constexpr '):
            pairs = re.findall(r'(\w+) = ([-\w.+]+)', line)
            names, values = (', '.join(parts) for parts in zip(*pairs))
            if not comment:  # that of the line above holds for both
                above = found.pop()
                names, values = f'{above.names}, {names}', f'{above.values}, {values}'
                comment = above.meaning
            found.append(Number(subject, names, values, comment))
            comment = ''
        else:
            comment = ''
    return found


# --- the report -----------------------------------------------------------------------------------

SUBJECTS: dict[str, Callable[..., Iterator[Line]]] = {
    'uneven': uneven_steps, 'heavy': heavy_on_light, 'impact': impacts, 'carrier': carriers,
    'gaps': gaps_of_a_nanometre, 'floor': wide_floors, 'feet': feet, 'tipping': tipping,
    'friction': friction, 'rope': ropes, 'thin': thin_plates}
"""Cases by the name that `--only` takes."""


def main(args: Sequence[str] | None = None) -> int:
    """Run the cases, print and write; 1 if a figure is beyond its line."""
    parser = output.report_parser('force_lines', __doc__, out='force_lines.md, .csv',
                                  quick=f'{QUICK_MINUTE:g} s instead of a minute')
    parser.add_argument('--only', nargs='+', choices=SUBJECTS, default=list(SUBJECTS),
                        metavar='SUBJECT', help=f'of {", ".join(SUBJECTS)} (default: all)')
    options = parser.parse_args(args)
    folder, found = output.results_folder(parser, options), []
    for name in options.only:
        for line in SUBJECTS[name](quick=options.quick):
            print(f'{line.subject}, {line.case}: {line.what} {line.figure:.3g}', flush=True)
            found.append(line)
    missed = sum(not line.is_met for line in found)
    numbers = tuned_numbers(TUNING.read_text('utf-8'))
    print(output.write_page(
        folder, 'force_lines', args, machine=output.machine(), missed=missed, count=len(found),
        lines=output.markdown_table(
            ['subject', 'case', 'figure of', 'found', 'line', ''],
            [[line.subject, line.case, line.what, f'{line.figure:.3g}', f'{line.line:g}',
              '' if line.is_met else '**beyond**'] for line in found], words=3),
        numbers=output.markdown_table(['', 'name', 'value', ''], [
            [number.subject, number.names, number.values, number.meaning] for number in numbers],
            words=4)))
    output.write_csv(folder / 'force_lines.csv', [
        {'subject': line.subject, 'case': line.case, 'figure_of': line.what,
         'found': line.figure, 'line': line.line} for line in found], digits=3,
        about=output.machine())
    print(f'\n{missed} of {len(found)} figures beyond their lines')
    return int(missed > 0)


if __name__ == '__main__':
    sys.exit(main())
