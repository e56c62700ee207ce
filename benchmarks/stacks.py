# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What stands by one contact per pair, beside MuJoCo: towers, piles, pallets, a gripper, a yard.

`python -m benchmarks.stacks` runs every scene by `PatchForces`, at several steps, rates and
latencies, and by MuJoCo with contacts of its own. Both begin with the same boxes, and get the same
outside forces. Four scenes run by Box3D, Jolt and Rapier, too (`rivals`). The program prints and
writes stacks.md, .csv and .png, stacks_parts.png, and stacks_rivals.csv and .png. The exit status
is 1 if a scene of ours does not come to rest with answers at each step of 1 ms, and 2 where a rival
is missing. `--record FILE` writes the pairs of all scenes to a file instead, as they were placed
and after they have settled.

Lengths in m, masses in kg, times in s.
"""
from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

from box_contact_ros import ContactSolver
from box_contact_ros.solver.pose import rotation_matrix

from . import output, rivals, settled, stacks_picture
from .engines import add_leave_out, may_miss
from .loops import (
    MUJOCO,
    TIMINGS,
    Boxes,
    Mujoco,
    Scene,
    Timing,
    corner_speeds,
    near_pairs,
    steps,
)
from .pose_sets import Pairs, quaternion_multiply
from .stack_scenes import ORDERS, SCENES, sideways
from .stacks_picture import FALLEN_DEG

LOST_SPEED = 100.0  # a run with a faster corner is over [m/s]
REST_SPEED = 1e-3  # of the fastest corner of a scene at rest [m/s]
JUDGED = 10  # steps from one judgement to the next
PUSHES = (0.15, 0.3)  # on every box of a real pallet [weight]
NEAR_MM, NEAR_DEG = 5.0, 0.5  # a box stays that moves and turns less

# --- judgement ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Outcome:
    """What became of a scene; lengths in mm, angles in degrees."""

    rest: float  # since when all corners are slower than `REST_SPEED` [s]; NaN: never
    end_speed: float  # of the fastest corner at the end [m/s]
    deepest: float  # ever
    moved: float  # the farthest box
    turned: float
    cost: float  # of contacts and forces, a step [µs]
    contacts: float = math.nan  # of this, pairs and their contacts; NaN: MuJoCo does not tell
    hold: float = math.nan  # and handing them over


def run(make: Callable[[], Scene], way: Timing | Mujoco) -> Outcome:
    """Run a scene by ours at a timing, or by MuJoCo."""
    scene = make()
    boxes, start = scene.boxes, scene.boxes.pose.copy()
    solver = ContactSolver()
    rest, deepest = math.nan, 0.0
    for loop in steps(scene, way):
        if loop.tick % JUDGED:
            continue
        speed = corner_speeds(boxes).max()
        if not speed <= REST_SPEED:
            rest = math.nan
        elif math.isnan(rest):
            rest = loop.time
        _, size, pose = boxes.every_box()
        depth = -solver.batch(pose, sizes=size, pairs=near_pairs(boxes, 0.0), patch=False
                              ).separation.min(initial=0.0)
        deepest = max(deepest, depth)
        if not speed < LOST_SPEED:
            break
    moves, angle = moved(boxes, start)
    spent = 1e6 * loop.spent / max(1, loop.tick)
    return Outcome(rest, speed, 1e3 * deepest, moves.max(), angle.max(), spent.sum(), *spent[:-1])


def moved(boxes: Boxes, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far [mm] and by what angle [°] the free boxes (n,) are from poses (m, 7).

    Where box 0 is fixed, both are relative to it, as it may be a carrier.
    """
    free, pose = boxes.mass > 0, boxes.pose
    if not free[0]:
        pose, start = _seen_from_the_first(pose), _seen_from_the_first(start)
    pose, start = pose[free], start[free]
    dots = np.abs((pose[:, 3:] * start[:, 3:]).sum(axis=1))
    return (1e3 * np.linalg.norm(pose[:, :3] - start[:, :3], axis=1),
            np.degrees(2.0 * np.arccos(np.clip(dots, 0.0, 1.0))))


def _seen_from_the_first(pose: np.ndarray) -> np.ndarray:
    """Return poses (n, 7) in the frame of the first."""
    back = pose[0, 3:] * (-1, -1, -1, 1)
    return np.hstack([(pose[:, :3] - pose[0, :3]) @ rotation_matrix(pose[0, 3:]),
                      quaternion_multiply(np.tile(back, (len(pose), 1)), pose[:, 3:])])


def stays(make: Callable[[], Scene], way: Timing | Mujoco) -> np.ndarray:
    """Return which free boxes (n,) of a scene end within `NEAR_MM` and `NEAR_DEG` of the start."""
    scene = make()
    start = scene.boxes.pose.copy()
    for _ in steps(scene, way):
        pass
    moves, angle = moved(scene.boxes, start)
    return (moves < NEAR_MM) & (angle < NEAR_DEG)


QUICK = 5  # `--quick` runs every so-many-th scene
CONVERGED = Timing(0.0001, 10_000.0, 0.0)

# --- recording ------------------------------------------------------------------------------------


def recorded(make: Callable[[], Scene], way: Timing | Mujoco, engine: str) -> settled.Recorded:
    """Return the pairs of a scene whose bounding boxes overlap: at its start, and at its end."""
    scene = make()
    boxes, states = scene.boxes, []
    for loop in steps(scene, way):
        if loop.tick == 0:
            states.append((settled.PLACED, boxes.every_box().pose.copy(), near_pairs(boxes, 0.0)))
    states.append((engine, boxes.every_box().pose, near_pairs(boxes, 0.0)))
    sizes = boxes.every_box().size
    parts = [(pose[pairs], sizes[pairs], [name] * len(pairs)) for name, pose, pairs in states]
    pose, size, engines = (np.concatenate(columns) for columns in zip(*parts))
    return settled.Recorded(Pairs(pose[:, 0], pose[:, 1], size[:, 0], size[:, 1]),
                            np.full(len(engines), scene.name), engines)


def record(file: Path, scenes: Sequence[Callable[[], Scene]]) -> None:
    """Write the pairs of some scenes: as placed, and as ours and MuJoCo settle them."""
    parts = []
    for make in scenes:
        ours = recorded(make, TIMINGS[0], settled.OURS)
        theirs = recorded(make, MUJOCO[0], 'MuJoCo')
        parts += [ours, theirs.rows(theirs.engine != settled.PLACED)]
        print(ours.scene[0], len(ours.scene), flush=True)
    pairs = Pairs(*(np.concatenate(columns) for columns in zip(*(part.pairs for part in parts))))
    scene, engine = (np.concatenate(names) for names in zip(*(part[1:] for part in parts)))
    settled.write(file, settled.Recorded(pairs, scene, engine))


# --- the report -----------------------------------------------------------------------------------


def verdict(outcome: Outcome, best: Outcome) -> str:
    """Return when a scene came to rest [s], the speed of its fastest corner, or that it fell.

    best: with answers at each step of 1 ms, by which boxes of a heap fall as they should.
    """
    if outcome.turned > FALLEN_DEG > best.turned:
        return '**fell**'
    return (f'{outcome.rest:.2f}' if not math.isnan(outcome.rest) else
            f'**{1e3 * outcome.end_speed:.2g} mm/s**')


def pushed(orders: Sequence[str]) -> str:
    """Return a table: boxes of real pallets that stay under pushes, and the verdicts that differ.

    Verdicts differ from those of a converged run of ours (`CONVERGED`).
    """
    rows = []
    for order, share in product(orders, PUSHES):
        make = partial(sideways, order, share)
        truth = stays(make, CONVERGED)
        verdicts = [stays(make, way) for way in (TIMINGS[0], *MUJOCO)]
        rows.append([order, f'{share:g}', f'{len(truth)}', f'{truth.sum()}',
                     *(f'{(each != truth).sum()}' for each in verdicts)])
        print('pushed', *rows[-1], flush=True)
    return output.markdown_table(
        ['order', 'push [weight]', 'boxes', 'stay, 0.1 ms', 'differ, 1 ms',
         *(f'differ, {way}' for way in MUJOCO)], rows)


def main(args: Sequence[str] | None = None) -> int:
    """Run all scenes, print and write; 1 if one of ours moves with answers at each step."""
    parser = output.report_parser(
        'stacks', __doc__,
        out='stacks.md, .csv and .png, stacks_parts.png, stacks_rivals.csv and .png',
        quick=f'every {QUICK}th scene, two beside rivals')
    add_leave_out(parser)
    parser.add_argument('--record', type=Path, metavar='FILE', help='write pairs, and no report')
    options = parser.parse_args(args)
    chosen = SCENES[::QUICK if options.quick else 1]
    if options.record:
        record(options.record, chosen)
        return 0
    folder, ours = output.results_folder(parser, options), str(TIMINGS[0])
    with tempfile.TemporaryDirectory() as made:
        try:
            engines, missing = rivals.engines(Path(made))
            if not (options.quick or may_miss('stacks', missing, options.leave_out)):
                return 2
            beside = rivals.report(engines, missing, Path(made), folder, quick=options.quick)
        except RuntimeError as error:
            print(f'stacks: {error}', file=sys.stderr)
            return 2
    scenes = {scene().name: scene for scene in chosen}
    found: dict[str, dict[str, Outcome]] = {}
    for name, make in scenes.items():
        found[name] = {str(way): run(make, way) for way in (*TIMINGS, *MUJOCO)}
        print(name, {way: verdict(each, found[name][ours])
                     for way, each in found[name].items()}, flush=True)
    rest = output.markdown_table(
        ['scene', *map(str, (*TIMINGS, *MUJOCO))],
        [[name, *(verdict(each, ways[ours]) for each in ways.values())]
         for name, ways in found.items()])
    both = output.markdown_table(
        ['scene', *(f'{title}{by}' for title in ('deepest [mm]', 'moved [mm]', 'µs per step')
                    for by in ('', *(f', {way}'.replace(', 1 ms', '') for way in MUJOCO)))],
        [[name, *(f'{getattr(ways[way], field):.3g}' for field in ('deepest', 'moved', 'cost')
                  for way in (ours, *map(str, MUJOCO)))]
         for name, ways in found.items()])
    about = output.machine(('numpy', 'mujoco'))
    output.write_csv(folder / 'stacks.csv', (
        {'scene': name, 'way': way, **asdict(each)}
        for name, ways in found.items() for way, each in ways.items()), digits=3, about=about)
    stacks_picture.draw(folder / 'stacks.png', folder / 'stacks.csv')
    stacks_picture.draw_parts(folder / 'stacks_parts.png', folder / 'stacks.csv')
    cheaper = [str(sum(ways[str(way)].cost < ways[ours].cost for ways in found.values()))
               for way in MUJOCO]
    output.write_page(folder, 'stacks', args, machine=about, rest=rest, both=both, **beside,
                      scenes=len(found), cheaper=', '.join(cheaper),
                      pushed=pushed(ORDERS[:1] if options.quick else ORDERS))
    missed = [name for name, ways in found.items() if math.isnan(ways[ours].rest)]
    for name in missed:
        print(f'stacks: {name} does not come to rest', file=sys.stderr)
    return int(bool(missed))


if __name__ == '__main__':
    sys.exit(main())
