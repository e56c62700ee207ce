# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Make the data, fit the networks, write the weights files with their model cards.

Measured on a machine with two cores, of which a training uses one:
  mlp               any two boxes                                  5 minutes
  paper             two boxes of edge 2, with discontinuities      2 minutes
  containers        two boxes of 12.192 x 2.438 x 2.591 m          2 minutes
  paper-continuous  without discontinuities, a network per subset  8 minutes
  paper-committee   a classifier, and a network for each class     7 minutes
  table-1-...       each of the three columns of Table 1, 5 seeds  5 minutes
  table-2-by-signs  without discontinuities, by signs of angles   10 minutes

The first three are shipped with the package. The others are for the tables of benchmarks.paper.
"""
from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch

from benchmarks.arguments import report_parser
from benchmarks.output import QUICK_RESULTS, make_folder
from benchmarks.paper import jobs
from box_contact_ros.solver.arguments import within
from box_contact_ros.solver.mlp import NETWORK, UNITS_MAX
from box_contact_ros.solver.weights_file import load_weights

from . import recipe

MLP = 'mlp'
NAMES = (MLP, *jobs.JOBS)
SHIPPED_HEADER = Path(__file__).parents[1].joinpath(
    'box_contact_ros', 'core', 'src', 'mlp', 'shipped_network.hpp')
"""The shipped weights as the library has them."""
QUICK_COUNTS, QUICK_STARTS, QUICK_EPOCHS = (1000, 500, 2000), 3, 70
"""`--quick`, for the paper's: enough to see the error fall, in seconds."""


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    parser = report_parser('python -m training', __doc__, seed=1,
                           quick='small sets and few epochs, to try it out in seconds')
    parser.add_argument('what', nargs='+', choices=(*NAMES, 'all'), metavar='WHAT',
                        help=f'{", ".join(NAMES)}, or all')
    parser.add_argument('--hidden', type=within(1, UNITS_MAX), metavar='UNITS', help='units of the '
                        f'hidden layer of mlp (default: {recipe.HIDDEN}), named in the file')
    parser.add_argument('--out', type=Path, metavar='DIR',
                        help='folder to write to (default: weights/, benchmarks/paper/weights/ for '
                        'what the tables alone need, and quick-results/ with --quick)')
    options = parser.parse_args(args)
    if options.quick and options.out is None:
        options.out = QUICK_RESULTS
    if options.out is not None:
        make_folder(parser, options.out)
    return options


def _commit() -> str:
    try:
        done = subprocess.run(['git', 'rev-parse', 'HEAD'], cwd=Path(__file__).parent,
                              capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return 'unknown'
    return done.stdout.strip()


def _train_mlp(options: argparse.Namespace) -> None:
    name = f'{MLP}-{options.hidden}' if options.hidden else MLP
    path = (options.out or jobs.SHIPPED) / f'{name}.safetensors'
    card = recipe.train(path, seed=options.seed, commit=_commit(), quick=options.quick,
                        hidden=options.hidden or recipe.HIDDEN)
    print(f'{path}, {card["training"]["minutes"]} min\n{recipe.metrics_table(card)}')
    if name == MLP and options.out is None:
        network = load_weights(path).networks[NETWORK]
        SHIPPED_HEADER.write_text(recipe.header(network.layers), encoding='utf-8')
        print(f'{SHIPPED_HEADER}: build the library anew')


def _train_paper(options: argparse.Namespace, job: jobs.PaperJob) -> None:
    if options.quick:
        job = replace(job, counts=QUICK_COUNTS, seeds=job.seeds[:1], settings=replace(
            job.settings, networks=QUICK_STARTS, epochs=QUICK_EPOCHS))
    folder = options.out or job.folder
    card = jobs.train_paper(job, seed=options.seed, commit=_commit(), folder=folder)
    print(f'{folder / job.name}.safetensors, {card["training"]["minutes"]} min\n'
          f'{jobs.metrics_table(card)}')


def main(args: Sequence[str] | None = None) -> int:
    """Train what the arguments name."""
    options = _options(args)
    torch.set_num_threads(1)  # matrices this small gain nothing from more
    for name in NAMES if 'all' in options.what else dict.fromkeys(options.what):
        if name == MLP:
            _train_mlp(options)
        else:
            _train_paper(options, jobs.JOBS[name])
    return 0


if __name__ == '__main__':
    sys.exit(main())
