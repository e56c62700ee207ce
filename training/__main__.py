# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Make the data, fit the networks, write the weights files with their model cards.

mlp                      any two boxes; the default
mlp --hidden 16 16       another size of its network, for reports
paper                    two boxes of edge 2 that just touch, as the paper draws them
paper --scene NAME       two equal boxes in the poses of a scene
paper-…, table-1-…       what only the tables of benchmarks.paper need
"""
from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks.contestant import OTHER_WEIGHTS
from benchmarks.output import QUICK_RESULTS, make_folder, report_parser
from benchmarks.paper import jobs
from box_contact_ros.arguments import within
from box_contact_ros.core import UNITS_MAX
from box_contact_ros.models.networks import GROUP, MLP, PAPER, mlp_numbers

from . import paper, recipe

NAMES = (MLP, *jobs.JOBS)
SHIPPED_HEADER = Path(__file__).parents[1].joinpath(
    'box_contact_ros', 'core', 'src', 'mlp', 'shipped_network.hpp')
"""The shipped weights as the library has them."""
HEADER = """// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The shipped network of model `mlp`. `python -m training mlp` writes it with the weights file.
#pragma once

namespace box_contact::detail {

// Inputs, units of both hidden layers, outputs and three flags, then groups of eight units.
// clang-format off
constexpr float shipped_network[] = {
NUMBERS
};
// clang-format on

}  // namespace box_contact::detail
"""
QUICK_COUNTS, QUICK_STARTS, QUICK_EPOCHS = (1000, 500, 2000), 3, 70
"""`--quick`, for the paper's: enough to see the error fall, in seconds."""


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    parser = report_parser('python -m training', __doc__, seed=1,
                           quick='small sets and few epochs, to try it out in seconds')
    parser.add_argument('what', nargs='*', choices=(*NAMES, []), metavar='WHAT',
                        help=', '.join(NAMES))
    parser.add_argument('--hidden', type=within(1, UNITS_MAX), nargs=2, metavar='UNITS',
                        help=f'units of the hidden layers of mlp (default: {recipe.HIDDEN[0]} '
                        f'{recipe.HIDDEN[1]}), named in the file')
    parser.add_argument('--steps', type=within(1), help='steps of each network of mlp (default: '
                        f'{recipe.MlpRecipe.steps:,})')
    parser.add_argument('--networks', type=within(1), help='networks of mlp, of which the best is '
                        f'written (default: {recipe.MlpRecipe.networks})')
    parser.add_argument('--scene', choices=paper.SCENES,
                        help='pose set that paper is trained for; one of cubes needs --out')
    parser.add_argument('--out', type=Path, metavar='DIR',
                        help='folder to write to (default: weights/, benchmarks/ for what reports '
                        'alone need, and quick-results/ with --quick)')
    options = parser.parse_args(args)
    options.what = options.what or [MLP]
    if options.scene and options.what != [PAPER]:
        parser.error(f'--scene is of {PAPER} alone')
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


def _header(network: np.ndarray) -> str:
    """Return the text of `SHIPPED_HEADER` for a network as the core reads it."""
    numbers = [f'{float(number)!r}F' for number in network]
    first = len(numbers) % GROUP
    lines = [', '.join(numbers[:first])]
    lines += [', '.join(numbers[at:at + GROUP]) for at in range(first, len(numbers), GROUP)]
    return HEADER.replace('NUMBERS', '\n'.join(f'    {line},' for line in lines))


def _print(path: Path, card: dict[str, Any]) -> None:
    """Print what a training took, and the errors of its card."""
    print(f'{path}, {card["training"]["minutes"]} min\n{json.dumps(card["metrics"], indent=1)}')


def _train_mlp(options: argparse.Namespace, hidden: tuple[int, int] | None = None) -> None:
    """Train the shipped network, or one of other hidden layers."""
    name = '-'.join((MLP, *map(str, hidden or ())))
    folder = options.out or (OTHER_WEIGHTS if hidden else jobs.SHIPPED)
    path = folder / f'{name}.safetensors'
    asked = {field: value for field in ('steps', 'networks')
             if (value := getattr(options, field)) is not None}
    planned = recipe.MlpRecipe(**(recipe.QUICK if options.quick else {}) | asked)
    print(f'{planned.networks} networks of {planned.steps:,} steps: about '
          f'{planned.minutes():.0f} min, then their errors', flush=True)
    card = recipe.train(path, planned, seed=options.seed, commit=_commit(),
                        hidden=hidden or recipe.HIDDEN)
    _print(path, card)
    if hidden is None and options.out is None:
        SHIPPED_HEADER.write_text(_header(mlp_numbers(path)), encoding='utf-8')
        print(f'{SHIPPED_HEADER}: build the library anew')


def _train_scene(options: argparse.Namespace) -> None:
    quick = {'counts': QUICK_COUNTS, 'networks': QUICK_STARTS, 'epochs': QUICK_EPOCHS}
    try:
        card = paper.train(options.out or jobs.SHIPPED, options.scene, seed=options.seed,
                           commit=_commit(), **(quick if options.quick else {}))
    except ValueError as error:
        sys.exit(f'error: {error}')
    print(f'{card["name"]}.safetensors: point {card["metrics"]} [% of the longest edge]')


def _train_paper(options: argparse.Namespace, job: jobs.PaperJob) -> None:
    if options.quick:
        job = replace(job, counts=QUICK_COUNTS, seeds=job.seeds[:1], settings=replace(
            job.settings, networks=QUICK_STARTS, epochs=QUICK_EPOCHS))
    folder = options.out or job.folder
    card = jobs.train_paper(job, seed=options.seed, commit=_commit(), folder=folder)
    _print(folder / f'{job.name}.safetensors', card)


def main(args: Sequence[str] | None = None) -> int:
    """Train what the arguments name."""
    options = _options(args)
    torch.set_num_threads(1)  # matrices this small gain nothing from more
    for name in dict.fromkeys(options.what):
        if name == MLP:
            _train_mlp(options, options.hidden and tuple(options.hidden))
        elif options.scene:
            _train_scene(options)
        else:
            _train_paper(options, jobs.JOBS[name])
    return 0


if __name__ == '__main__':
    sys.exit(main())
