# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `accuracy`: how far a model's contacts are from the exact ones, per set and class.

It measures point, volume and covariance. Every set of poses is drawn anew from `--seed`; model
`exact` gives the truth. It writes accuracy.csv (a row per model, set, quantity and part of the
set), accuracy.md and accuracy.png. The exit status is 1 if `mlp` misses one of its limits or
differs from `exact` in a separation or normal. It is 1, too, for a point outside a box, and for too
many contacts that are left to `exact`.

accuracy.md defines the classes. The pose decides which features meet, not the SAT
axis that wins. In stacks, half the winners are edge pairs although the contact is a patch.
"""
from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros.core import DEPTH_FLOOR, Stages, native, stages
from box_contact_ros.resources import resource_path
from box_contact_ros.solver.arguments import add_models, model_name, program_parser, within
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.models import ModelEntry, models
from box_contact_ros.solver.weights_file import WeightsError, load_weights

from . import output, searched
from .contestant import Contestant, ours
from .errors import ContactErrors, contact_errors
from .paper import dataset
from .paper.errors import errors_of, figures, figures_by_part, wrapped
from .paper.paper_tables import PAPER
from .pose_sets import LOADS, SETS, Pairs, drawn


class Limit(NamedTuple):
    """Largest 99th percentile of each error allowed, in % as in `ContactErrors`."""

    point: float
    volume: float
    covariance: float
    in_plane: float


LOAD_LIMIT, ANY_POSE_LIMIT = Limit(0.05, 0.5, 1.0, 3.0), Limit(0.15, 1.0, 3.0, 8.0)
ANY_POSE = ('random cubes', 'touching', 'random sizes')
"""Sets in any pose; all others are loads on what they stand on."""
EXACT_SHARE, OF_BARS = 0.02, 0.12
"""Largest share of a set that `mlp` may leave to `exact`. Upper faces cut more off crossed bars."""
MAE_LIMIT = 0.005  # mean absolute error [rad] of `mlp` on the paper's external set
OUTSIDE = 2.0**-44
"""How far outside a box a point may be, of the size (5.7e-14), on top of the minimum depth."""

OPENED = 5e-12
"""By how much boxes of the paper's set may be apart [of the size]. Near a pitch of ±90° the angles
keep a pose to 12 digits only. Still far below the 1e-9 that boxes are pressed in."""

PAIRS, QUICK_PAIRS = 100_000, 5_000
CLASSES = ('vertex-face', 'edge-edge', 'edge-face', 'face-face')
WINNERS = ('face axis', 'edge axis')
SHOWN = (1e-6, 1.0)  # errors that are drawn [%]
MARKS = {('o', 'half of the pairs'): 50.0, ('|', '99 %'): 99.0, ('D', 'worst pair'): 100.0}
"""What is drawn of a set: marks, their names, and percentiles."""
FACE_LIKE = math.cos(math.radians(6.0))
"""Cosine of the angle to a face's normal up to which an edge pair's axis stands for the face."""


def limit_of(quantity: str, name: str) -> float:
    """Return the limit of a field of `ContactErrors` on a set."""
    return float(getattr(ANY_POSE_LIMIT if name in ANY_POSE else LOAD_LIMIT, quantity))


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


def outside(pairs: Pairs, found: Contacts) -> float:
    """Return the largest distance of a point from a box, of the size, beyond the pressing."""
    pressed = np.maximum(0.0, DEPTH_FLOOR + found.separation / pairs.size)
    beyond = pairs.beyond(found.point) / pairs.size - pressed
    # A point inside is no distance outside; pairs apart have NaN.
    return float(np.max(beyond[found.colliding], initial=0.0))


@dataclass(frozen=True, kw_only=True)
class AccuracyRow:
    """One model on one set."""

    model: str
    set: str
    errors: ContactErrors  # of the n pairs that touch by both
    classes: np.ndarray  # (n,) index into CLASSES
    winners: np.ndarray  # (n,) index into WINNERS
    pairs: int
    exact_share: float  # share of contacts answered by `exact`
    verdict_errors: int
    normal_difference: float  # largest difference of a component
    separation_difference: float  # largest, of the size
    outside: float  # farthest point outside a box, of the size

    @property
    def quantities(self) -> tuple[str, ...]:
        """Return the fields of `ContactErrors` that the model gives."""
        return ContactErrors._fields if np.isfinite(self.errors.volume).all() else ('point',)

    def parts(self) -> dict[str, ContactErrors]:
        """Return errors of all pairs, per class and per winner; empty parts are left out."""
        rows = {'all': self.classes >= 0}
        rows |= {name: self.classes == k for k, name in enumerate(CLASSES)}
        rows |= {name: self.winners == k for k, name in enumerate(WINNERS)}
        return {name: self.errors.rows(chosen) for name, chosen in rows.items() if chosen.any()}

    def broken(self) -> list[str]:
        """Return the limits of `mlp` that do not hold, in words."""
        if self.model != 'mlp':
            return []
        checks = {}
        for quantity, errors in self.errors._asdict().items():
            p99, most = statistics(errors)[1], limit_of(quantity, self.set)
            checks[f'{quantity}, p99 {p99:.3f} > {most:g} %'] = p99 <= most
        checks |= {
            f'{self.verdict_errors} verdicts differ': self.verdict_errors == 0,
            'normals differ': self.normal_difference == 0.0,
            'separations differ': self.separation_difference == 0.0,
            'points outside': self.outside <= OUTSIDE,
            f'exact answers {self.exact_share:.2%}':
                self.exact_share <= (OF_BARS if self.set == 'crossed bars' else EXACT_SHARE),
        }
        # Comparisons with NaN are false, so a NaN breaks its limit.
        return [f'{self.model}, {self.set}: {text}' for text, holds in checks.items() if not holds]


def measure(model: Contestant, name: str, pairs: Pairs, truth: Contacts) -> AccuracyRow | None:
    """Measure a model on a set; None where the model is not for its sizes."""
    try:
        found, left_to_exact = model.solve(pairs)
    except ValueError:
        if model.any_boxes:
            raise
        return None
    both = truth.colliding & found.colliding
    touching = pairs.rows(both)
    classes, winners = classify(touching)
    errors = contact_errors(*(Contacts(*(part[both] for part in contacts))
                              for contacts in (found, truth)), touching.edge)
    return AccuracyRow(
        model=model.name, set=name, errors=errors, classes=classes,
        winners=winners, pairs=len(both),
        exact_share=left_to_exact / max(1, int(found.colliding.sum())),
        verdict_errors=int((found.colliding != truth.colliding).sum()),
        normal_difference=float(np.abs(found.normal[both] - truth.normal[both]).max(initial=0.0)),
        separation_difference=float(
            (np.abs(found.separation - truth.separation) / pairs.size).max(initial=0.0)),
        outside=outside(pairs, found))


def drawn_pairs(count: int, seed: int) -> Iterator[tuple[str, Pairs, Contacts]]:
    """Yield name, `count` pairs and exact contacts of every set."""
    for number, (name, make) in enumerate({**SETS, **LOADS}.items()):
        pairs = drawn(make, np.random.default_rng([seed, number]), count)
        yield name, pairs, pairs.contacts()


def export(folder: Path, count: int, seed: int) -> None:
    """Write every set to a file .npz: poses and sizes, and the fields of the exact contacts."""
    for name, pairs, truth in drawn_pairs(count, seed):
        path = folder / f'{name.replace(" ", "_")}.npz'
        np.savez_compressed(path, **pairs._asdict(), **truth._asdict())
        print(f'{path}: {len(truth.colliding)} pairs')


def model_or_class(text: str) -> str:
    """Return the name of a model; `package.module:Class` becomes one in this process."""
    if ':' not in text:
        return model_name(text)
    sys.path.insert(0, '')  # modules of the current folder, however the program was started
    own = ModelEntry(name=text, line='a class of your own', builder=text,
                     takes=('size_a', 'size_b'))
    try:
        own.load()
    except (ImportError, AttributeError) as error:
        raise argparse.ArgumentTypeError(f'{text}: {error}') from error
    models()[text] = own
    return text


def _contestant(model: str, weights: str | None) -> Contestant:
    """Return a model; weights are those of `mlp`."""
    return ours(model, weights=weights if model == 'mlp' else None)


def measure_all(models: Sequence[str], count: int, seed: int, weights: str | None,
                ) -> list[AccuracyRow]:
    """Measure models on `count` pairs of every set, model by model."""
    from tqdm import tqdm

    rows = []
    with tqdm(total=len(SETS | LOADS) * len(models), desc='accuracy', unit='set') as bar:
        for name, pairs, truth in drawn_pairs(count, seed):
            for model in models:
                bar.set_postfix_str(f'{model}, {name}')
                rows.append(measure(_contestant(model, weights), name, pairs, truth))
                bar.update()
    return sorted(filter(None, rows), key=lambda row: models.index(row.model))


def statistics(errors: np.ndarray) -> tuple[float, float, float]:
    """Return mean, 99th percentile, worst."""
    return (float(errors.mean()), *output.percentiles(errors, 99, 100))


def paper_errors(models: Sequence[str], weights: str | None = None, step: int = 1,
                 ) -> tuple[dict[str, np.ndarray], int]:
    """Return wrapped errors (n, 4) [rad] on the paper's external set, per model, and n as drawn.

    Azimuth and elevation of the impact point, seen from the first box's centre, and of the normal.
    The set is that of the weights of model `paper`; `paper` is its network alone, asked as the
    paper did.
    """
    file = load_weights(resource_path('weights', 'paper.safetensors'))
    patterns = dataset.of_card(file.card, sets=('external',))['contact']['external']
    inputs, outputs = patterns.inputs[::step], patterns.outputs[::step]
    pose_a, pose_b = dataset.as_poses(inputs)
    size = file.card['sizes'][0]
    # The boxes touch exactly; writing their poses as angles has opened some.
    azimuth, elevation = outputs[:, 2], outputs[:, 3]
    normal = np.column_stack([np.cos(elevation) * np.cos(azimuth),
                              np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    pose_b[:, :3] -= OPENED * max(size) * normal
    sizes = np.tile(size, (len(pose_a), 1))
    pairs = Pairs(pose_a, pose_b, sizes, sizes)
    found = {'paper': errors_of(file.networks['contact'], inputs, outputs)}
    for model in models:
        contact, _ = _contestant(model, weights).solve(pairs)
        angles = np.concatenate([dataset.spherical(contact.point),
                                 dataset.spherical(contact.normal)], axis=1)
        found[model] = wrapped(angles - outputs)[contact.colliding]
    return found, len(outputs)


def paper_table(errors: dict[str, np.ndarray], drawn: int) -> str:
    """Return ME, MAE and RMSE, and those of Tables 1 and 2."""
    rows = [[f"paper's Table {number}, {title} discontinuities",
             *[f'{PAPER[number][name][2]:.4f}' for name in PAPER[number]], '', '', '']
            for number, title in ((1, 'with'), (2, 'without'))]
    for model, wrong in errors.items():
        overall, point, normal = figures_by_part(wrong).values()
        label = 'our network of Table 1, folded' if model == 'paper' else f'`{model}`'
        rows.append([label, *[f'{overall[name] + 0.0:.3g}' for name in PAPER[1]],
                     f'{point["MAE"]:.3g}', f'{normal["MAE"]:.3g}', f'{len(wrong):,} of {drawn:,}'])
    return output.markdown_table(['', *PAPER[1], 'point MAE', 'normal MAE', 'patterns'], rows)


def paper_broken(errors: dict[str, np.ndarray], drawn: int) -> list[str]:
    """Return what `mlp` breaks of its limits on the paper's external set."""
    if 'mlp' not in errors:
        return []
    mae, missed = figures(errors['mlp'])['MAE'], drawn - len(errors['mlp'])
    checks = {f'MAE {mae:.4f} > {MAE_LIMIT:g} rad': mae <= MAE_LIMIT,
              f'{missed} contacts missed': missed == 0}
    return [f"mlp, the paper's external set: {text}" for text, holds in checks.items() if not holds]


def table(rows: Sequence[AccuracyRow]) -> str:
    """Return what may not differ at all, and the share of contacts that `mlp` leaves to `exact`."""
    lines = [[f'{r.model}, {r.set}', f'{r.pairs:,}', f'{100.0 * r.exact_share:.3g} %',
              r.verdict_errors, f'{r.normal_difference:.2g}', f'{r.separation_difference:.2g}',
              f'{r.outside:.1g}'] for r in rows]
    return output.markdown_table(['model, set', 'pairs', 'left to exact', 'verdicts wrong',
                                  'normal off', 'separation off', 'outside'], lines)


def error_table(rows: Sequence[AccuracyRow]) -> str:
    """Return mean/p99/worst of each quantity over whole sets, with the limits of p99."""
    def cell(row: AccuracyRow, quantity: str) -> str:
        if quantity not in row.quantities:
            return ''
        mean, p99, worst = statistics(getattr(row.errors, quantity))
        return f'{mean:.2g} / {p99:.2g} / {worst:.2g}'

    lines = [[f'{r.model}, {r.set}', *(cell(r, name) for name in ContactErrors._fields),
              ' / '.join(f'{limit_of(name, r.set):g}' for name in ContactErrors._fields)
              if r.model == 'mlp' else ''] for r in rows]
    return output.markdown_table(
        ['model, set', 'point', 'volume', 'covariance', 'in-plane eigenvalues', 'limits of p99'],
        lines)


def class_table(rows: Sequence[AccuracyRow], quantity: str) -> str:
    """Return mean/p99/worst per class and winner, with the share of the pairs."""
    def cell(row: AccuracyRow, name: str) -> str:
        part = row.parts().get(name)
        if part is None:
            return '–'
        errors = getattr(part, quantity)
        mean, p99, worst = statistics(errors)
        share = 100.0 * len(errors) / len(row.classes)
        return f'{mean:.3f}/{p99:.2f}/{worst:.1f} ({share:.0f} %)'

    names = (*CLASSES, *WINNERS)
    return output.markdown_table(['model, set', *names], [
        [f'{row.model}, {row.set}', *(cell(row, name) for name in names)]
        for row in rows if quantity in row.quantities])


def csv_rows(rows: Sequence[AccuracyRow]) -> list[dict[str, object]]:
    """Return a row per model, set, part and quantity: errors in %, differences of the size.

    A row of a whole set ends with its limits, the point's also with what is known of the set only.
    """
    found: list[dict[str, object]] = []
    for row, quantity in [(one, name) for one in rows for name in one.quantities]:
        limit = limit_of(quantity, row.set) if row.model == 'mlp' else None
        for part, of_part in row.parts().items():
            errors = getattr(of_part, quantity)
            mean, p99, worst = statistics(errors)
            found.append({'model': row.model, 'set': row.set, 'part': part, 'quantity': quantity,
                          'pairs': len(errors), 'mean': mean, 'p50': float(np.median(errors)),
                          'p99': p99, 'worst': worst})
            if part == 'all':
                found[-1]['limit_p99'] = limit
            if part == 'all' and quantity == 'point':
                found[-1] |= {name: getattr(row, name) for name in (
                    'exact_share', 'verdict_errors', 'normal_difference', 'separation_difference',
                    'outside')}
    return found


def page(rows: Sequence[AccuracyRow], errors: dict[str, np.ndarray], drawn: int, command: str,
         seed: int, broken: Sequence[str]) -> str:
    """Return the Markdown page."""
    if broken:
        verdict = f'Goals missed: {"; ".join(broken)}.'
    elif any(row.model == 'mlp' for row in rows):
        verdict = 'All limits hold.'
    else:
        verdict = 'A model of your own has no limits.'
    return output.page(
        'benchmarks/pages/accuracy',
        command=command, machine=output.machine(native), seed=seed,
        verdict=verdict, table=table(rows), error_table=error_table(rows), mae_limit=MAE_LIMIT,
        point_classes=class_table(rows, 'point'), paper_table=paper_table(errors, drawn))


def draw(path: Path, rows: Sequence[AccuracyRow]) -> None:
    """Draw half, 99 % and the worst of the point errors: a line for each set and model."""
    models = list(dict.fromkeys(row.model for row in rows))
    figure, axes = output.subplots(1, 1, (7.5, 1.3 + 0.3 * len(rows)))
    axis = axes[0, 0]
    for place, row in enumerate(rows):
        values = [max(value, SHOWN[0]) for value in output.percentiles(
            row.errors.point, *MARKS.values())]
        colour = f'C{models.index(row.model)}'
        axis.plot(values, [place] * len(values), color=colour, linewidth=1.2)
        for (mark, label), value in zip(MARKS, values):
            axis.plot(value, place, mark, color=colour, markersize=7, clip_on=False,
                      label='' if place else label)
    names = [row.set if len(models) == 1 else f'{row.set}, {row.model}' for row in rows]
    axis.set_yticks(range(len(rows)), names)
    axis.invert_yaxis()
    axis.set(xscale='log', xlim=SHOWN, title=f'Point error of {" and ".join(models)}',
             xlabel="point error [% of the smaller box's longest edge]")
    axis.grid(color='0.9', linewidth=0.5)
    axis.set_axisbelow(True)
    axis.legend(fontsize=9, loc='lower right')
    figure.savefig(path)


def search(folder: Path, minutes: float, seeds: Sequence[int], args: Sequence[str] | None) -> int:
    """Search for the worst cases of `mlp`, print and write them; 1 if a limit is broken."""
    rows = searched.search(minutes, seeds)
    broken = [text for row in rows for text in row.broken()]
    output.write_csv(folder / 'searched.csv', searched.csv_rows(rows),
                     about=output.machine(native))
    (folder / 'searched.md').write_text(output.page(
        'benchmarks/pages/searched',
        command=output.command_line('box_contact_ros accuracy', args),
        machine=output.machine(native), seeds=' and '.join(map(str, seeds)), minutes=minutes,
        verdict=f'Goals missed: {"; ".join(broken)}.' if broken else 'All limits hold.',
        table=searched.table(rows)), encoding='utf-8')
    print(searched.table(rows))
    for text in broken:
        print(f'accuracy: goal missed: {text}', file=sys.stderr)
    return 1 if broken else 0


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write; 1 if a limit is broken."""
    parser = program_parser('accuracy', __doc__, quick=f'{QUICK_PAIRS} pairs a set', seed=2,
                            out='accuracy.md, accuracy.csv, accuracy.png')
    add_models(parser, '--model', ['mlp'], model_or_class)
    parser.add_argument('--export', type=Path, metavar='DIR',
                        help='only write the sets with their exact contacts as .npz')
    parser.add_argument('--search', type=within(0.0), metavar='MINUTES',
                        help='search for the worst cases of MLP instead, with each of two seeds; '
                             'writes searched.md and searched.csv')
    parser.add_argument('--weights', help='weights file of MLP, default: the shipped one')
    parser.add_argument('--pairs', type=within(1), default=PAIRS,
                        help='a set, default: %(default)s')
    options = parser.parse_args(args)
    count = min(options.pairs, QUICK_PAIRS) if options.quick else options.pairs
    if options.export:
        export(output.make_folder(parser, options.export), count, options.seed)
        return 0
    folder = output.results_folder(parser, options)
    if options.search is not None:
        return search(folder, options.search, [options.seed, options.seed + 1], args)
    try:
        rows = measure_all(options.model, count, options.seed, options.weights)
        errors, drawn = paper_errors(['exact', *(m for m in options.model if m == 'mlp')],
                                     options.weights, 10 if options.quick else 1)
    except WeightsError as error:
        print(f'accuracy: {error}', file=sys.stderr)
        return 1
    broken = [text for row in rows for text in row.broken()] + paper_broken(errors, drawn)
    output.write_csv(folder / 'accuracy.csv', csv_rows(rows), about=output.machine(native))
    command = output.command_line('box_contact_ros accuracy', args)
    (folder / 'accuracy.md').write_text(
        page(rows, errors, drawn, command, options.seed, broken), encoding='utf-8')
    draw(folder / 'accuracy.png', rows)
    print(table(rows), error_table(rows), class_table(rows, 'point'),
          paper_table(errors, drawn), sep='\n\n')
    for text in broken:
        print(f'accuracy: goal missed: {text}', file=sys.stderr)
    return 1 if broken else 0
