# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `paper`: the source paper's Tables 1 to 4 and Figures 4, 9 and 10, redone, as Markdown.

For Tables 1 and 2 and Figure 9, the data sets are made again from the seed in each model card. The
code that the solver uses runs the shipped weights on them. Nothing is copied from the cards, and
PyTorch is not used. Tables 3 and 4 and Figures 4 and 10 need python-fcl. The program makes all of
them, unless some are chosen.
"""
from __future__ import annotations

import functools
import sys
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np

from box_contact_ros.core import native
from box_contact_ros.resources import resource_path
from box_contact_ros.solver.arguments import program_parser
from box_contact_ros.solver.weights_file import Weights, WeightsError, load_weights

from .. import output
from . import committee, dataset
from .dataset import SETS, Patterns
from .errors import PARTS, errors_of, figures, figures_by_part, predict

PAPER = {
    1: {'ME': (0.0332, 0.0259, -0.0005), 'MAE': (0.4161, 0.4383, 0.5624),
        'RMSE': (0.6947, 0.7363, 0.8667)},
    2: {'ME': (-0.0008, 0.0031, 0.0467), 'MAE': (0.2765, 0.2883, 0.4523),
        'RMSE': (0.5410, 0.5748, 0.7302)},
}
"""The paper's figures [rad], by table: training, cross-validation, external validation."""
PAPER_SOUP = {8: (1.10, 11233, 11.52), 10: (1.47, 14323, 15.47), 12: (1.85, 17911, 19.2),
              14: (1.94, 21789, 23.13), 16: (2.13, 24667, 24.63), 18: (2.31, 26517, 28.0),
              20: (2.72, 30475, 32.44), 22: (2.90, 35411, 36.77)}
"""By N: Table 3's mean time [ms]; Table 4's largest number of tests, and its time [ms]."""
PAPER_NETWORK = 0.5  # the paper's time of its network [ms]

TABLE_1 = {'as written': 'table-1-as-written', 'as written, grid': 'table-1-on-grid',
           'dropped': 'table-1-dropped', 'folded': 'table-1-folded'}
"""Files of Table 1's networks, one network a seed, by what the table calls them."""
TABLES, FIGURES = (1, 2, 3, 4), (4, 9, 10)
QUICK = 10  # `--quick` looks at every tenth pattern
SHOWN = 150  # patterns in Figure 9

Errors = dict[str, np.ndarray]  # errors (n, 4) [rad] by set


def shipped(name: str) -> tuple[Weights, dict[str, dict[str, Patterns]]]:
    """Return a shipped weights file, and the sets of its card by network and name."""
    return _loaded(resource_path('weights', f'{name}.safetensors'))


@functools.lru_cache(maxsize=4)  # some tables and figures share them; they take seconds to make
def _loaded(path: Path) -> tuple[Weights, dict[str, dict[str, Patterns]]]:
    weights = load_weights(path)
    return weights, dataset.of_card(weights.card)


def evaluate(name: str, step: int = 1) -> dict[str, Errors]:
    """Return errors of a shipped file's networks on its sets, every `step`-th pattern.

    Differences are wrapped if they were in training.
    """
    weights, sets = shipped(name)
    wrap = weights.card['data'].get('wrap', True)
    return {network: {one: errors_of(weights.networks[network], p.inputs[::step],
                                     p.outputs[::step], wrap) for one, p in patterns.items()}
            for network, patterns in sets.items()}


def _number(value: float) -> str:
    """Return a value with four decimals, zero without a sign."""
    return f'{round(value, 4) + 0.0:.4f}'


def beside_paper(number: int, columns: Mapping[str, Errors]) -> str:
    """Return one of the paper's tables: its figures and ours, per set."""
    rows = []
    for figure, theirs in PAPER[number].items():
        row = [figure]
        for name, their in zip(SETS, theirs):
            row += [_number(their), *[_number(figures(errors[name])[figure])
                                      for errors in columns.values()]]
        rows.append(row)
    return output.markdown_table(
        ['', *[f'{name}, {who}' for name in SETS for who in ('paper', *columns)]], rows)


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


def by_output(found: Trainings) -> str:
    """Return MAE and RMSE of each output on the external set."""
    rows = [[title, figure, *[over_seeds([
        figures(errors['external'][:, output])[figure] for errors in seeds])
        for output in range(len(dataset.OUTPUTS))]]
        for title, seeds in found.items() for figure in ('MAE', 'RMSE')]
    return output.markdown_table(['', '', *dataset.OUTPUTS], rows, words=2)


def by_part(columns: Mapping[str, Errors]) -> str:
    """Return our figures on all sets, for all outputs, the point's and the normal's."""
    rows = []
    for title, errors in columns.items():
        for name in SETS:
            parts = figures_by_part(errors[name]).values()
            rows.append([title, name, f'{len(errors[name]):,}',
                         *[_number(value) for part in parts for value in part.values()]])
    return output.markdown_table(
        ['', 'set', 'patterns', *[f'{figure}, {part}' for part in PARTS for figure in PAPER[1]]],
        rows)


def _page(name: str, **values: object) -> str:
    return output.page(f'benchmarks/paper/pages/{name}', **values)


def sections_1_and_2(tables: Collection[int], step: int) -> list[str]:
    """Return Tables 1 and 2, those of them that were chosen, and their notes."""
    sections, detail = [], {}
    if 1 in tables:
        found = {title: list(evaluate(name, step).values()) for title, name in TABLE_1.items()}
        card = shipped(TABLE_1['as written'])[0].card
        sections.append(_page('table_1', table=table_1(found), by_output=by_output(found),
                              seeds=len(card['data']['seeds']),
                              starts=card['training']['seed_1']['starts']))
        detail['paper'] = evaluate('paper', step)['contact']
    if 2 in tables:
        subsets = evaluate('paper-continuous', step)
        pooled = {name: np.concatenate([errors[name] for errors in subsets.values()])
                  for name in SETS}
        detail |= subsets
        sections.append(_page('table_2', table=beside_paper(2, {'ours, easier': pooled})))
    if 1 in tables:
        detail['containers'] = evaluate('paper-12.192x2.438x2.591', step)['contact']
        sections.append(committee.section(step))
    return [*sections, _page('tables_1_2', by_part=by_part(detail))]


def draw_figure_9(path: Path) -> None:
    """Draw the first output, desired and modelled."""
    picture, panels = output.subplots(2, 1, (8.0, 7.6), sharex=True)
    for axes, (name, network) in zip(panels.flat, (('paper', 'contact'),
                                                   ('paper-continuous', 'vertex_face'))):
        weights, sets = shipped(name)
        patterns = sets[network]['external']
        wanted = patterns.outputs[:SHOWN, 0]
        order = np.argsort(wanted, kind='stable')
        said = predict(weights.networks[network], patterns.inputs[:SHOWN])[:, 0]
        axes.plot(wanted[order], color='black', label='desired')
        axes.plot(said[order], '.', color='tab:red', markersize=5, label='modelled')
        axes.set(title=name if network == 'contact' else f'{name}, {network}',
                 ylabel='azimuth of the point [rad]')
        axes.grid(color='0.9', linewidth=0.6)
    panels[0, 0].legend()
    axes.set_xlabel('pattern of the external set, sorted')
    picture.savefig(path)


def report(tables: Collection[int], drawn: Collection[int], *, quick: bool = False,
           folder: Path | None = None) -> str:
    """Return the page with some of the tables and figures; files go to `folder`, if any."""
    note = f' Quick run: every {QUICK}th pattern only, and fewer for the soup.' if quick else ''
    sections = [output.page('benchmarks/pages/paper',
                            machine=output.machine(native), note=note)]
    if {1, 2} & set(tables):
        sections += sections_1_and_2(tables, QUICK if quick else 1)
    if 9 in drawn:
        if folder:
            draw_figure_9(folder / 'paper_figure_9.png')
        sections.append(_page('figure_9', shown=SHOWN))
    if 4 in drawn:
        from . import rotation  # only here: python-fcl is an extra

        rows = rotation.measure(quick=quick)
        if folder:
            rotation.draw(rows, folder / 'paper_figure_4.png')
        sections.append(rotation.section(rows))
    if {3, 4} & set(tables) or 10 in drawn:
        from . import paper_soup_tables  # only here: python-fcl is an extra

        _, sets = shipped('paper')
        result = paper_soup_tables.measure(sets['contact']['external'].inputs, quick=quick)
        if folder:
            output.write_csv(folder / 'paper_soup.csv', result.rows,
                             about=output.machine(native, ('numpy', 'python-fcl')))
            if 10 in drawn:
                paper_soup_tables.draw_figure_10(result, folder / 'paper_figure_10.png')
        sections += [section(result) for number, section in paper_soup_tables.SECTIONS.items()
                     if number in {*tables, *drawn}]
        sections.append(paper_soup_tables.section_errors(result))
    return '\n'.join(sections)


def main(args: Sequence[str] | None = None) -> int:
    """Print the page, or write it to a file, with pictures in the same folder."""
    parser = program_parser('paper', __doc__, quick=f'look at every {QUICK}th pattern only, and at '
                            'fewer for the soup')
    parser.add_argument('--table', type=int, action='append', choices=TABLES,
                        help='only this table; may be given several times')
    parser.add_argument('--figure', type=int, action='append', choices=FIGURES,
                        help='only this figure; may be given several times')
    parser.add_argument('--out', type=Path,
                        help='file to write; pictures and paper_soup.csv go to the same folder '
                        '(default: print; pictures asked for by --figure go to the current folder)')
    options = parser.parse_args(args)
    chosen = options.table or options.figure
    tables = options.table or (() if chosen else TABLES)
    drawn = options.figure or (() if chosen else FIGURES)
    folder = Path() if options.figure else None
    if options.out is not None:
        folder = output.make_room(parser, options.out).parent
    try:
        page = report(tables, drawn, quick=options.quick, folder=folder)
    except (WeightsError, FileNotFoundError) as error:
        print(f'paper: {error}', file=sys.stderr)
        return 1
    if options.out is None:
        print(page, end='')
        return 0
    options.out.write_text(page, encoding='utf-8')
    print(f'written to {options.out}')
    return 0
