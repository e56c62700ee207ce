# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `train`: make the data, fit the networks, write weights/ with model cards.

What is trained, and with which settings, stands in `paper_recipe.paper_jobs` for the paper's
networks and in `mlp_recipe` for the MLP's. Everything else follows from the seed.
"""
from __future__ import annotations

import argparse
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch

from benchmarks.paper import paper_jobs
from box_contact_ros.output import make_folder
from box_contact_ros.resources import resource_path
from box_contact_ros.solver.arguments import program_parser, within
from box_contact_ros.solver.mlp import NETWORK, UNITS_MAX
from box_contact_ros.solver.weights_file import load_weights

from . import mlp_recipe

MLP = 'mlp'
NAMES = (*paper_jobs.JOBS, MLP)  # what can be asked for
SHIPPED_HEADER = Path(__file__).parents[1].joinpath(
    'box_contact_ros', 'core', 'src', 'mlp', 'shipped_network.hpp')
"""The shipped weights as the library has them."""
QUICK_COUNTS, QUICK_STARTS, QUICK_EPOCHS = (1000, 500, 2000), 3, 70
"""`--quick`, for the paper's: enough to see the error fall, in seconds."""


def _parser() -> argparse.ArgumentParser:
    parser = program_parser(
        'train', 'Make the data sets, fit the networks, write the weights files.\n\n'
        'Measured on a machine with two cores (each uses one):\n'
        '  paper             two boxes of edge 2, with discontinuities     2 minutes\n'
        '  paper-continuous  without discontinuities, one network a subset 8 minutes\n'
        '  paper-committee   a classifier, and a network for each class    7 minutes\n'
        '  containers        two boxes of 12.192 x 2.438 x 2.591 m         2 minutes\n'
        '  table-1-...       each of the four columns of Table 1, 5 seeds   5 minutes\n'
        '  mlp               any two boxes                                 5 minutes', seed=1,
        quick='small sets and few epochs, to try it out; needs --out')
    add = parser.add_argument
    add('what', nargs='*', metavar='what', help=f'{", ".join(NAMES)}, or all (default)')
    add('--starts', type=within(1), help='networks of the paper that are trained at once; the '
        'best is kept (default: 24 to 96, by job)')
    add('--epochs', type=within(1), help="passes through the training set, of the paper's "
        '(default: 300 to 1000, by job)')
    add('--hidden', type=within(1, UNITS_MAX), metavar='UNITS', help='units of the hidden '
        f'layer of the MLP (default: {mlp_recipe.HIDDEN}), named in the file')
    add('--steps', type=within(1),
        help=f'steps of the MLP (default: {mlp_recipe.MlpRecipe().steps:,})')
    add('--out', type=Path, help='folder to write to (default: weights/)')
    add('--threads', type=within(1), default=1, help='threads of PyTorch (default 1; the '
        "paper's gain nothing from more)")
    return parser


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    parser = _parser()
    options = parser.parse_args(args)
    wanted = options.what or ['all']
    unknown = [name for name in wanted if name not in (*NAMES, 'all')]
    if unknown:
        parser.error(f'{unknown[0]!r} is not one of {", ".join(NAMES)}, all')
    if options.quick and options.out is None:
        parser.error('--quick would replace the weights in weights/: name a folder with --out')
    options.what = NAMES if 'all' in wanted else [name for name in NAMES if name in wanted]
    shipped = resource_path('package.xml').parent / 'weights'
    options.out = make_folder(parser, options.out or shipped)
    return options


def _commit() -> str:
    try:
        done = subprocess.run(['git', 'rev-parse', 'HEAD'], cwd=Path(__file__).parent,
                              capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return 'unknown'
    return done.stdout.strip()


def _train_mlp(options: argparse.Namespace, name: str) -> None:
    path = options.out / f'{MLP}{name and "-" + name}.safetensors'
    card = mlp_recipe.train(path, seed=options.seed, commit=_commit(), quick=options.quick,
                            hidden=options.hidden or mlp_recipe.HIDDEN, steps=options.steps)
    print(f'{path}, {card["training"]["minutes"]} min\n{mlp_recipe.metrics_table(card)}')
    if not name and SHIPPED_HEADER.exists() and path == resource_path('weights', path.name):
        network = load_weights(path).networks[NETWORK]
        SHIPPED_HEADER.write_text(mlp_recipe.header(network.layers), encoding='utf-8')
        print(f'{SHIPPED_HEADER}: build the library anew')


def _train_paper(options: argparse.Namespace, job: paper_jobs.PaperJob) -> None:
    starts, epochs = job.settings.networks, job.settings.epochs
    if options.quick:
        starts, epochs = QUICK_STARTS, QUICK_EPOCHS
        job = replace(job, counts=QUICK_COUNTS, seeds=job.seeds[:1])
    job = replace(job, settings=replace(
        job.settings, networks=options.starts or starts, epochs=options.epochs or epochs))
    card = paper_jobs.train_paper(job, seed=options.seed, commit=_commit(), folder=options.out)
    print(f'{options.out / job.name}.safetensors, {card["training"]["minutes"]} min\n'
          f'{paper_jobs.metrics_table(card)}')


def main(args: Sequence[str] | None = None) -> int:
    """Train the parts that the arguments name."""
    options = _options(args)
    torch.set_num_threads(options.threads)
    for name in options.what:
        if name == MLP:
            _train_mlp(options, str(options.hidden or ''))
        else:
            _train_paper(options, paper_jobs.JOBS[name])
    return 0
