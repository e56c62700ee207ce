"""Program `paper`: Tables 1 and 2 of the source paper, its figures beside ours, as Markdown.

The data sets are made again from the seed in each model card, and the shipped weights are run on
them by the kernel that the solver uses. Nothing is copied from the cards, and PyTorch is not used.
"""
from __future__ import annotations

import argparse
import platform
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..network import Weights, WeightsError, load_weights
from ..resources import resource_path
from ..training import dataset
from ..training.dataset import SETS, Patterns
from ..training.errors import PARTS, errors_of, figures, figures_by_part

PAPER = {
    1: {'ME': (0.0332, 0.0259, -0.0005), 'MAE': (0.4161, 0.4383, 0.5624),
        'RMSE': (0.6947, 0.7363, 0.8667)},
    2: {'ME': (-0.0008, 0.0031, 0.0467), 'MAE': (0.2765, 0.2883, 0.4523),
        'RMSE': (0.5410, 0.5748, 0.7302)},
}
"""The paper's figures [rad], by table: training, cross-validation, external validation."""

QUICK = 10
"""`--quick` looks at every tenth pattern."""

_DATA_AS_DRAWN = """\
- `paper` was trained on the data as drawn. `paper, folded` is the same network on the same boxes,
  brought by their symmetries to t ≥ 0 and angles in [−π/2, π/2], as the solver asks it."""
_FOLDED_DATA = """\
- `paper`: on data brought by the boxes' symmetries to t ≥ 0 and angles in [−π/2, π/2], as the
  solver asks it; the paper's were not."""

Errors = dict[str, np.ndarray]
"""Wrapped errors (n, 4) [rad] by set."""


def evaluate(weights: Weights, step: int = 1) -> dict[str, Errors]:
    """Errors of every network of a file on the sets of its card, every `step`-th pattern."""
    return {network: _errors(weights, network, sets, step)
            for network, sets in dataset.of_card(weights.card).items()}


def _errors(weights: Weights, network: str, sets: Mapping[str, Patterns], step: int) -> Errors:
    return {name: errors_of(weights.networks[network], p.inputs[::step], p.outputs[::step])
            for name, p in sets.items()}


def _rows(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ['---', *['---:'] * (len(head) - 1)], *rows]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def _number(value: float) -> str:
    """Four decimals, zero without a sign."""
    return f'{round(value, 4) + 0.0:.4f}'


def beside_paper(number: int, columns: Mapping[str, Errors]) -> str:
    """One of the paper's tables: its figures and ours, per set."""
    head = ['', *[f'{name}, {who}' for name in SETS for who in ('paper', *columns)]]
    rows = []
    for figure, theirs in PAPER[number].items():
        row = [figure]
        for name, their in zip(SETS, theirs):
            row += [_number(their), *[_number(figures(errors[name])[figure])
                                      for errors in columns.values()]]
        rows.append(row)
    return _rows(head, rows)


def by_part(columns: Mapping[str, Errors]) -> str:
    """Our figures on all sets, for all outputs, the point's and the normal's."""
    rows = []
    for title, errors in columns.items():
        for name in SETS:
            parts = figures_by_part(errors[name])
            rows.append([title, name, f'{len(errors[name]):,}',
                         *[_number(parts[part][figure]) for part in PARTS
                           for figure in ('ME', 'MAE', 'RMSE')]])
    head = ['', 'set', 'patterns', *[f'{figure}, {part}' for part in PARTS
                                     for figure in ('ME', 'MAE', 'RMSE')]]
    return _rows(head, rows)


def processor() -> str:
    """Name of the machine's processor."""
    try:
        text = Path('/proc/cpuinfo').read_text()
    except OSError:
        text = ''
    for line in text.splitlines():
        if line.startswith('model name'):
            return line.partition(':')[2].strip()
    return platform.processor() or platform.machine()


def report(*, step: int = 1) -> str:
    """The whole page."""
    jumps = load_weights(resource_path('weights', 'paper.safetensors'))
    smooth = load_weights(resource_path('weights', 'paper-continuous.safetensors'))
    boxes = load_weights(resource_path('weights', 'paper-12.192x2.438x2.591.safetensors'))
    ours = evaluate(jumps, step)['contact']
    subsets = evaluate(smooth, step)
    pooled = {name: np.concatenate([errors[name] for errors in subsets.values()])
              for name in SETS}
    detail, folding = {'paper': ours}, _FOLDED_DATA
    if not jumps.card['data']['folded_in']:
        # The sets as the solver would ask: the same boxes, brought into its domain.
        card = {**jumps.card, 'data': {**jumps.card['data'], 'folded_in': True}}
        in_domain = dataset.of_card(card)['contact']
        detail['paper, folded'] = _errors(jumps, 'contact', in_domain, step)
        folding = _DATA_AS_DRAWN
    detail |= {**subsets, 'containers': evaluate(boxes, step)['contact']}
    quick = '' if step == 1 else f' Quick run: every {step}th pattern only.'
    return f"""# The paper's Tables 1 and 2, redone

Made by `python -m box_contact_ros paper --out docs/paper_tables.md` on {processor()}, from the
shipped weights and the seeds in their model cards.{quick} Errors in rad over the four output
angles, differences wrapped so that −π and π are the same direction; the azimuth of the poles is 0.

## Table 1: with discontinuities, one network 6-20-18-4

{beside_paper(1, {'ours': ours})}

## Table 2: without discontinuities, one network 6-20-17-4 per subset

{beside_paper(2, {'ours': pooled})}

Ours is over both subsets taken together; each has as many patterns as the paper's set.

## What differs from the paper

- Table 1: the data are those of section 3, with points and angles drawn at random instead of on
  grids the paper does not give. Equal halves are vertex-face and edge-edge.
- Table 2: the paper does not say what its subsets are. Here SAT's winning axis, found from the pose
  alone, chooses between two, and the cube's symmetries bring the features that meet to fixed
  places. Some outputs are then constant by construction: the normal's two angles in vertex-face,
  the normal's elevation and the point's azimuth in edge-edge. That is why its errors are so much
  smaller than the paper's: it is an easier problem, not a like-for-like comparison.
- The networks are the paper's (two hidden layers of tanh, linear output, backpropagation with
  momentum stopped by cross-validation), with a learning rate that falls over the epochs, and the
  best of several starts by the cross-validation error.

## Ours in detail

`all` is over the four outputs, `point` and `normal` over the two angles of each.

{by_part(detail)}

{folding}
- `vertex_face`, `edge_edge`: the two subsets of Table 2.
- `containers`: a network 6-20-18-4 for two boxes of 12.192 × 2.438 × 2.591 m, on folded data.
"""


def main(args: Sequence[str] | None = None) -> int:
    """Print the tables, or write them to a file."""
    parser = argparse.ArgumentParser(
        description='Tables 1 and 2 of the source paper beside the shipped weights, as Markdown.')
    parser.add_argument('--out', type=Path, help='file to write (default: print)')
    parser.add_argument('--quick', action='store_true',
                        help=f'look at every {QUICK}th pattern only')
    options = parser.parse_args(args)
    try:
        page = report(step=QUICK if options.quick else 1)
    except (WeightsError, FileNotFoundError) as error:
        print(f'paper: {error}', file=sys.stderr)
        return 1
    if options.out is None:
        print(page, end='')
        return 0
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(page, encoding='utf-8')
    print(f'written to {options.out}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
