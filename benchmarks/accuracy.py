# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `accuracy`: how far a model's contacts are from the exact ones, per set and class.

It measures point, volume and covariance. Every set of poses is drawn anew from `--seed`; model
`exact` gives the truth. It writes accuracy.csv (a row per model, set, quantity and part of the
set), accuracy.md and accuracy.png.

accuracy.md defines the classes. The pose decides which features meet, not the SAT axis that wins:
in stacks, half the winners are edge pairs although the contact is a patch.
"""
from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros.arguments import within
from box_contact_ros.core import DEPTH_FLOOR
from box_contact_ros.extras import require
from box_contact_ros.models.weights_file import WeightsError
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.pose import rotation_matrix

from . import output, settled
from .contestant import Contestant, model_or_class, ours
from .errors import ContactErrors, contact_errors
from .output import markdown_table
from .paper.numpy_model import turned
from .pose_sets import LOADS, SETS, THROUGH, Pairs, drawn

MEASURED = {**SETS, **LOADS, 'settled': settled.at_rest, **THROUGH}
"""Sets of poses: drawn ones, and recorded goods at rest of scenes that train no network."""
PAIRS, QUICK_PAIRS = 100_000, 5_000
CLASSES = ('vertex-face', 'edge-edge', 'edge-face', 'face-face')
OUTSIDE = 0.1  # distance from which a point is outside of a box [% of the edge]
LEAST = 1e-3  # error that is drawn to scale [%]; smaller ones are at the edge
MARKS = {'o': 'half of the pairs', '|': '99 %', 'D': 'worst pair'}
"""What is drawn of a set."""
CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
"""(8, 3) corners of a box of edge 1."""
FACE_LIKE = math.cos(math.radians(6.0))
"""Cosine of the angle to a face's normal up to which an edge pair's axis stands for the face."""


def classify(pairs: Pairs) -> np.ndarray:
    """Return indices (n,) into CLASSES of pairs that touch: see the module."""
    found = pairs.contacts()
    face_normals = np.concatenate([rotation_matrix(pose[:, 3:]) for pose in pairs[:2]], axis=2)
    steepest = np.abs(np.einsum('nik,ni->nk', face_normals, found.normal)).max(axis=1)
    through = _corners_through(pairs, found)
    classes = np.where(through <= 1, 0, np.where(through == 2, 2, 3))
    classes[(found.axis >= 6) & (steepest < FACE_LIKE)] = 1
    return classes


def _corners_through(pairs: Pairs, found: Contacts) -> np.ndarray:
    """Return how many corners (n,) of one box are below the best face of the other.

    Shallow pairs are pressed in to the minimum depth.
    """
    pressed = np.maximum(0.0, DEPTH_FLOOR * pairs.size + found.separation)
    offset = pairs.pose_b[:, :3] - pairs.pose_a[:, :3] - pressed[:, None] * found.normal
    a, b, size_a, size_b = pairs
    heights = np.concatenate([_heights(a, size_a, b, size_b, offset),
                              _heights(b, size_b, a, size_a, offset)], axis=1)
    best = np.where(found.axis < 6, found.axis, heights.min(axis=2).argmax(axis=1))
    return np.count_nonzero(heights[np.arange(len(best)), best] < 0.0, axis=1)


def _heights(pose: np.ndarray, size: np.ndarray, other: np.ndarray, other_size: np.ndarray,
             offset: np.ndarray) -> np.ndarray:
    """Return heights (n, 3, 8) of another box's corners above the three faces nearer to it [m].

    offset: (n, 3) from one centre to the other, either way.
    """
    back = rotation_matrix(pose[:, 3:]).swapaxes(1, 2)
    middle = np.abs(turned(back, offset)) - 0.5 * size
    reach = back @ rotation_matrix(other[:, 3:]) * other_size[:, None]
    return middle[:, :, None] + reach @ CORNERS.T


class Summary(NamedTuple):
    """Errors of some pairs, in %."""

    pairs: int
    mean: float
    p50: float
    p99: float
    worst: float


def by_part(errors: np.ndarray, classes: np.ndarray) -> dict[str, Summary]:
    """Return errors (n,) of all pairs and per class; empty parts are left out."""
    rows = {'all': np.ones(len(errors), bool)}
    rows |= {name: classes == k for k, name in enumerate(CLASSES)}
    parts = {name: errors[chosen] for name, chosen in rows.items() if chosen.any()}
    return {name: Summary(len(part), float(part.mean()), *output.percentiles(part, 50, 99, 100))
            for name, part in parts.items()}


@dataclass(frozen=True, kw_only=True)
class AccuracyRow:
    """One model on one set. The errors are those of pairs that touch by the model and `exact`."""

    model: str
    set: str
    errors: Mapping[str, Mapping[str, Summary]]  # by field of `ContactErrors`, then by part
    pairs: int
    outside: float  # share of points outside of a box by more than `OUTSIDE` [%]
    farthest: float  # point outside of a box [% of the edge]


def measure(model: Contestant, name: str, pairs: Pairs, truth: Contacts) -> AccuracyRow | None:
    """Measure a model on a set; None where the model is not for its sizes."""
    try:
        contacts = model.solve(pairs)
    except ValueError:
        if model.any_boxes:
            raise
        return None
    both = truth.colliding & contacts.colliding
    touching = pairs.rows(both)
    classes = classify(touching)
    errors = contact_errors(contacts[both], truth[both], touching.edge)
    beyond = 100.0 * touching.beyond(contacts[both].point) / touching.edge
    return AccuracyRow(
        model=model.name, set=name, pairs=len(both),
        outside=100.0 * float((beyond > OUTSIDE).mean()), farthest=max(0.0, float(beyond.max())),
        errors={quantity: by_part(values, classes) for quantity, values
                in errors._asdict().items() if np.isfinite(values).all()})


def measure_all(models: Sequence[Contestant], count: int, seed: int) -> list[AccuracyRow]:
    """Measure models on `count` pairs of every set, model by model."""
    from tqdm import tqdm

    rows = []
    for place, (name, make) in enumerate(tqdm(MEASURED.items(), desc='accuracy', unit='set')):
        pairs = drawn(make, np.random.default_rng([seed, place]), count)
        truth = pairs.contacts()
        rows += [measure(model, name, pairs, truth) for model in models]
    return [row for model in models for row in rows if row and row.model == model.name]


def error_table(rows: Sequence[AccuracyRow]) -> str:
    """Return mean/p99/worst of each quantity over whole sets, and which points are outside."""
    def cell(row: AccuracyRow, quantity: str) -> str:
        if quantity not in row.errors:
            return ''
        errors = row.errors[quantity]['all']
        return f'{errors.mean:.2g}, {errors.p99:.2g}, {errors.worst:.2g}'

    return markdown_table(
        ['model, set', *ContactErrors._fields, 'outside [%]', 'farthest [%]'],
        [[f'{row.model}, {row.set}', *(cell(row, name) for name in ContactErrors._fields),
          f'{row.outside:.2g}', f'{row.farthest:.2g}'] for row in rows])


def class_table(rows: Sequence[AccuracyRow]) -> str:
    """Return mean/p99/worst of the point per class, with the share of the pairs."""
    def cell(parts: Mapping[str, Summary], name: str) -> str:
        if name not in parts:
            return '–'
        errors, share = parts[name], 100.0 * parts[name].pairs / parts['all'].pairs
        return f'{errors.mean:.3f}/{errors.p99:.2f}/{errors.worst:.1f} ({share:.0f} %)'

    return markdown_table(['model, set', *CLASSES], [
        [f'{row.model}, {row.set}', *(cell(row.errors['point'], name) for name in CLASSES)]
        for row in rows])


def csv_rows(rows: Sequence[AccuracyRow]) -> Iterator[dict[str, object]]:
    """Yield a row per model, set, part and quantity: errors in %."""
    for row in rows:
        for quantity, parts in row.errors.items():
            for part, errors in parts.items():
                yield {'model': row.model, 'set': row.set, 'part': part, 'quantity': quantity,
                       **errors._asdict(), 'outside': row.outside, 'farthest': row.farthest}


def draw(path: Path, table: Path) -> None:
    """Draw half, 99 % and the worst of the CSV's point errors: a line for each set and model."""
    rows = [row for row in output.read_csv(table)
            if (row['quantity'], row['part']) == ('point', 'all')]
    models = list(dict.fromkeys(row['model'] for row in rows))
    figure, axes = output.subplots(1, 1, (6.4, 1.5 + 0.3 * len(rows)))
    axis = axes[0, 0]
    colours = [output.COLOURS.get(model, f'C{number}') for number, model in enumerate(models)]
    for place, row in enumerate(rows):
        values = np.maximum([float(row[column]) for column in ('p50', 'p99', 'worst')], LEAST)
        colour = colours[models.index(row['model'])]
        axis.plot(values, [place] * len(values), color=colour, linewidth=1.2)
        for (mark, label), value in zip(MARKS.items(), values):
            axis.plot(value, place, mark, color=colour, markersize=7, clip_on=False,
                      label='' if place else label)
    names = [row['set'] if len(models) == 1 else f'{row["set"]}, {row["model"]}' for row in rows]
    axis.set_yticks(range(len(rows)), names)
    axis.invert_yaxis()
    p99, worst = (max(float(row[column]) for row in rows) for column in ('p99', 'worst'))
    axis.set(xscale='log', xlim=(LEAST, 1.2 * worst),
             title=f'{" and ".join(models)}: p99 at most {p99:.2g} %, worst drawn {worst:.2g} %',
             xlabel="point error [% of the smaller box's longest edge]")
    axis.xaxis.set_major_formatter('{x:g}')
    axis.grid(color='0.9', linewidth=0.5)
    axis.set_axisbelow(True)
    figure.legend(fontsize=9, loc='outside lower center', ncols=3, frameon=False)
    figure.savefig(path, metadata={'Software': None})


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    parser = output.report_parser(
        'accuracy', __doc__, quick=f'{QUICK_PAIRS} pairs of each set', seed=2,
        out='accuracy.md, accuracy.csv, accuracy.png')
    parser.add_argument('--model', nargs='+', type=model_or_class, default=['mlp'],
                        metavar='MODEL', help='names, or package.module:Class (default: mlp)')
    parser.add_argument('--weights', help='weights file of MLP, default: the shipped one')
    parser.add_argument('--pairs', type=within(1), default=PAIRS,
                        help='of each set, default: %(default)s')
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    require('report')
    count = min(options.pairs, QUICK_PAIRS) if options.quick else options.pairs
    try:
        models = [ours(model, weights=options.weights if model == 'mlp' else None)
                  for model in options.model]
        rows = measure_all(models, count, options.seed)
    except WeightsError as error:
        print(f'accuracy: {error}', file=sys.stderr)
        return 1
    output.write_csv(folder / 'accuracy.csv', csv_rows(rows), about=output.machine())
    output.write_page(folder, 'accuracy', args, machine=output.machine(), seed=options.seed,
                      error_table=error_table(rows), point_classes=class_table(rows))
    draw(folder / 'accuracy.png', folder / 'accuracy.csv')
    print(error_table(rows), class_table(rows), sep='\n\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())
