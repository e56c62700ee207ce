"""What each model makes of the families of hard poses.

`python -m box_contact_ros stability` asks every model for every stored case (`families`) and writes
docs/stability.md and .csv: wrong verdicts, wrong normals, the worst error of depth and point, and
how far the point moves when a pose is nudged. The truth is the stored one, in 60 digits. Models
that build on FCL run in a process of their own, family by family: an abort is a finding, not an
end.
"""
from __future__ import annotations

import argparse
import csv
import multiprocessing
import sys
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from ..scene.pose_sets import Pairs
from ..solver.arguments import make_folder, model_name
from ..solver.contact_solver import ContactSolver
from ..solver.models import MODELS
from ..verification.fuzz import TOUCH_ULPS
from ..verification.hard_poses import FAMILIES, Cases, load
from ..verification.judge import COORDINATE_ULPS, NOT_FINITE, NOT_UNIT, OUTSIDE, TOLERANCE, judge

REPORTED = ('exact', 'mlp', 'fcl', 'soup-8')
"""Models in docs/stability.md."""
CHILDREN = ('fcl', 'soup')
"""Models (before a dash) that run in a process of their own."""
PATIENCE = 300.0
"""For such a process and a family [s]."""
NUDGE = 1e-7
"""By how much poses are moved, of the size, and turned [rad], for the ratio of Δpoint to Δpose."""
NUDGES = 3
"""How often each."""


@dataclass
class Row:
    """A model on a family. Depths and points where it agrees that the boxes touch."""

    model: str
    family: str
    cases: int
    contacts: int = 0
    verdicts: int = 0
    """Wrong ones, where the gap or depth is more than rounding."""
    normals: int = 0
    """Directions along which the boxes are deeper than the least depth, or that are not unit."""
    outside: int = 0
    """Points outside a box."""
    not_finite: int = 0
    depth: float = 0.0
    """Worst depth error, of the size."""
    point_p99: float = 0.0
    """Of contacts deeper than 1e-9 of the size, % of the smaller box's longest edge."""
    point_worst: float = 0.0
    ratio: float = 0.0
    """Worst |Δpoint| by |Δpose|."""
    exact_ratio: float = 0.0
    """The exact point's, on the same nudges."""
    failure: str = ''
    """What ended the model before its answers, if anything."""


def tolerance(pairs: Pairs) -> np.ndarray:
    """(n,) of separations [m]: 1e-12 of the size, or a few units of the coordinates' last place."""
    reach = np.maximum(np.abs(pairs.pose_a[:, :3]), np.abs(pairs.pose_b[:, :3])).max(axis=1)
    return TOLERANCE * _size(pairs) + COORDINATE_ULPS * np.finfo(float).eps * reach


def unsure(pairs: Pairs) -> np.ndarray:
    """(n,) gap or depth [m] below which either verdict is right: twice what counts as touch."""
    reach = np.maximum(np.abs(pairs.pose_a[:, :3]), np.abs(pairs.pose_b[:, :3])).max(axis=1)
    return 2.0 * TOUCH_ULPS * np.spacing(np.maximum(reach, _size(pairs)))


def _size(pairs: Pairs) -> np.ndarray:
    return np.maximum(pairs.size_a.max(axis=1), pairs.size_b.max(axis=1))


def examine(model: str, family: str, cases: Cases) -> Row:
    """Ask a model for the cases of a family."""
    pairs, gap = cases.pairs, cases.gap
    row = Row(model, family, len(gap))
    solver = ContactSolver((1, 1, 1), (1, 1, 1), model=model)
    found = solver.batch(pairs.pose_a, pairs.pose_b, size_a=pairs.size_a, size_b=pairs.size_b)
    size, allowed = _size(pairs), tolerance(pairs)
    verdict = judge(*pairs, found)
    row.contacts = int(found.colliding.sum())
    row.verdicts = int(((found.colliding != (gap <= 0.0)) & (np.abs(gap) > unsure(pairs))).sum())
    touching = found.colliding & (gap <= unsure(pairs))
    # What the judge settles by its own gap is settled here by the stored one.
    # A contact with NaN counts as that alone.
    row.normals = int((touching & ((verdict.along < gap - allowed)
                                   | (verdict.faults & NOT_UNIT > 0))).sum())
    row.outside = int((verdict.faults[touching] & OUTSIDE > 0).sum())
    row.not_finite = int((verdict.faults[touching] & NOT_FINITE > 0).sum())
    if touching.any():
        row.depth = float((np.abs(found.separation - gap) / size)[touching].max())
    known = touching & np.isfinite(cases.centroid).all(axis=1)
    if known.any():
        edge = np.minimum(pairs.size_a.max(axis=1), pairs.size_b.max(axis=1))[known]
        errors = 100.0 * np.linalg.norm(
            (found.point - pairs.pose_a[:, :3] - cases.centroid)[known], axis=1) / edge
        row.point_p99, row.point_worst = float(np.quantile(errors, 0.99)), float(errors.max())
    row.ratio, row.exact_ratio = _ratios(solver, pairs)
    return row


def _ratios(solver: ContactSolver, pairs: Pairs) -> tuple[float, float]:
    """Worst |Δpoint| by |Δpose| under small random motions of B, of a model and of `exact`."""
    rng = np.random.default_rng(5)
    size, n = _size(pairs), len(pairs.pose_a)
    exact = ContactSolver((1, 1, 1), (1, 1, 1), model='exact')
    worst = [0.0, 0.0]
    for _ in range(NUDGES):
        step, turn = rng.normal(size=(2, n, 3))
        step *= (NUDGE * size / np.linalg.norm(step, axis=1))[:, None]
        turn *= (NUDGE / np.linalg.norm(turn, axis=1))[:, None]
        nudged = pairs.pose_b.copy()
        nudged[:, :3] += step
        x, y, z, w = pairs.pose_b[:, 3:].T
        u, v, t = 0.5 * turn.T
        nudged[:, 3:] += np.stack([u * w + v * z - t * y, v * w + t * x - u * z,
                                   t * w + u * y - v * x, -(u * x + v * y + t * z)], axis=1)
        moved = NUDGE * size + NUDGE * 0.5 * np.linalg.norm(pairs.size_b, axis=1)
        for k, one in enumerate((solver, exact)):
            before, after = (one.batch(pairs.pose_a, b, size_a=pairs.size_a, size_b=pairs.size_b)
                             for b in (pairs.pose_b, nudged))
            both = before.colliding & after.colliding
            if both.any():
                apart = np.linalg.norm(after.point - before.point, axis=1)
                worst[k] = max(worst[k], float((apart / moved)[both].max()))
    return worst[0], worst[1]


def _child(model: str, family: str, pipe) -> None:
    """`examine` in a process of its own."""
    pipe.send(examine(model, family, load()[family]))


def examine_apart(model: str, family: str, cases: Cases) -> Row:
    """`examine` in a child process, whose end by a signal is a row of its own."""
    context = multiprocessing.get_context('spawn')
    receiving, sending = context.Pipe(duplex=False)
    child = context.Process(target=_child, args=(model, family, sending))
    child.start()
    sending.close()
    try:
        if receiving.poll(PATIENCE):
            return receiving.recv()
        failure = f'no answer in {PATIENCE:g} s'
    except EOFError:
        child.join()
        failure = (f'ended by signal {-child.exitcode}' if child.exitcode < 0
                   else f'ended with status {child.exitcode}')
    finally:
        child.kill()
        child.join()
    return Row(model, family, len(cases.gap), failure=failure)


# --- the report -----------------------------------------------------------------------------------

HEAD = ('family', 'cases', 'contacts', 'wrong verdicts', 'wrong normals', 'points outside', 'NaN',
        'depth error, worst [of the size]', 'point error p99 / worst [% of the edge]',
        'Δpoint by Δpose, worst', "exact's")


def table(rows: Sequence[Row]) -> str:
    """Families of one model, as Markdown, with a line for all."""
    lines = [' | '.join(HEAD), '|'.join(['---', *['---:'] * (len(HEAD) - 1)])]
    for row in [*rows, _all(rows)]:
        if row.failure:
            lines.append(f'{row.family} | {row.cases} | **{row.failure}**' + ' | ' * 8)
            continue
        lines.append(' | '.join([
            row.family, str(row.cases), *map(str, (row.contacts, row.verdicts, row.normals,
                                                   row.outside, row.not_finite)),
            f'{row.depth:.1e}', f'{row.point_p99:.2g} / {row.point_worst:.2g}',
            f'{row.ratio:.2g}', f'{row.exact_ratio:.2g}']))
    return '\n'.join(f'| {line} |' for line in lines)


def _all(rows: Sequence[Row]) -> Row:
    whole = Row(rows[0].model, '**all**', sum(row.cases for row in rows))
    for name in ('contacts', 'verdicts', 'normals', 'outside', 'not_finite'):
        setattr(whole, name, sum(getattr(row, name) for row in rows))
    for name in ('depth', 'point_p99', 'point_worst', 'ratio', 'exact_ratio'):
        setattr(whole, name, max(getattr(row, name) for row in rows))
    return whole


def gates(rows: Sequence[Row]) -> list[str]:
    """What is broken of what `exact` and `mlp` promise."""
    broken = []
    for row in rows:
        if row.model not in ('exact', 'mlp'):
            continue
        for name in ('verdicts', 'normals', 'outside', 'not_finite'):
            if getattr(row, name):
                broken.append(f'{row.model}, {row.family}: {getattr(row, name)} {name}')
    return broken


def page(rows: Sequence[Row], command: str) -> str:
    """The Markdown page."""
    broken = gates(rows)
    models = list(dict.fromkeys(row.model for row in rows))
    parts = [f"""# Numerical stability

Made by `{command}`. {"BROKEN: " + "; ".join(broken) + "." if broken else
"Of `exact` and `mlp`, every verdict and normal is right, and every point in both boxes."}

Families of poses that break collision tests (`box_contact_ros/verification/hard_poses.py` says what
each is), every case also turned, swapped, renamed or scaled; stored as doubles, the truth in 60
digits.
*Wrong verdict*: where the gap or depth is more than 16 units in the last place of the largest
coordinate. *Wrong normal*: not the direction of least depth, to 1e-12 of the size, or not unit.
*Depth error*: of the size; far from the origin (`f_far`) a unit in the coordinates' last place is
1e-10 of it. *Point error*: contacts deeper than 1e-9 of the size. *Δpoint by Δpose*: B is nudged by
1e-7 of the size; where several axes tie, or the overlap is as thin as the nudge, even the exact
point moves a lot, so its own ratio stands beside. FCL's box-box and the soup are in the table so
that users see what they would get otherwise; a process that ends is said so.
"""]
    for model in models:
        parts.append(f'## `{model}`\n\n{table([row for row in rows if row.model == model])}\n')
    return '\n'.join(parts)


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """A row per model and family."""
    with path.open('w', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow([field.name for field in fields(Row)])
        for row in rows:
            writer.writerow([f'{value:.4g}' if isinstance(value, float) else value
                             for value in astuple(row)])


def main(args: Sequence[str] | None = None) -> int:
    """Ask all, print, write; 1 if a gate is broken."""
    from tqdm import tqdm

    parser = argparse.ArgumentParser(prog='stability', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--models', nargs='+', type=model_name, default=list(REPORTED),
                        metavar='MODEL',
                        help=f'of {", ".join(MODELS)} (default: {" ".join(REPORTED)})')
    parser.add_argument('--families', nargs='+', default=list(FAMILIES), choices=list(FAMILIES),
                        metavar='FAMILY', help='default: all')
    parser.add_argument('--out', type=Path, metavar='DIR',
                        help='folder for stability.md and stability.csv (default: docs, or '
                             'quick-results with fewer models or families than that)')
    options = parser.parse_args(args)
    whole = set(options.models) >= set(REPORTED) and set(options.families) == set(FAMILIES)
    folder = make_folder(parser, options.out or Path('docs' if whole else 'quick-results'))
    cases, rows = load(), []
    with tqdm(total=len(options.models) * len(options.families), desc='stability',
              unit='family') as bar:
        for model in options.models:
            apart = model.split('-')[0] in CHILDREN
            for name in options.families:
                bar.set_postfix_str(f'{model}, {name}')
                rows.append((examine_apart if apart else examine)(model, name, cases[name]))
                bar.update()
    given = sys.argv[1:] if args is None else args
    write_csv(folder / 'stability.csv', rows)
    (folder / 'stability.md').write_text(
        page(rows, ' '.join(['python -m box_contact_ros stability', *given])), encoding='utf-8')
    for model in options.models:
        print(f'\n{model}\n{table([row for row in rows if row.model == model])}')
    for text in gates(rows):
        print(f'stability: gate broken: {text}', file=sys.stderr)
    return 1 if gates(rows) else 0


if __name__ == '__main__':
    sys.exit(main())
