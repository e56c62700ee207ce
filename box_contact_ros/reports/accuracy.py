"""Program `accuracy`: how far a model's contact point is from the exact one, per set and class.

Every set of `pose_sets` is drawn anew from `--seed`; model `exact` gives the truth. Written are
accuracy.csv (a row per model, set and part of the set), accuracy.md and accuracy.png. The exit
status is 1 if `mlp` breaks one of the limits in `LIMITS`, its separations or normals are not
those of `exact`, a point lies outside a box, or a pair was handed to `exact`.

Classes. The features that meet are told from the pose, not from which SAT axis wins: in stacks
about half the winners are edge pairs although the contact is a patch.

- edge-edge: the winner is a pair of edges, and its axis is farther than FACE_LIKE from the normals
  of all faces. Two edges cross.
- The rest has a reference face, that of the best face axis. Of the other box's corners, 1
  (vertex-face), 2 (edge-face) or more (face-face) have gone through its plane.
"""
from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..core import CENTROID_REACH, DEPTH_FLOOR, Stages, native, stages
from ..output import add_out, processor, results_folder, versions
from ..resources import resource_path
from ..scene.pose import rotation_matrix
from ..scene.pose_sets import SETS, Pairs
from ..solver.arguments import check_ranges, seed_number
from ..solver.contact import Contacts
from ..solver.contact_solver import ContactSolver
from ..solver.mlp import bounds_of, core_numbers
from ..solver.models import MODELS
from ..solver.weights_file import WeightsError, load_weights
from ..training.paper_recipe import dataset
from ..training.paper_recipe.errors import errors_of, figures, wrapped
from .paper_tables import PAPER


class Limit(NamedTuple):
    """Largest point error allowed, in % of the smaller box's longest edge."""

    mean: float
    p99: float
    worst: float


LIMITS = {
    'random cubes': Limit(0.08, 1.0, 4.0),
    'touching': Limit(0.001, 0.01, 0.1),
    'random sizes': Limit(0.015, 0.2, 4.0),
    'stacks': Limit(0.35, 1.3, 4.5),
    'tilted stacks': Limit(0.35, 1.3, 4.5),
    'containers': Limit(0.06, 0.5, 2.5),
}
"""What model `mlp` has to keep, by set."""
MAE_LIMIT = 0.005
"""Mean absolute error [rad] of `mlp` on the paper's external set."""
OUTSIDE = 2.0**-44
"""How far outside a box a point may be, of the size (5.7e-14), beside what B is pressed in."""

OPENED = 5e-12
"""By how much boxes of the paper's set may be apart [of the size]: near a pitch of ±90° the angles
keep a pose to 12 digits only. Still far below the 1e-9 that B is pressed in."""

PAIRS, QUICK_PAIRS = 100_000, 5_000
CLASSES = ('vertex-face', 'edge-edge', 'edge-face', 'face-face')
WINNERS = ('face axis', 'edge axis')
SHOWN = (1e-4, 100.0)
"""Errors that are drawn [%]."""
FACE_LIKE = math.cos(math.radians(6.0))
"""Cosine of the angle to a face's normal up to which an edge pair's axis stands for the face."""


# --- one set --------------------------------------------------------------------------------------


def classify(pairs: Pairs) -> tuple[np.ndarray, np.ndarray]:
    """Return indices (n,) into CLASSES and into WINNERS of pairs that touch: see the module."""
    found = stages(*pairs, names=('axis', 'face', 'normal', 'rotation', 'pressed_offset_a',
                                  'pressed_offset_b'))
    winners = (found.axis >= 6).astype(np.int64)
    normal_in_b = np.einsum('nij,ni->nj', found.rotation, found.normal)
    steepest = np.abs(np.hstack([found.normal, normal_in_b])).max(axis=1)
    through = _corners_through(pairs, found)
    classes = np.where(through <= 1, 0, np.where(through == 2, 2, 3))
    classes[(winners == 1) & (steepest < FACE_LIKE)] = 1
    return classes, winners


def _corners_through(pairs: Pairs, found: Stages) -> np.ndarray:
    """Return how many corners (n,) of the incident box are below the plane of the best face."""
    rows, of_a, k = np.arange(len(found.face)), found.face < 3, found.face % 3
    rotation = np.where(of_a[:, None, None], found.rotation, found.rotation.swapaxes(1, 2))
    offset = np.where(of_a[:, None], found.pressed_offset_a, found.pressed_offset_b)
    reference, incident = (0.5 * np.where(of_a[:, None], one, other) for one, other in (
        (pairs.size_a, pairs.size_b), (pairs.size_b, pairs.size_a)))
    top = np.abs(offset[rows, k]) - reference[rows, k]
    reach = rotation[rows, k] * incident
    through = np.zeros(len(rows), dtype=np.int64)
    for x, y, z in product((-1.0, 1.0), repeat=3):
        through += ((top + x * reach[:, 0]) + y * reach[:, 1]) + z * reach[:, 2] < 0.0
    return through


def share_corrected(pairs: Pairs, weights: Path | str) -> float:
    """Return the share of the network's points that were outside a box and were moved in.

    The network's points are in the bounding box, so it is the other box that a point can leave.
    """
    file = load_weights(weights)
    found = stages(*pairs, names=('answer', 'bounds_half', 'other_axes', 'other_offset',
                                  'other_half', 'size'),
                   network=core_numbers(file.networks['point']), bounds=bounds_of(file))
    from_middle = found.bounds_half * np.clip(found.answer, -CENTROID_REACH, CENTROID_REACH)
    from_other = found.other_offset + np.einsum('nfq,nq->nf', found.other_axes, from_middle)
    beyond = np.abs(from_other) - found.other_half > OUTSIDE * found.size[:, None]
    return float(beyond.any(axis=1).mean())


def outside(pairs: Pairs, found: Contacts) -> float:
    """Return the largest distance of a point from a box, of the size, beyond the pressing."""
    size = np.maximum(pairs.size_a.max(axis=1), pairs.size_b.max(axis=1))
    farthest = np.full(len(size), -np.inf)
    for pose, extents in ((pairs.pose_a, pairs.size_a), (pairs.pose_b, pairs.size_b)):
        local = np.einsum('nji,nj->ni', rotation_matrix(pose[:, 3:]), found.point - pose[:, :3])
        farthest = np.maximum(farthest, (np.abs(local) - 0.5 * extents).max(axis=1))
    pressed = np.maximum(0.0, DEPTH_FLOOR + found.separation / size)
    # A point inside is no distance outside; NaN, which a pair apart has, is none either.
    return float(np.max((farthest / size - pressed)[found.colliding], initial=0.0))


@dataclass
class Result:
    """One model on one set."""

    model: str
    set: str
    errors: np.ndarray
    """(n,) point errors of pairs that touch by both, % of the smaller box's longest edge."""
    classes: np.ndarray
    """(n,) index into CLASSES."""
    winners: np.ndarray
    """(n,) index into WINNERS."""
    pairs: int
    exact_share: float
    """Share of contacts answered by `exact`."""
    verdict_errors: int
    normal_difference: float
    """Largest difference of a component."""
    separation_difference: float
    """Largest, of the size."""
    outside: float
    """Farthest point outside a box, of the size."""
    corrected_share: float = math.nan
    broken: list[str] = field(default_factory=list)
    """Limits that do not hold, in words."""

    def parts(self) -> dict[str, np.ndarray]:
        """Errors of all pairs, per class and per winner; parts that have none are left out."""
        found = {'all': self.errors}
        found |= {name: self.errors[self.classes == k] for k, name in enumerate(CLASSES)}
        found |= {name: self.errors[self.winners == k] for k, name in enumerate(WINNERS)}
        return {name: errors for name, errors in found.items() if len(errors)}


def measure(model: str, name: str, pairs: Pairs, truth: Contacts, weights: str | None = None,
            ) -> Result | None:
    """A model on a set, or None where the model is not for its sizes."""
    cube = tuple(pairs.size_a[0])
    try:
        solver = ContactSolver(cube, cube, model=model, weights=weights)
        found = solver.batch(pairs.pose_a, pairs.pose_b, size_a=pairs.size_a, size_b=pairs.size_b)
    except ValueError:
        if model == 'mlp':
            raise
        return None  # the paper's models are for two equal boxes of few sizes
    both = truth.colliding & found.colliding
    touching = Pairs(*(part[both] for part in pairs))
    classes, winners = classify(touching)
    edge = np.minimum(touching.size_a.max(axis=1), touching.size_b.max(axis=1))
    size = np.maximum(pairs.size_a.max(axis=1), pairs.size_b.max(axis=1))
    apart = np.linalg.norm(found.point[both] - truth.point[both], axis=1)
    result = Result(
        model, name, 100.0 * apart / edge, classes, winners, len(both),
        solver.exact_answers / max(1, int(found.colliding.sum())),
        int((found.colliding != truth.colliding).sum()),
        float(np.abs(found.normal[both] - truth.normal[both]).max(initial=0.0)),
        float((np.abs(found.separation - truth.separation) / size).max(initial=0.0)),
        outside(pairs, found))
    if model == 'mlp':
        result.corrected_share = share_corrected(
            touching, weights or resource_path('weights', 'mlp.safetensors'))
        result.broken = _broken(result)
    return result


def _broken(result: Result) -> list[str]:
    mean, p99, worst = statistics(result.errors)
    limit = LIMITS[result.set]
    checks = {
        f'mean {mean:.3f} > {limit.mean:g} %': mean <= limit.mean,
        f'p99 {p99:.3f} > {limit.p99:g} %': p99 <= limit.p99,
        f'worst {worst:.3f} > {limit.worst:g} %': worst <= limit.worst,
        f'{result.verdict_errors} verdicts differ': result.verdict_errors == 0,
        'normals differ': result.normal_difference == 0.0,
        'separations differ': result.separation_difference == 0.0,
        'points outside': result.outside <= OUTSIDE,
        'exact answers': result.exact_share == 0.0,
    }
    # Comparisons with NaN are false, so a NaN breaks its limit.
    return [f'{result.model}, {result.set}: {text}' for text, holds in checks.items() if not holds]


def statistics(errors: np.ndarray) -> tuple[float, float, float]:
    """Mean, 99th percentile, worst."""
    return float(errors.mean()), float(np.quantile(errors, 0.99)), float(errors.max())


# --- the paper's figures --------------------------------------------------------------------------


def paper_errors(models: Sequence[str], weights: str | None = None, step: int = 1,
                 ) -> tuple[dict[str, np.ndarray], int]:
    """Wrapped errors (n, 4) [rad] on the paper's external set, per model, and n as drawn.

    Azimuth and elevation of the impact point, seen from the first box's centre, and of the normal.
    The set is that of the weights of model `paper`; `paper` is its network alone, asked as the
    paper did.
    """
    file = load_weights(resource_path('weights', 'paper.safetensors'))
    patterns = dataset.of_card(file.card, sets=('external',))['contact']['external']
    inputs, outputs = patterns.inputs[::step], patterns.outputs[::step]
    pose_b = np.concatenate([inputs[:, :3], dataset.quaternion_from_euler(inputs[:, 3:])], axis=1)
    pose_a = np.tile((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), (len(pose_b), 1))
    size = file.card['sizes'][0]
    # The boxes touch exactly; writing their poses as angles has opened some.
    azimuth, elevation = outputs[:, 2], outputs[:, 3]
    normal = np.column_stack([np.cos(elevation) * np.cos(azimuth),
                              np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    pose_b[:, :3] -= OPENED * max(size) * normal
    found = {'paper': errors_of(file.networks['contact'], inputs, outputs)}
    for model in models:
        solver = ContactSolver(size, size, model=model,
                               weights=weights if model == 'mlp' else None)
        contact = solver.batch(pose_a, pose_b)
        angles = np.concatenate([dataset.spherical(contact.point),
                                 dataset.spherical(contact.normal)], axis=1)
        found[model] = wrapped(angles - outputs)[contact.colliding]
    return found, len(outputs)


def paper_table(errors: dict[str, np.ndarray], drawn: int) -> str:
    """ME, MAE and RMSE beside Tables 1 and 2."""
    rows = [['', *PAPER[1], 'point MAE', 'normal MAE', 'patterns']]
    for number, title in ((1, 'with'), (2, 'without')):
        rows.append([f"paper's Table {number}, {title} discontinuities",
                     *[f'{PAPER[number][name][2]:.4f}' for name in PAPER[number]], '', '', ''])
    for model, wrong in errors.items():
        overall, halves = figures(wrong), [figures(wrong[:, part]) for part in
                                           (slice(0, 2), slice(2, 4))]
        label = 'our network of Table 1' if model == 'paper' else f'`{model}`'
        rows.append([label, *[f'{overall[name] + 0.0:.3g}' for name in PAPER[1]],
                     *[f'{half["MAE"]:.3g}' for half in halves], f'{len(wrong):,} of {drawn:,}'])
    return markdown(rows)


# --- the report -----------------------------------------------------------------------------------


def markdown(rows: Sequence[Sequence[str]]) -> str:
    """Rows as a Markdown table, the first one its head; figures to the right."""
    lines = [rows[0], ['---', *['---:'] * (len(rows[0]) - 1)], *rows[1:]]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def _three(errors: np.ndarray | None) -> str:
    return '–' if errors is None else '/'.join(
        f'{value:.{digits}f}' for value, digits in zip(statistics(errors), (3, 2, 1)))


def table(results: Sequence[Result]) -> str:
    """Errors of whole sets beside the limits."""
    rows = [['model, set', 'pairs', 'mean', 'p99', 'worst', 'limits', 'answered by exact',
             'verdicts wrong', 'normal off', 'separation off', 'corrected', 'outside']]
    for r in results:
        limit = '/'.join(f'{value:g}' for value in LIMITS[r.set]) if r.model == 'mlp' else ''
        mean, p99, worst = statistics(r.errors)
        corrected = '' if math.isnan(r.corrected_share) else f'{100.0 * r.corrected_share:.2g} %'
        rows.append([
            f'{r.model}, {r.set}', f'{r.pairs:,}', f'{mean:.3f}', f'{p99:.2f}', f'{worst:.2f}',
            limit, f'{100.0 * r.exact_share:.3g} %', str(r.verdict_errors),
            f'{r.normal_difference:.2g}', f'{r.separation_difference:.2g}', corrected,
            f'{r.outside:.1g}'])
    return markdown(rows)


def class_table(results: Sequence[Result]) -> str:
    """mean/p99/worst per class and winner, with the share of the pairs."""
    names = (*CLASSES, *WINNERS)
    rows = [['model, set', *names]]
    for r in results:
        parts = r.parts()
        rows.append([f'{r.model}, {r.set}', *[
            f'{_three(parts[name])} ({100.0 * len(parts[name]) / len(r.errors):.0f} %)'
            if name in parts else '–' for name in names]])
    return markdown(rows)


def write_csv(path: Path, results: Sequence[Result]) -> None:
    """A row per model, set and part: errors in %, differences of the size.

    The row of a whole set ends with what is known of the set only.
    """
    with path.open('w', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(['model', 'set', 'part', 'pairs', 'mean', 'p50', 'p99', 'worst',
                         'limit_mean', 'limit_p99', 'limit_worst', 'exact_share', 'verdict_errors',
                         'normal_difference', 'separation_difference', 'corrected_share',
                         'outside'])
        for r in results:
            for part, errors in r.parts().items():
                mean, p99, worst = statistics(errors)
                more = [''] * 9
                if part == 'all':
                    limits = LIMITS[r.set] if r.model == 'mlp' else [''] * 3
                    corrected = '' if math.isnan(r.corrected_share) else f'{r.corrected_share:.5g}'
                    more = [*limits, f'{r.exact_share:.5g}', r.verdict_errors,
                            f'{r.normal_difference:.3g}', f'{r.separation_difference:.3g}',
                            corrected, f'{r.outside:.3g}']
                writer.writerow([r.model, r.set, part, len(errors), f'{mean:.5g}',
                                 f'{np.median(errors):.5g}', f'{p99:.5g}', f'{worst:.5g}', *more])


def page(results: Sequence[Result], errors: dict[str, np.ndarray], drawn: int, command: str,
         seed: int, broken: Sequence[str]) -> str:
    """The Markdown page."""
    verdict = ('All limits hold.' if not broken else
               'BROKEN: ' + '; '.join(broken) + '.')
    return f"""# Point error against the exact centroid

Made by `{command}` on {processor()},
{native.instruction_set}; {versions()}; seed {seed}. {verdict}

Errors are distances between a model's contact point and that of model `exact`, in % of the longest
edge of the smaller box. `answered by exact`: pairs outside the network's range. Verdicts, normals
and separations are compared with `exact`: they are SAT's in both, so nothing may differ.
`corrected`: points that the network had put outside a box, and that were moved in. `outside`: the
farthest that an answer is outside a box, as a fraction of the size, beside what boxes that only
touch are pressed in by (1e-9).

{table(results)}

![Distribution of the errors](accuracy.png)

## Per class and per winning axis

mean/p99/worst in %, and the share of the set's pairs. A contact is edge-edge if SAT's winner is a
pair of edges whose axis is more than 6° from every face normal; otherwise it is named after how
many corners of one box have gone through the plane of the other's best face: one (vertex-face), two
(edge-face), more (face-face). `face axis` and `edge axis` are SAT's winners: in stacks many winners
are pairs of edges although faces meet.

{class_table(results)}

## The paper's figures

Errors [rad] over azimuth and elevation of the impact point, seen from the first box's centre, and
of the normal, on the external set of the weights of model `paper` (cubes of edge 2 that just touch,
as labelled when they were drawn). {MAE_LIMIT:g} is the limit of `mlp`'s MAE.

{paper_table(errors, drawn)}

The labels are the points of touch; `exact` presses B in by 1e-9 of the size and takes the centroid
of what overlaps. Its figures are the difference between the two definitions, and the floor of what
`mlp` could reach.
"""


def _curve(axis: Any, errors: np.ndarray, **style: Any) -> None:
    """Share of pairs with a larger error; what is too small to be drawn stands at the left."""
    if len(errors):
        axis.loglog(np.sort(np.maximum(errors, SHOWN[0] / 10)),
                    1.0 - np.arange(len(errors)) / len(errors), **style)


def draw(path: Path, results: Sequence[Result]) -> None:
    """Share of pairs with a larger error, per set, logarithmic; limits marked."""
    import matplotlib

    matplotlib.use('Agg')
    from matplotlib import pyplot as plt

    names = list(dict.fromkeys(r.set for r in results))
    models = list(dict.fromkeys(r.model for r in results))
    figure, axes = plt.subplots(2, 3, figsize=(12.5, 7.0), sharex=True, sharey=True,
                                constrained_layout=True)
    for axis, name in zip(axes.flat, names):
        for r in results:
            if r.set != name:
                continue
            colour = 'C0' if r.model == 'mlp' else f'C{5 + models.index(r.model) % 5}'
            _curve(axis, r.errors, linewidth=1.6, color=colour, label=r.model)
            if r.model != 'mlp':
                continue
            for k, part in enumerate(CLASSES):
                _curve(axis, r.errors[r.classes == k], linewidth=0.8, linestyle='--',
                       color=f'C{1 + k}', label=part)
            if r.errors.max() < SHOWN[0]:
                axis.text(0.03, 0.5, f'{r.model}: all below {r.errors.max():.1g} %', fontsize=9,
                          transform=axis.transAxes)
        limit = LIMITS[name]
        lowest = 1.0 / max(len(r.errors) for r in results)
        for value, height, label in ((limit.p99, 0.01, 'p99'), (limit.worst, lowest, 'worst')):
            axis.plot([value], [height], marker='v', color='black', markersize=6)
            axis.annotate(label, (value, height), xytext=(5, 4), textcoords='offset points',
                          fontsize=8)
        axis.axvline(limit.mean, color='black', linewidth=0.7, linestyle=':')
        axis.set_title(name, fontsize=10)
        axis.set_xlim(*SHOWN)
        axis.set_ylim(0.7 * lowest, 1.3)
        axis.grid(color='0.9', linewidth=0.5)
        axis.legend(fontsize=7, loc='lower left')
    for axis in axes[-1]:
        axis.set_xlabel("point error [% of the smaller box's longest edge]")
    for axis in axes[:, 0]:
        axis.set_ylabel('share of pairs with a larger error')
    figure.suptitle('Point error against exact; dashed: mlp per class; '
                    '▼ its limits, dotted: of its mean')
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write; 1 if a limit is broken."""
    parser = argparse.ArgumentParser(prog='accuracy', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--model', nargs='+', default=['mlp'], choices=list(MODELS),
                        metavar='MODEL', help=f'of {", ".join(MODELS)}; default: mlp')
    parser.add_argument('--weights', help='weights file of MLP, default: the shipped one')
    parser.add_argument('--pairs', type=int, default=PAIRS, help='a set, default: %(default)s')
    parser.add_argument('--quick', action='store_true', help=f'{QUICK_PAIRS} pairs a set')
    parser.add_argument('--seed', type=seed_number, default=2,
                        help='of the sets, default: %(default)s')
    add_out(parser, 'accuracy.md, accuracy.csv, accuracy.png')
    options = parser.parse_args(args)
    check_ranges(parser, options, pairs=(1, None))
    options.out = results_folder(parser, options)
    count = min(options.pairs, QUICK_PAIRS) if options.quick else options.pairs
    try:
        results = _measure_all(options.model, count, options.seed, options.weights)
        errors, drawn = paper_errors(['exact', *(m for m in options.model if m == 'mlp')],
                                     options.weights, 10 if options.quick else 1)
    except WeightsError as error:
        print(f'accuracy: {error}', file=sys.stderr)
        return 1
    broken = [text for result in results for text in result.broken]
    if 'mlp' in errors:
        mae = figures(errors['mlp'])['MAE']
        if not mae <= MAE_LIMIT:
            broken.append(f"mlp, the paper's external set: MAE {mae:.4f} > {MAE_LIMIT:g} rad")
        if len(errors['mlp']) != drawn:
            broken.append(f"mlp, the paper's external set: "
                          f'{drawn - len(errors["mlp"])} contacts missed')
    given = sys.argv[1:] if args is None else args
    write_csv(options.out / 'accuracy.csv', results)
    command = ' '.join(['python -m box_contact_ros accuracy', *given])
    (options.out / 'accuracy.md').write_text(
        page(results, errors, drawn, command, options.seed, broken), encoding='utf-8')
    draw(options.out / 'accuracy.png', results)
    print(table(results), class_table(results), paper_table(errors, drawn), sep='\n\n')
    for text in broken:
        print(f'accuracy: limit broken: {text}', file=sys.stderr)
    return 1 if broken else 0


def _measure_all(models: Sequence[str], count: int, seed: int, weights: str | None,
                 ) -> list[Result]:
    from tqdm import tqdm

    results = []
    with tqdm(total=len(SETS) * len(models), desc='accuracy', unit='set') as bar:
        for number, (name, make) in enumerate(SETS.items()):
            # A few draws miss, up to 3 in 100.
            drawn = make(np.random.default_rng([seed, number]), count + count // 20 + 10)
            pairs = Pairs(*(part[:count] for part in drawn))
            truth = ContactSolver((1, 1, 1), (1, 1, 1), model='exact').batch(
                pairs.pose_a, pairs.pose_b, size_a=pairs.size_a, size_b=pairs.size_b)
            for model in models:
                bar.set_postfix_str(f'{model}, {name}')
                result = measure(model, name, pairs, truth,
                                 weights if model == 'mlp' else None)
                if result is not None:
                    results.append(result)
                bar.update()
    return sorted(results, key=lambda r: models.index(r.model))


if __name__ == '__main__':
    sys.exit(main())
