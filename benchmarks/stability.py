# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What each model, and other engines, make of the families of hard poses.

`python -m benchmarks.stability` asks all for every stored case, and writes stability.md and
stability.csv: wrong verdicts and normals, the worst error of depth, point, volume and covariance.
The truth is stored, in 60 digits. The exit status is 1 if `exact` or `mlp` has a fault; points of
`mlp` outside the boxes are known of needles.
"""
from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from box_contact_ros.extras import require
from box_contact_ros.solver.contact import Contacts

from . import output
from .contestant import Contestant, add_models, chosen, ours, packages_of
from .engines import add_leave_out, installed, may_miss
from .errors import point_errors
from .hard_poses import Cases, load
from .judge import INSIDE, NOT_FINITE, NOT_UNIT, OUTSIDE, judge
from .pose_sets import Pairs

GATED = ('exact', 'mlp')  # models that must have no faults
OF_A_CENTROID = ('outside', 'point_worst')
"""What is not judged of engines: they answer by the deepest point, or one halfway between surfaces,
which is outside of both boxes where these go through each other."""
KNOWN = ('mlp', 'e5_needles', 'outside')
"""A fault that breaks no gate: points of `mlp` are within bounds of the overlap alone."""
MODELS = (*GATED, 'soup-8')
ENGINES = ('python-fcl collide', 'MuJoCo mj_collision', 'Coal ComputeCollision',
           'PyBullet getContactPoints', 'Drake point pair')
"""One way of each engine, with boxes of its own."""
TOLERANT = 1e-6
"""What an engine may be off before its verdict, direction or point counts as wrong, of the size."""
QUICK = 10  # `--quick` asks every so-many-th family
FAULTS = ('verdicts', 'normals', 'outside', 'not_finite')
COUNTED = {'cases': 'cases', 'contacts': 'contacts', 'verdicts': 'wrong verdicts',
           'normals': 'wrong normals', 'outside': 'points outside', 'not_finite': 'NaN'}
"""Columns of counts: what a table calls them."""
ERRORS = ('depth', 'point_worst', 'volume', 'covariance')


@dataclass(frozen=True)
class StabilityRow:
    """A model on a family. Depths and points where it agrees that the boxes touch."""

    model: str
    family: str
    cases: int
    contacts: int
    verdicts: int  # wrong ones, where the gap or depth is more than rounding
    normals: int
    """Directions along which the boxes are deeper than the least depth, or that are not unit."""
    outside: int  # points outside a box
    not_finite: int
    depth: float  # worst depth error, of the size
    point_p99: float
    """Of contacts deeper than 1e-9 of the size, % of the smaller box's longest edge."""
    point_worst: float
    volume: float  # worst error of the same contacts, % of the volume; NaN of the soup
    covariance: float  # the same, % of the trace


def answers_of(engine: Contestant) -> Callable[[Pairs], Contacts]:
    """Return what answers for pairs by an engine: its deepest point, and no volume."""
    def solve(pairs: Pairs) -> Contacts:
        found = pairs.contacts()
        found.volume[:], found.covariance[:] = math.nan, math.nan
        for row, call in enumerate(engine.prepare(pairs)):
            answer = engine.read(call())
            found.colliding[row], found.normal[row], found.point[row] = chosen(
                answer, engine.choices[0])
            found.separation[row] = -max(answer.depths, default=math.nan)
        return found
    return solve


def examine(model: str, family: str, cases: Cases, solve: Callable[[Pairs], Contacts], *,
            tolerance: float = 0.0) -> StabilityRow:
    """Judge the answers of a model to the cases of a family.

    tolerance: what it may be off besides rounding, of the size.
    """
    pairs, gap = cases.pairs, cases.gap
    found = solve(pairs)
    verdict = judge(*pairs, found, inside=max(INSIDE, tolerance))
    more = tolerance * pairs.size
    touching = found.colliding & (gap <= verdict.unsure + more)
    # What the judge settles by its own gap is settled here by the stored one.
    # A contact with NaN counts as that alone.
    wrong = {
        'verdicts': (found.colliding != (gap <= 0.0)) & (np.abs(gap) > verdict.unsure + more),
        'normals': touching & ((verdict.along < gap - verdict.tolerance - more)
                               | (verdict.faults & NOT_UNIT > 0)),
        'outside': touching & (verdict.faults & OUTSIDE > 0),
        'not_finite': touching & (verdict.faults & NOT_FINITE > 0)}
    known = touching & np.isfinite(cases.centroid).all(axis=1)
    points = found.point - pairs.pose_a[:, :3]
    trace = np.trace(cases.covariance, axis1=1, axis2=2)
    off = np.linalg.norm(found.covariance - cases.covariance, axis=(1, 2))
    errors = point_errors(points[known], cases.centroid[known], pairs.edge[known])
    return StabilityRow(
        model, family, len(gap), contacts=int(found.colliding.sum()),
        **{name: int(rows.sum()) for name, rows in wrong.items()},
        depth=float((np.abs(found.separation - gap) / pairs.size)[touching].max(initial=0.0)),
        point_p99=output.percentiles(errors, 99)[0] if len(errors) else 0.0,
        point_worst=float(errors.max(initial=0.0)),
        volume=_worst((np.abs(found.volume - cases.volume) / cases.volume)[known]),
        covariance=_worst((off / trace)[known]))


def _worst(errors: np.ndarray) -> float:
    """Return the largest of relative errors [%], NaN if one is."""
    return 100.0 * float(errors.max(initial=0.0))


def table(rows: Sequence[StabilityRow], counts: Mapping[str, str] = COUNTED) -> str:
    """Return the rows as Markdown, families or models; counts: columns, and their heads."""
    def cell(error: float) -> str:
        return '–' if math.isnan(error) else f'{error:.2g}'

    def cells(row: StabilityRow) -> list[object]:
        unjudged = OF_A_CENTROID if row.model in ENGINES else ()
        return ['–' if name in unjudged else value for name, value in (
            *((name, getattr(row, name)) for name in counts),
            *((name, cell(getattr(row, name))) for name in ERRORS))]

    return output.markdown_table(
        ['', *counts.values(), 'depth error [of the size]', 'point [% of the edge]', 'volume [%]',
         'covariance [% of the trace]'], [[row.family, *cells(row)] for row in rows])


def over_all(rows: Sequence[StabilityRow]) -> StabilityRow:
    """Return a model on all families; its name stands where a family's does."""
    return StabilityRow(
        rows[0].model, f'`{rows[0].model}`', point_p99=max(row.point_p99 for row in rows),
        **{name: sum(getattr(row, name) for row in rows) for name in COUNTED},
        **{name: float(np.max([getattr(row, name) for row in rows])) for name in ERRORS})


def gates(rows: Sequence[StabilityRow]) -> list[str]:
    """Return the faults of models that must have none, in words."""
    return [f'{row.model}, {row.family}: {getattr(row, name)} {name}' for row in rows
            if row.model in GATED for name in FAULTS
            if getattr(row, name) and (row.model, row.family, name) != KNOWN]


def main(args: Sequence[str] | None = None) -> int:
    """Ask all, print, write; 1 if a gate is broken."""
    parser = output.report_parser(
        'stability', __doc__, quick=f'every {QUICK}th family', out='stability.md and stability.csv')
    add_models(parser)
    add_leave_out(parser)
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options, part=bool(options.model))
    require('report', 'soup')
    cases = load()
    families = list(cases)[::QUICK] if options.quick else list(cases)
    from tqdm import tqdm

    engines, missing = installed()
    if not (options.quick or may_miss('stability', missing, options.leave_out)):
        return 2
    rows = []
    contestants = [*map(ours, MODELS), *map(ours, options.model),
                   *(engine for engine in engines if engine.name in ENGINES)]
    for one in contestants:
        rows += [examine(one.name, family, cases[family], one.solve or answers_of(one),
                         tolerance=0.0 if one.solve else TOLERANT)
                 for family in tqdm(families, desc=f'stability, {one.name}', unit='family')]
    about = output.machine(packages_of(contestants))
    output.write_csv(folder / 'stability.csv', map(asdict, rows), digits=4, about=about)
    by = {one.name: [row for row in rows if row.model == one.name] for one in contestants}
    summary = table([over_all(mine) for mine in by.values()])
    broken = gates(rows)
    output.write_page(
        folder, 'stability', args, machine=about, summary=summary, shown=MODELS[0],
        families=table(by[MODELS[0]], {'contacts': 'contacts'}),
        missing=''.join(f' Left out: {line}.' for line in missing),
        verdict=f'Goals missed: {"; ".join(broken)}.' if broken else 'Of `exact` and `mlp`, every '
        'verdict and normal is right. Every point is in both boxes, but some of `mlp` of '
        f'`{KNOWN[1]}`.')
    print(summary)
    for text in broken:
        print(f'stability: gate broken: {text}', file=sys.stderr)
    return int(bool(broken))


if __name__ == '__main__':
    sys.exit(main())
