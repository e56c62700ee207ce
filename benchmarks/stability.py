# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `stability`: what each model makes of the families of hard poses.

`python -m box_contact_ros stability` asks every model for every stored case and
writes stability.md and .csv. The tables have wrong verdicts, wrong normals, the worst error of
depth and point, and how far the point moves when a pose is nudged. The truth is stored, in 60
digits. Models that build on FCL run in a subprocess, family by family: an abort is a finding, not
an end.

`--named` replays public reports about pairs of boxes instead, with every model and every other
engine that is installed. It writes named_failures.md.
"""
from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from box_contact_ros.core import native
from box_contact_ros.scene.pose import quaternion_multiply
from box_contact_ros.solver.arguments import add_models, program_parser
from box_contact_ros.solver.models import find_model, models, models_with_patch

from . import output
from .contestant import Contestant, in_subprocess, ours
from .errors import distances, point_errors
from .hard_poses import Cases, load
from .judge import NOT_FINITE, NOT_UNIT, OUTSIDE, judge
from .named_report import write_named
from .pose_sets import Pairs

PACKAGES = ('numpy', 'python-fcl')  # whose versions are named
PATIENCE = 300.0  # for a family in a subprocess [s]
NUDGE = 1e-7
"""By how much poses are moved, of the size, and turned [rad], for the ratio of Δpoint to Δpose."""
NUDGES = 3  # how often each

COUNTS = ('verdicts', 'normals', 'outside', 'not_finite')
"""Faults; models that are gated must have none."""
WORST = ('depth', 'point_p99', 'point_worst', 'ratio', 'exact_ratio')


@dataclass(frozen=True)
class StabilityRow:
    """A model on a family. Depths and points where it agrees that the boxes touch."""

    model: str
    family: str
    cases: int
    contacts: int = 0
    verdicts: int = 0  # wrong ones, where the gap or depth is more than rounding
    normals: int = 0
    """Directions along which the boxes are deeper than the least depth, or that are not unit."""
    outside: int = 0  # points outside a box
    not_finite: int = 0
    depth: float = 0.0  # worst depth error, of the size
    point_p99: float = 0.0
    """Of contacts deeper than 1e-9 of the size, % of the smaller box's longest edge."""
    point_worst: float = 0.0
    ratio: float = 0.0  # worst |Δpoint| by |Δpose|
    exact_ratio: float = 0.0  # the exact point's, on the same nudges
    failure: str = ''  # what ended the model before its answers, if anything


def examine(contestant: Contestant, family: str, cases: Cases) -> StabilityRow:
    """Ask a model for the cases of a family."""
    pairs, gap = cases.pairs, cases.gap
    found, _ = contestant.solve(pairs)
    verdict = judge(*pairs, found)
    touching = found.colliding & (gap <= verdict.unsure)
    # What the judge settles by its own gap is settled here by the stored one.
    # A contact with NaN counts as that alone.
    wrong = {
        'verdicts': (found.colliding != (gap <= 0.0)) & (np.abs(gap) > verdict.unsure),
        'normals': touching & ((verdict.along < gap - verdict.tolerance)
                               | (verdict.faults & NOT_UNIT > 0)),
        'outside': touching & (verdict.faults & OUTSIDE > 0),
        'not_finite': touching & (verdict.faults & NOT_FINITE > 0)}
    known = touching & np.isfinite(cases.centroid).all(axis=1)
    points = found.point - pairs.pose_a[:, :3]
    errors = point_errors(points[known], cases.centroid[known], pairs.edge[known])
    ratio, exact_ratio = _ratios(contestant, pairs)
    return StabilityRow(
        contestant.name, family, len(gap), contacts=int(found.colliding.sum()),
        **{name: int(rows.sum()) for name, rows in wrong.items()},
        depth=float((np.abs(found.separation - gap) / pairs.size)[touching].max(initial=0.0)),
        point_p99=output.percentiles(errors, 99)[0] if len(errors) else 0.0,
        point_worst=float(errors.max(initial=0.0)), ratio=ratio, exact_ratio=exact_ratio)


def _ratios(contestant: Contestant, pairs: Pairs) -> tuple[float, float]:
    """Return the worst |Δpoint| by |Δpose| under small motions of B, of a model and of `exact`."""
    rng = np.random.default_rng(5)
    worst = [0.0, 0.0]
    for _ in range(NUDGES):
        step, turn = rng.normal(size=(2, len(pairs.pose_a), 3))
        step *= (NUDGE * pairs.size / np.linalg.norm(step, axis=1))[:, None]
        turn *= (NUDGE / np.linalg.norm(turn, axis=1))[:, None]
        small = np.column_stack([0.5 * turn, np.ones(len(turn))])
        nudged = pairs._replace(pose_b=np.hstack([
            pairs.pose_b[:, :3] + step, quaternion_multiply(small, pairs.pose_b[:, 3:])]))
        moved = NUDGE * pairs.size + NUDGE * 0.5 * np.linalg.norm(pairs.size_b, axis=1)
        for k, one in enumerate((contestant, ours('exact'))):
            before, after = (one.solve(asked).contacts for asked in (pairs, nudged))
            both = before.colliding & after.colliding
            ratios = distances(after.point, before.point) / moved
            worst[k] = max(worst[k], float(ratios[both].max(initial=0.0)))
    return worst[0], worst[1]


def examine_apart(model: str, family: str, cases: Cases) -> StabilityRow:
    """Do as `examine`, in a subprocess: its end by a signal is a row."""
    try:
        return in_subprocess(_by_name, model, family, cases, patience=PATIENCE)
    except RuntimeError as error:
        return StabilityRow(model, family, len(cases.gap), failure=str(error))


def _by_name(model: str, family: str, cases: Cases) -> StabilityRow:
    return examine(ours(model), family, cases)


HEAD = ('family', 'cases', 'contacts', 'wrong verdicts', 'wrong normals', 'points outside', 'NaN',
        'depth error, worst [of the size]', 'point error p99 / worst [% of the edge]',
        'Δpoint by Δpose, worst', "exact's")


def table(rows: Sequence[StabilityRow]) -> str:
    """Return the families of one model as Markdown, with a line for all."""
    whole = StabilityRow(rows[0].model, '**all**', sum(row.cases for row in rows),
                         **{name: sum(getattr(row, name) for row in rows)
                            for name in ('contacts', *COUNTS)},
                         **{name: max(getattr(row, name) for row in rows) for name in WORST})
    return output.markdown_table(HEAD, [
        [row.family, row.cases, f'**{row.failure}**', *[''] * (len(HEAD) - 3)] if row.failure else
        [row.family, row.cases, row.contacts, *(getattr(row, name) for name in COUNTS),
         f'{row.depth:.1e}', f'{row.point_p99:.2g} / {row.point_worst:.2g}', f'{row.ratio:.2g}',
         f'{row.exact_ratio:.2g}'] for row in (*rows, whole)])


def gates(rows: Sequence[StabilityRow]) -> list[str]:
    """Return what is broken of what gated models promise."""
    return [f'{row.model}, {row.family}: {getattr(row, name)} {name}' for row in rows
            if row.model in models_with_patch() for name in COUNTS if getattr(row, name)]


def page(rows: Sequence[StabilityRow], command: str) -> str:
    """Return the Markdown page."""
    broken = gates(rows)
    models = dict.fromkeys(row.model for row in rows)
    return output.page(
        'benchmarks/pages/stability',
        command=command, machine=output.machine(native, PACKAGES),
        verdict=f'Goals missed: {"; ".join(broken)}.' if broken else 'Of `exact` and `mlp`, every '
        'verdict and normal is right, and every point in both boxes.', models='\n\n'.join(
            f'## `{model}`\n\n{table([row for row in rows if row.model == model])}'
            for model in models))


def main(args: Sequence[str] | None = None) -> int:
    """Ask all, print, write; 1 if a gate is broken."""
    cases = load()
    parser = program_parser('stability', __doc__)
    reported = [entry.full_name for entry in models().values() if entry.any_boxes]
    add_models(parser, '--models', reported)
    parser.add_argument('--families', nargs='+', default=list(cases), choices=list(cases),
                        metavar='FAMILY', help='default: all')
    parser.add_argument('--out', type=Path, metavar='DIR',
                        help='folder for stability.md and stability.csv (default: docs/results, '
                             'or quick-results with fewer models or families than that)')
    parser.add_argument('--named', action='store_true',
                        help='the named public reports instead, as named_failures.md (default '
                             'folder: docs/contributing)')
    options = parser.parse_args(args)
    command = output.command_line('box_contact_ros stability', args)
    if options.named:
        return write_named(output.make_folder(parser, options.out or Path('docs/contributing')),
                           command, reported)
    whole = set(options.models) >= set(reported) and set(options.families) == set(cases)
    folder = output.make_folder(parser, options.out or (
        output.RESULTS if whole else output.QUICK_RESULTS))
    from tqdm import tqdm

    rows = []
    with tqdm(total=len(options.models) * len(options.families), desc='stability',
              unit='family') as bar:
        for model in options.models:
            apart = find_model('model', model)[0].extra  # another's library may abort
            for name in options.families:
                bar.set_postfix_str(f'{model}, {name}')
                rows.append((examine_apart if apart else _by_name)(model, name, cases[name]))
                bar.update()
    output.write_csv(folder / 'stability.csv', map(asdict, rows), digits=4,
                     about=output.machine(native, PACKAGES))
    (folder / 'stability.md').write_text(page(rows, command), encoding='utf-8')
    for model in options.models:
        print(f'\n{model}\n{table([row for row in rows if row.model == model])}')
    for text in gates(rows):
        print(f'stability: gate broken: {text}', file=sys.stderr)
    return 1 if gates(rows) else 0
