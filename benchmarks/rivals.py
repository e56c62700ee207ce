# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes that move, rest and sleep, by `PatchForces` and by engines that own their state.

stack_calls/ has a program for each. `make rivals` compiles those of Box3D and Jolt, and `compiled`
ours. Rapier and MuJoCo have wheels. All get the same boxes, one thread and steps of 1/60 s.

Lengths in m, masses in kg, times in s.
"""
from __future__ import annotations

import importlib.util
import math
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros.forces.patch_forces import FRICTION, GRAVITY

from . import native_calls, output, rivals_picture
from .engines import DYNAMICS
from .loops import FRAME, Boxes, Scene
from .output import ROOT, markdown_table, number
from .pose_sets import turned

SUBSTEPS = 4
CALLS_FOLDER = Path(__file__).with_name('stack_calls')
MADE = ROOT / 'build' / 'rivals'
"""Where `make rivals` puts its programs."""
OURS, ANY_DEPTH = 'PatchForces', 'PatchForces, any depth'
MOST_DEPTH = {OURS: 1e-3, ANY_DEPTH: 1e3}
"""Of `PatchForces` [m]. Beyond the first, which is the default, it makes further sub-steps."""
SECOND = round(1.0 / FRAME)  # steps
RESTED, LONG = 10 * SECOND, 70 * SECOND
"""When a scene is to be at rest, and when creep is judged: 60 s later."""
LAST = 2 * SECOND  # so many steps are timed at rest
ASLEEP = 20 * SECOND
ROUNDS = 3
LIMIT, QUICK_LIMIT = 120, 15
"""Of a run, by the processor's time [s]; what it has not reached by then is not known."""

# --- scenes ---------------------------------------------------------------------------------------

TWENTY_FOOT = (6.058, 2.438, 2.591)


def _on_floor(name: str, rows: Sequence[tuple]) -> Scene:
    """Return a scene of rows as `Boxes.of` takes them, on a floor 10 m larger to each side."""
    places = np.array([row[2] for row in rows])
    low, high = places.min(axis=0), places.max(axis=0)
    x, y = 0.5 * (low + high)[:2]
    wide, deep = (high - low)[:2] + 20.0
    return Scene(name, Boxes.of([((wide, deep, 1.0), 0.0, (x, y, -0.5)), *rows]))


def containers() -> Scene:
    """Return a stack of ten."""
    return _on_floor('10 containers', [
        (TWENTY_FOOT, 24_000.0, (0, 0, TWENTY_FOOT[2] * (k + 0.5))) for k in range(10)])


def wall() -> Scene:
    """Return bricks with gaps between them, in rows of ten and nine in turn."""
    return _on_floor('wall of 95', [
        ((0.4, 0.2, 0.2), 30.0, (0.41 * k + 0.2 * (row % 2), 0, 0.2 * row + 0.1))
        for row in range(10) for k in range(10 - row % 2)])


def pile(count: int = 1000) -> Scene:
    """Return boxes of random sizes in layers of 64, which fall between four walls."""
    rng, rows = np.random.default_rng(1), []
    for side in (-4.0, 4.0):
        rows += [((1.0, 10.0, 6.0), 0.0, (side, 0, 2)), ((7.0, 1.0, 6.0), 0.0, (0, side, 2))]
    for k in range(count):
        layer, place = divmod(k, 64)
        x, y = 0.85 * np.array(divmod(place, 8)) - 3.0 + rng.uniform(0.0, 0.1, 2)
        rows.append((rng.uniform(0.3, (0.6, 0.6, 0.5)), rng.uniform(10.0, 30.0),
                     (x, y, 0.5 + 0.7 * layer), turned((0, 0, 1), rng.uniform(0.0, 3.0))))
    return _on_floor(f'pile of {count:,}', rows)


def yard(count: int = 5000) -> Scene:
    """Return containers of 10 to 24 t in stacks of five."""
    rng, side = np.random.default_rng(1), math.ceil(math.sqrt(count / 5))
    return _on_floor(f'yard of {count:,}', [
        (TWENTY_FOOT, rng.uniform(10e3, 24e3),
         (6.5 * (k // 5 % side), 2.8 * (k // 5 // side), TWENTY_FOOT[2] * (k % 5 + 0.5)))
        for k in range(count)])


def yard_and_a_load(count: int = 5000) -> Scene:
    """Return that yard, and a container 2.5 km above it that falls all the time."""
    scene = yard(count)
    return _on_floor(f'{scene.name}, one falls', [
        *zip(scene.boxes.size[1:], scene.boxes.mass[1:], scene.boxes.pose[1:, :3]),
        (TWENTY_FOOT, 24_000.0, (0, 0, 2500.0))])


SCENES: tuple[Callable[[], Scene], ...] = (wall, containers, pile, yard, yard_and_a_load)
MOVES = {pile: 3 * SECOND}
"""For how many steps a scene is said to move, if not for one second."""
NEVER_SLEEP = {yard_and_a_load: 1}
"""How many bodies of a scene are always awake, if not none: it is timed while the others sleep."""
QUICK = 2  # so many scenes, in one round

# --- engines --------------------------------------------------------------------------------------


class Engine(NamedTuple):
    """A program of stack_calls/, and what it is."""

    command: Sequence[str | Path]
    source: str  # where it comes from, or its version
    precision: str = 'float32'


def compiled(folder: Path) -> Path:
    """Compile ours into a folder, with a copy of the library beside it; return the program.

    Raises `RuntimeError` with what the compiler reports.
    """
    program = folder / 'ours'
    native_calls.run_compiler('-O2', CALLS_FOLDER / 'ours.cpp', '-o', program,
                              *native_calls.library_beside(folder))
    return program


def engines(folder: Path) -> tuple[dict[str, Engine], list[str]]:
    """Return all engines that are here, ours first, and a line about each that is not."""
    ours = compiled(folder)
    found = {name: Engine([ours, f'{depth:g}'], 'this checkout', 'float64')
             for name, depth in MOST_DEPTH.items()}
    missing = []
    for name, title in (('box3d', 'Box3D'), ('jolt', 'Jolt')):
        program = MADE / f'{name}_steps'
        if program.exists():
            source = subprocess.run([program], capture_output=True, text=True, check=True).stdout
            found[title] = Engine([program], source.strip())
        else:
            missing.append(f'{name} is not here ({DYNAMICS[name]})')
    for name, module, title, precision in (('rapier', 'rapier3d', 'Rapier', 'float32'),
                                           ('mujoco', 'mujoco', 'MuJoCo', 'float64')):
        if importlib.util.find_spec(module):
            found[title] = Engine([sys.executable, '-m', f'benchmarks.stack_calls.{name}_steps'],
                                  f'{module} {metadata.version(module)}', precision)
        else:
            missing.append(f'{name} is not installed ({DYNAMICS[name]})')
    return found, missing


# --- measurement ----------------------------------------------------------------------------------


class Stop(NamedTuple):
    """What a program prints after some steps."""

    seconds: float  # that the processor took since the last stop
    awake: int  # bodies
    pose: np.ndarray  # (n, 7)


def run(engine: Engine, file: Path, sleep: bool, stops: Sequence[int],
        limit: float = LIMIT) -> list[Stop]:
    """Return what an engine prints at each stop that it reaches within a processor's time [s].

    Raises `RuntimeError` with what it says where it fails.
    """
    words = [*map(str, engine.command), str(file), str(int(sleep)), str(limit), *map(str, stops)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT)
    if done.returncode:
        raise RuntimeError(f'{words[0]} ended with status {done.returncode}: {done.stderr}')
    lines, count = done.stdout.split('\n')[:-1], len(file.read_text('utf-8').splitlines())
    found = []
    for k in range(len(lines) // count):
        seconds, awake = lines[k * count].split()
        found.append(Stop(float(seconds), int(awake),
                          np.loadtxt(lines[k * count + 1:(k + 1) * count], ndmin=2)))
    return found


def write_scene(file: Path, boxes: Boxes) -> None:
    """Write boxes as stack_calls/steps.hpp reads them."""
    with file.open('w', encoding='utf-8') as out:
        print(FRAME, SUBSTEPS, FRICTION, GRAVITY, file=out)
        np.savetxt(out, np.hstack([boxes.size, boxes.mass[:, None], boxes.pose]), fmt='%.17g')


@dataclass(frozen=True)
class Measured:
    """An engine on a scene; NaN is what it did not reach."""

    moving: float  # a step [µs]
    awake: float  # a step at rest, where nothing may sleep [µs]
    asleep: float  # a step [µs]; NaN: after 18 s more is awake than `NEVER_SLEEP`
    sank: float  # the highest box in 10 s, as far as it came down [mm]
    creep: float  # the farthest way of a box in the 60 s after these, awake [mm]


def measure(make: Callable[[], Scene], by_name: Mapping[str, Engine], folder: Path, rounds: int,
            limit: float = LIMIT) -> dict[str, Measured]:
    """Return what all engines do on a scene; they take turns, and times are medians of rounds."""
    boxes, moves, file = make().boxes, MOVES.get(make, SECOND), folder / 'scene'
    write_scene(file, boxes)
    stops = [moves, RESTED - LAST, RESTED]
    times: dict[str, list[tuple[float, ...]]] = {name: [] for name in by_name}
    ways = {}
    for k in range(rounds):
        for name, engine in by_name.items():
            awake = [] if make in NEVER_SLEEP else run(
                engine, file, False, stops if k else [*stops, LONG], limit)
            asleep = run(engine, file, True, [ASLEEP - LAST, ASLEEP], limit
                         ) if make in NEVER_SLEEP or len(awake) > 2 else []
            times[name].append((
                _microseconds(awake, 0, moves), _microseconds(awake, 2, LAST),
                math.nan if any(stop.awake > NEVER_SLEEP.get(make, 0) for stop in asleep) else
                _microseconds(asleep, 1, LAST)))
            if not k:
                ways[name] = _ways(boxes, awake)
    return {name: Measured(*np.median(each, axis=0).tolist(), *ways[name])
            for name, each in times.items()}


def _microseconds(stops: Sequence[Stop], place: int, steps: int) -> float:
    return 1e6 * stops[place].seconds / steps if place < len(stops) else math.nan


def _ways(boxes: Boxes, stops: Sequence[Stop]) -> tuple[float, float]:
    """Return how far the highest box sank until `RESTED`, and the creep after it [mm]."""
    free, places = boxes.mass > 0, [boxes.pose[:, :3], *(stop.pose[:, :3] for stop in stops)]
    top = int(np.argmax(np.where(free, boxes.pose[:, 2], -np.inf)))
    sank = places[0][top, 2] - places[3][top, 2] if len(places) > 3 else math.nan
    creep = (np.linalg.norm(places[4] - places[3], axis=1)[free].max() if len(places) > 4 else
             math.nan)
    return 1e3 * float(sank), 1e3 * float(creep)


# --- the report -----------------------------------------------------------------------------------

Found = Mapping[str, Mapping[str, Measured]]
"""By scene and engine."""


def report(by_name: Mapping[str, Engine], missing: Sequence[str], made: Path, folder: Path, *,
           quick: bool) -> dict[str, str]:
    """Measure all, write stacks_rivals.csv and .png to a folder; return the parts of the page.

    made: the folder of `engines`.
    """
    found, scenes = {}, SCENES[:QUICK] if quick else SCENES
    for make in scenes:
        name = make().name
        found[name] = measure(make, by_name, made, *((1, QUICK_LIMIT) if quick else (ROUNDS,)))
        print(name, {engine: f'{one.awake:.3g} µs' for engine, one in found[name].items()},
              flush=True)
    output.write_csv(folder / 'stacks_rivals.csv', csv_rows(found, by_name), digits=3,
                     about=output.machine(()))
    rivals_picture.draw(folder / 'stacks_rivals.png', folder / 'stacks_rivals.csv')
    return {'engines': _engines_table(by_name), 'times': _table(found, rivals_picture.STATES),
            'ways': _table({name: found[name] for make in scenes if make not in NEVER_SLEEP
                            for name in [make().name]}, ('sank', 'creep')),
            'box3d': _where_box3d_wins(found),
            'missing': ''.join(f'\n\nLeft out: {line}.' for line in missing)}


def _where_box3d_wins(found: Found) -> str:
    """Return what Box3D takes of the time of PatchForces in a pile and a yard, in words."""
    shares = [getattr(found[scene]['Box3D'], state) / getattr(found[scene]['PatchForces'], state)
              for scene, state in (('pile of 1,000', 'moving'), ('pile of 1,000', 'awake'),
                                   ('yard of 5,000', 'moving'))
              if 'Box3D' in found.get(scene, ())]
    return '' if len(shares) < 3 else (
        'Box3D takes {:.2g} of the time of PatchForces where a pile of a thousand falls, {:.2g} '
        'where it lies awake, and {:.2g} in the first second of a yard. '.format(*shares))


def _table(found: Found, fields: Sequence[str]) -> str:
    """Return a row per scene, with all fields of each engine."""
    names = list(next(iter(found.values())))
    return markdown_table(['scene', *names], [
        [scene, *(' / '.join(number(getattr(by_name[name], field)) for field in fields)
                  for name in names)] for scene, by_name in found.items()])


def _engines_table(by_name: Mapping[str, Engine]) -> str:
    """Return a row per engine: its numbers, and where it comes from."""
    return markdown_table(['engine', 'numbers', 'from'], [
        [name, engine.precision, engine.source] for name, engine in by_name.items()], words=3)


def csv_rows(found: Found, by_name: Mapping[str, Engine]) -> Iterator[dict[str, object]]:
    """Yield a row per scene and engine."""
    for scene, measured in found.items():
        for name, one in measured.items():
            yield {'scene': scene, 'engine': name, **asdict(one),
                   'numbers': by_name[name].precision, 'from': by_name[name].source}
