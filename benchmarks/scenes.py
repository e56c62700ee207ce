# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thousands of boxes: a tick of SceneSolver beside MuJoCo's collision of the same boxes.

A tick takes poses, and gives the contacts of all pairs with model `exact`, patches included. Brick
walls are boxes that all touch their neighbours. The pallets are five real packing plans, copied.
"""
from __future__ import annotations

import json
import resource
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from box_contact_ros import Box, Pair, Scene, SceneSolver, read_scene
from box_contact_ros.extras import require
from box_contact_ros.scene.scene import EVERY_PAIR

from . import output
from .output import markdown_table, number
from .timing import (
    by_round,
    cpu_milliseconds,
    nanoseconds,
    pinned,
    take_turns,
    usable_cores,
)

PACKAGES = ('numpy', 'mujoco')
PLANS = output.ROOT / 'docs' / 'examples' / 'pallets' / 'packing_plans.json'
BRICKS, COPIES, QUICK_BRICKS, QUICK_COPIES = 5120, 27, 640, 2
GROWTH, QUICK_GROWTH = (1_000, 10_000, 100_000), (500, 1_000)
ROUNDS, QUICK_ROUNDS = 40, 4
PRESSED = 1e-4  # of bricks into each other [m]
SHAKE = 1e-5  # standard deviation of places [m] and of quaternions' numbers, from tick to tick
PLACES = 4  # which boxes take in turn
IDENTITY = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Boxes:
    """Boxes of full extents (n, 3) [m] at poses (n, 7); `fixed` (n,) ones never move."""

    size: np.ndarray
    pose: np.ndarray
    fixed: np.ndarray

    def shaken(self, rng: np.random.Generator) -> np.ndarray:
        """Return poses (n, 7) a little elsewhere."""
        moved = self.pose + rng.normal(0.0, SHAKE, self.pose.shape)
        return np.where(self.fixed[:, None], self.pose, moved)


def bricks(count: int) -> Boxes:
    """Return walls of cubes of 1 m, 16 long and 20 high, in running bond: up to six neighbours."""
    wall, layer, column = np.unravel_index(np.arange(count), (-(-count // 320), 20, 16))
    place = np.stack((column + 0.5 * (layer % 2), 1.5 * wall, layer), axis=1) * [
        1.0 - PRESSED, 1.0, 1.0 - PRESSED]
    return Boxes(np.ones((count, 3)), np.hstack((place, np.tile(IDENTITY, (count, 1)))),
                 np.zeros(count, bool))


def packing_plans() -> dict[str, np.ndarray]:
    """Return the plans (n, 7) of five real orders: lowest corner and size [mm], mass [kg]."""
    plans = {}
    for order, plan in json.loads(PLANS.read_text('utf-8')).items():
        rows = []
        for entry in plan:
            item = entry['item']
            length, width, height = (item[f'{name}/mm'] for name in ('length', 'width', 'height'))
            across = (width, length) if entry['orientation'] else (length, width)
            rows.append([*entry['flb_coordinates'], *across, height, item['weight/kg']])
        plans[order] = np.array(rows)
    return plans


def pallets(copies: int) -> Boxes:
    """Return five packing plans, each `copies` times, on one fixed floor, which is the last box."""
    sizes, places = [], []
    for row, plan in enumerate(packing_plans().values()):
        corner, size, _ = np.split(plan, [3, 6], axis=1)
        shifts = [[2000.0 * copy, 2000.0 * row, 0.0] for copy in range(copies)]
        sizes.append(np.repeat(size, copies, axis=0))
        places.append(((corner + 0.5 * size)[:, None] + shifts).reshape(-1, 3))
    size, place = 1e-3 * np.concatenate(sizes), 1e-3 * np.concatenate(places)
    size = np.vstack((size, [4.0 * copies + 4.0, 24.0, 1.0]))
    place = np.vstack((place, [0.0, 0.0, -0.5]))
    fixed = np.zeros(len(size), bool)
    fixed[-1] = True
    return Boxes(size, np.hstack((place, np.tile(IDENTITY, (len(size), 1)))), fixed)


def scene_of(boxes: Boxes, pairs: np.ndarray | None = None) -> Scene:
    """Return the scene of boxes, with these pairs (m, 2) listed; without them, with all pairs.

    Names are in the order of the boxes, so the lower one is box a.
    """
    names = [f'b{row:06}' for row in range(len(boxes.size))]
    named = {name: Box(tuple(size), tuple(pose) if is_fixed else None)
             for name, size, pose, is_fixed in zip(
                 names, boxes.size.tolist(), boxes.pose.tolist(), boxes.fixed)}
    listed = () if pairs is None else tuple(
        Pair.between(names[a], names[b]) for a, b in pairs.tolist())
    return Scene(named, listed, poses='named', patterns=EVERY_PAIR if pairs is None else ())


class MuJoCo:
    """MuJoCo's collision of the same boxes; each that moves is a free body."""

    def __init__(self, boxes: Boxes) -> None:
        import mujoco

        geom = '<geom type="box" size="{} {} {}"'
        parts = []
        for size, pose, is_fixed in zip(0.5 * boxes.size, boxes.pose.tolist(), boxes.fixed):
            shape = geom.format(*size.tolist())
            parts.append(f'{shape} pos="{pose[0]} {pose[1]} {pose[2]}"/>' if is_fixed
                         else f'<body><freejoint/>{shape}/></body>')
        self._model = mujoco.MjModel.from_xml_string(
            f'<mujoco><size memory="1G"/><worldbody>{"".join(parts)}</worldbody></mujoco>')
        self._data = mujoco.MjData(self._model)
        self._place, self._collide = mujoco.mj_kinematics, mujoco.mj_collision
        # Geoms of the world come first.
        self._box_of = np.argsort(~boxes.fixed, kind='stable')

    def place(self, poses: np.ndarray) -> None:
        """Take the poses (m, 7) of the boxes that move."""
        self._data.qpos.reshape(-1, 7)[:] = poses[:, [0, 1, 2, 6, 3, 4, 5]]
        self._place(self._model, self._data)

    def collide(self) -> None:
        """Find all contacts."""
        self._collide(self._model, self._data)

    def pairs(self) -> np.ndarray:
        """Return the pairs (k, 2) of boxes with a contact, the lower first."""
        geoms = np.array(self._data.contact.geom).reshape(-1, 2)
        return np.unique(np.sort(self._box_of[geoms], axis=1), axis=0)


class Compared(NamedTuple):
    """A scene beside MuJoCo: processor times of a tick [ms], and which pairs touch."""

    scene: str
    pairs: str  # how the pairs are asked for
    boxes: int
    touching: int  # pairs in contact, of the last tick
    tick: float
    mujoco: float
    ratio: float  # median of the rounds' own
    only_ours: int
    only_mujoco: int


def compare(name: str, boxes: Boxes, rounds: int) -> list[Compared]:
    """Time ticks with all pairs, and with a list of those that are near, in turn with MuJoCo."""
    rng = np.random.default_rng(1)
    places = [boxes.shaken(rng)[~boxes.fixed] for _ in range(PLACES)]
    solvers = {'all': SceneSolver(scene_of(boxes), model='exact')}
    near = solvers['all'](places[0]).pairs
    solvers['list'] = SceneSolver(scene_of(boxes, near), model='exact')
    engine = MuJoCo(boxes)
    times: dict[str, list[float]] = {asked: [] for asked in (*solvers, 'mujoco')}
    turn = iter(range(10**9))

    def timed(asked: str, work: Callable[[], Any]) -> None:
        times[asked].append(cpu_milliseconds(work)[0])

    def round_of_all() -> None:
        place = places[next(turn) % PLACES]
        engine.place(place)
        timed('mujoco', engine.collide)
        for asked, solver in solvers.items():
            timed(asked, partial(solver, place))

    print(f'scenes: {name}, {len(boxes.size):,} boxes', file=sys.stderr)
    with pinned({usable_cores()[-1]}):
        take_turns([round_of_all], PLACES)
        for kept in times.values():
            kept.clear()
        take_turns([round_of_all], rounds)
    answer = solvers['all'](places[(rounds - 1) % PLACES])
    ours = set(map(tuple, np.sort(answer.pairs, axis=1).tolist()))
    theirs = set(map(tuple, engine.pairs().tolist()))
    return [Compared(name, asked, len(boxes.size), len(ours), *(
        float(np.median(times[one])) for one in (asked, 'mujoco')),
        by_round(times[asked], times['mujoco']), len(ours - theirs), len(theirs - ours))
        for asked in solvers]


class Grown(NamedTuple):
    """Bricks with `pairs: all`, without MuJoCo in the process."""

    boxes: int
    touching: int
    tick: float  # [ms]
    per_box: float  # [ns]
    finding: float  # share of a tick that finds near pairs
    memory: float  # most of the process so far [MiB]
    reading: float  # of the scene file [s]


def grow(counts: Sequence[int], rounds: int) -> list[Grown]:
    """Time ticks and reading for more and more boxes."""
    from tqdm import tqdm

    rows = []
    for count in tqdm(counts, desc='scenes, more and more boxes', unit='scene'):
        boxes = bricks(count)
        with tempfile.TemporaryDirectory() as folder, pinned({usable_cores()[-1]}):
            path = Path(folder, 'scene.yaml')
            path.write_text('poses: named\nboxes:\n' + ''.join(
                f'  b{row}: {{size: [1, 1, 1]}}\n' for row in range(count)) + 'pairs: all\n')
            read, scene = nanoseconds(read_scene, path)
            solver = SceneSolver(scene, model='exact')
            rng = np.random.default_rng(1)
            places = [boxes.shaken(rng) for _ in range(PLACES)]
            movers = solver._at.movers
            times: list[tuple[float, float]] = []
            for turn in range(PLACES + rounds):
                took, answer = cpu_milliseconds(solver, places[turn % PLACES])
                found, _ = cpu_milliseconds(movers.find, places[(turn + 1) % PLACES], sys.maxsize)
                times.append((took, found))
        tick, found = np.median(times[PLACES:], axis=0)
        rows.append(Grown(count, answer.touching, tick, 1e6 * tick / count, found / tick,
                          resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 1e-9 * read))
    return rows


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    parser = output.report_parser(
        'scenes', __doc__, quick='few boxes and rounds, to try it out', out='scenes.md, scenes.csv')
    options = parser.parse_args(args)
    require('report', 'sim')
    folder, machine = output.results_folder(parser, options), output.machine(PACKAGES)
    rounds = QUICK_ROUNDS if options.quick else ROUNDS
    grown = grow(QUICK_GROWTH if options.quick else GROWTH, rounds)  # before MuJoCo takes memory
    compared = [
        *compare('brick walls', bricks(QUICK_BRICKS if options.quick else BRICKS), rounds),
        *compare('pallets', pallets(QUICK_COPIES if options.quick else COPIES), rounds)]
    print(output.write_page(
        folder, 'scenes', args, machine=machine, rounds=rounds, shake=1e6 * SHAKE,
        compared=markdown_table(
            ['scene', 'pairs', 'boxes', 'touching', 'tick [ms]', '`mj_collision` [ms]', 'ratio',
             'only ours', 'only MuJoCo'],
            [[*row[:2], *map('{:,}'.format, row[2:4]), number(row.tick), number(row.mujoco),
              number(row.ratio), row.only_ours, row.only_mujoco]
             for row in compared], words=2),
        grown=markdown_table(
            ['boxes', 'touching', 'tick [ms]', 'per box [ns]', 'finding pairs [%]',
             'memory of the process [MiB]', 'file read in [s]'],
            [[*map('{:,}'.format, row[:2]), number(row.tick), number(row.per_box),
              number(100.0 * row.finding), number(row.memory), number(row.reading)]
             for row in grown], words=0)))
    output.write_csv(folder / 'scenes.csv', [row._asdict() for row in (*compared, *grown)],
                     about=machine)
    return 0


if __name__ == '__main__':
    sys.exit(main())
