# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables 1 and 2, Figure 9 and section 7 of the source paper: the errors of its networks.

The data sets are made again from the seed in each model card. The code that the solver uses runs
the weights of the checkout on them. Nothing is copied from the cards, and PyTorch is not used.
"""
from __future__ import annotations

import functools
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np

from box_contact_ros.models.weights_file import Weights, load_weights

from .. import output
from ..contestant import Contestant, ours
from ..errors import degrees_between, distances
from ..pose_sets import CUBE, Pairs
from . import dataset
from .dataset import SETS, Patterns, Placements
from .errors import errors_of, figures, predict
from .models import EXPERTS, committee, weights_path

PAPER = {
    1: {'ME': (0.0332, 0.0259, -0.0005), 'MAE': (0.4161, 0.4383, 0.5624),
        'RMSE': (0.6947, 0.7363, 0.8667)},
    2: {'ME': (-0.0008, 0.0031, 0.0467), 'MAE': (0.2765, 0.2883, 0.4523),
        'RMSE': (0.5410, 0.5748, 0.7302)},
}
"""The paper's figures [rad], by table: training, cross-validation, external validation."""
TABLE_1 = {'as written': 'table-1-as-written', 'mixture': 'table-1-mixture',
           'dropped': 'table-1-dropped'}
"""Files of Table 1's networks, one network a seed, by what the table calls them."""
TABLE_2 = 'table-2-by-signs'
"""File of Table 2's networks, one network a subset."""
SHADES = ('0.65', 'black', '0.4')
"""Of Table 1's variants, in its picture."""
SHOWN = 150  # patterns in Figure 9
COUNT = 20_000  # placements of each kind that the committee is asked for
SEED = 37  # other placements than any training's
PRESSED = 1e-9  # by which they are made to overlap, so that rounding parts none [m]

Errors = dict[str, np.ndarray]  # errors (n, 4) [rad] by set


@functools.cache  # some tables and figures share them; they take seconds to make
def with_sets(name: str) -> tuple[Weights, dict[str, dict[str, Patterns]]]:
    """Return a weights file, and the sets of its card by network and name."""
    weights = load_weights(weights_path(name))
    return weights, dataset.of_card(weights.card)


def evaluate(name: str, step: int = 1) -> dict[str, Errors]:
    """Return errors of a file's networks on its sets, every `step`-th pattern.

    Differences are wrapped if they were in training.
    """
    weights, sets = with_sets(name)
    wrap = weights.card['data'].get('wrap', True)
    return {network: {one: errors_of(weights.networks[network], p.inputs[::step],
                                     p.outputs[::step], wrap) for one, p in patterns.items()}
            for network, patterns in sets.items()}


def _number(value: float) -> str:
    """Return a value with four decimals, zero without a sign."""
    return f'{round(value, 4) + 0.0:.4f}'


def table_2(found: Errors) -> str:
    """Return Table 2: the paper's figures and ours, per set."""
    rows = [[figure, *[_number(value) for name, their in zip(SETS, theirs)
                       for value in (their, figures(found[name])[figure])]]
            for figure, theirs in PAPER[2].items()]
    return output.markdown_table(
        ['', *[f'{name}, {who}' for name in SETS for who in ('paper', 'by signs')]], rows)


Trainings = Mapping[str, Sequence[Errors]]  # errors of each seed by the name of the variant


def over_seeds(values: Sequence[float]) -> str:
    """Return mean ± standard deviation."""
    mean = round(float(np.mean(values)), 3) + 0.0  # zero without a sign
    return f'{mean:.3f} ± {np.std(values, ddof=1):.3f}'


def table_1(found: Trainings) -> str:
    """Return Table 1: the paper's figures and ours over the seeds, a row per set and figure."""
    rows = [[name, figure, _number(theirs[place]),
             *[over_seeds([figures(errors[name])[figure] for errors in seeds])
               for seeds in found.values()]]
            for place, name in enumerate(SETS) for figure, theirs in PAPER[1].items()]
    return output.markdown_table(['set', '', 'paper', *found], rows, words=2)


def draw_table_1(path: Path, found: Trainings) -> None:
    """Draw MAE and RMSE of all sets: the paper's, and ours with their deviations over the seeds."""
    picture, axes = output.subplots(1, 2, (9.0, 2.9), sharey=True)
    for axis, figure in zip(axes[0], ('MAE', 'RMSE')):
        axis.plot(PAPER[1][figure], range(len(SETS)), 'D', color=output.COLOURS['paper'],
                  markersize=8, label='the paper')
        for place, (name, seeds) in enumerate(found.items()):
            values = np.array([[figures(errors[one])[figure] for one in SETS] for errors in seeds])
            axis.errorbar(values.mean(axis=0), np.arange(len(SETS)) + 0.14 * (place + 1),
                          xerr=values.std(axis=0, ddof=1), fmt='o', markersize=5,
                          color=SHADES[place], label=name)
        axis.set(xlabel=f'{figure} [rad]', xlim=(0.0, None), ylim=(len(SETS) - 0.4, -0.4))
        axis.grid(color='0.9', linewidth=0.5)
        axis.set_axisbelow(True)
    axes[0, 0].set_yticks(range(len(SETS)), SETS)
    picture.suptitle("The mixture gives the paper's errors; the pairs that model paper solves are "
                     'easier', fontsize=12)
    picture.legend(*axes[0, 0].get_legend_handles_labels(), loc='outside lower center', ncols=4,
                   fontsize=9, frameon=False)
    picture.savefig(path, metadata={'Software': None})


def by_output(seeds: Sequence[Errors]) -> str:
    """Return MAE and RMSE of each output on the external set."""
    rows = [[figure, *[over_seeds([
        figures(errors['external'][:, output])[figure] for errors in seeds])
        for output in range(len(dataset.OUTPUTS))]] for figure in ('MAE', 'RMSE')]
    return output.markdown_table(['', *dataset.OUTPUTS], rows)


def spread_of_outputs(seeds: Sequence[Errors]) -> float:
    """Return the largest MAE of an output on the external set divided by the smallest."""
    mae = np.mean([np.abs(errors['external']).mean(axis=0) for errors in seeds], axis=0)
    return float(mae.max() / mae.min())


def _page(name: str, **values: object) -> str:
    return output.page(f'benchmarks/paper/pages/{name}', **values)


def of_each_kind(step: int) -> dict[str, Placements]:
    """Return placements by kind of contact, new ones for every network."""
    rng = np.random.default_rng(SEED)
    kinds = zip(EXPERTS, (*dataset.GENERATORS, dataset.face_face_candidates))
    return {kind: dataset.touching(rng, COUNT // step, candidates)
            for kind, candidates in kinds}


def model_errors(model: Contestant, some: Placements) -> tuple[float, float]:
    """Return the mean error of the point [mm] and of the normal [deg] against the labels."""
    a, b = dataset.as_poses(some.inputs)
    b[:, :3] -= PRESSED * dataset.query(some).normal
    sizes = np.tile(CUBE, (len(a), 1))
    found = model.solve(Pairs(a, b, sizes, sizes))
    return (1e3 * float(distances(found.point, some.point).mean()),
            float(degrees_between(found.normal, some.normal).mean()))


def section_7(step: int) -> str:
    """Return the section: errors by model and kind, and how often the classifier is wrong."""
    kinds = of_each_kind(step)
    rows = []
    for model in (ours('paper'), ours(committee(), name='paper-committee')):
        row: list[object] = [f'`{model.name}`']
        for some in kinds.values():
            point, normal = model_errors(model, some)
            row += [f'{point:.0f}', f'{normal:.1f}']
        rows.append(row)
    head = [f'{kind}: {what}' for kind in kinds for what in ('point [mm]', 'normal [°]')]
    card = load_weights(weights_path('paper-committee')).card
    return _page('committee', table=output.markdown_table(['', *head], rows), count=COUNT // step,
                 wrong=100 * card['metrics']['classifier']['external']['wrong'])


def sections_1_and_2(tables: Collection[int], step: int, folder: Path) -> list[str]:
    """Return Tables 1 and 2, those of them that were chosen, and their notes; draw the first."""
    sections = []
    if 1 in tables:
        found = {title: list(evaluate(name, step).values()) for title, name in TABLE_1.items()}
        card = with_sets(TABLE_1['mixture'])[0].card
        shares = card['data']['kept']
        draw_table_1(folder / 'paper_table_1.png', found)
        sections.append(_page('table_1', table=table_1(found), seeds=len(card['data']['seeds']),
                              by_output=by_output(found['mixture']),
                              inside=100 * shares[0], beyond=100 * shares[2],
                              spread=spread_of_outputs(found['mixture']),
                              starts=card['training']['seed_1']['starts']))
    if 2 in tables:
        subsets = evaluate(TABLE_2, step).values()
        pooled = {name: np.concatenate([errors[name] for errors in subsets]) for name in SETS}
        above = [100.0 * (figures(pooled[name])[figure] / theirs[place] - 1.0)
                 for figure, theirs in PAPER[2].items() if figure != 'ME'
                 for place, name in enumerate(SETS)]
        sections.append(_page('table_2', table=table_2(pooled), least=min(above), most=max(above)))
    if 1 in tables:
        sections.append(section_7(step))
    return [*sections, _page('tables_1_2')]


def draw_figure_9(path: Path) -> None:
    """Draw the first output of the first seed, desired and modelled."""
    weights, sets = with_sets(TABLE_1['mixture'])
    patterns = sets['seed_1']['external']
    wanted = patterns.outputs[:SHOWN, 0]
    order = np.argsort(wanted, kind='stable')
    said = predict(weights.networks['seed_1'], patterns.inputs[:SHOWN])[order, 0]
    picture, ((axes,),) = output.subplots(1, 1, (7.0, 4.2))
    axes.plot(wanted[order], color='black', label='desired')
    axes.plot(said, '.', color='tab:red', markersize=5, label='modelled')
    off = np.median(np.abs(said - wanted[order]))
    axes.set(ylabel='azimuth of the point [rad]', xlabel='pattern of the external set, sorted',
             title=f'Half of the modelled azimuths are off by {off:.2f} rad or more')
    axes.grid(color='0.9', linewidth=0.6)
    axes.legend(loc='upper left')
    picture.savefig(path)
