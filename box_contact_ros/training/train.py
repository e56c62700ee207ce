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

from ..output import make_folder
from ..resources import resource_path
from ..scene.files.scene_file import SceneError
from ..solver.arguments import program_parser, within
from ..solver.mlp import UNITS_MAX
from . import mlp_recipe
from .paper_recipe import paper_jobs
from .samples import SizePair, scene_sizes

MLP = 'mlp'
NAMES = (*paper_jobs.JOBS, MLP)  # what can be asked for
QUICK_COUNTS, QUICK_STARTS, QUICK_EPOCHS = (1000, 500, 2000), 3, 70
"""`--quick`, for the paper's: enough to see the error fall, in seconds."""


def _parser() -> argparse.ArgumentParser:
    parser = program_parser(
        'train', 'Make the data sets, fit the networks, write the weights files.\n\n'
        'Measured on a machine with two cores (each uses one):\n'
        '  paper             two boxes of edge 2, with discontinuities     2 minutes\n'
        "  paper-as-drawn    the same, not folded into the solver's domain  2 minutes\n"
        '  paper-continuous  without discontinuities, one network a subset 8 minutes\n'
        '  containers        two boxes of 12.192 x 2.438 x 2.591 m         2 minutes\n'
        '  mlp               any two boxes                                 8 minutes\n'
        '  --scene FILE      the boxes of one scene, from the general mlp  2 minutes', seed=1,
        quick='small sets and few epochs, to try it out; needs --out')
    add = parser.add_argument
    add('what', nargs='*', metavar='what', help=f'{", ".join(NAMES)}, or all (default)')
    add('--scene', type=Path, metavar='FILE', help='train an MLP for the sizes of the pairs in '
        'this scene file alone, and say how much error that saves; writes mlp-FILE.safetensors to '
        'the current folder, or --out')
    add('--starts', type=within(1), help='networks trained at once, of which the best is kept, '
        "of the paper's (default: 24 to 96, by job)")
    add('--epochs', type=within(1), help="passes through the training set, of the paper's "
        '(default: 300 to 1000, by job)')
    add('--hidden', type=within(1, UNITS_MAX), metavar='UNITS', help='of the MLP: units of its '
        f'hidden layer (default: {mlp_recipe.HIDDEN}), named in the file')
    add('--steps', type=within(1), help=f'of the MLP (default: {mlp_recipe.GENERAL.steps:,})')
    add('--out', type=Path, help='folder to write to (default: weights/)')
    add('--threads', type=within(1), default=1, help="of PyTorch (default 1; the paper's gain "
        'nothing from more)')
    add('--device', choices=('cpu', 'cuda', 'auto'), type=mlp_recipe.device_of, default='cpu',
        help='of the MLP (default cpu: the same weights everywhere; matrices this small gain '
        'little from a GPU)')
    return parser


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    parser = _parser()
    options = parser.parse_args(args)
    wanted = options.what or ['all']
    unknown = [name for name in wanted if name not in (*NAMES, 'all')]
    if unknown:
        parser.error(f'{unknown[0]!r} is not one of {", ".join(NAMES)}, all')
    if options.scene and options.what:
        parser.error(f'--scene trains for the scene alone: leave out {options.what[0]!r}')
    for name in ('hidden', 'steps'):
        if options.scene and getattr(options, name):
            parser.error(f'--scene goes on from the shipped network: leave out --{name}')
    if options.quick and options.out is None and not options.scene:
        parser.error('--quick would replace the weights in weights/: name a folder with --out')
    options.what = NAMES if 'all' in wanted else [name for name in NAMES if name in wanted]
    options.sizes = _sizes(parser, options.scene) if options.scene else []
    shipped = resource_path('package.xml').parent / 'weights'
    options.out = make_folder(parser, options.out or (Path() if options.scene else shipped))
    return options


def _sizes(parser: argparse.ArgumentParser, scene: Path) -> list[SizePair]:
    """Return the pairs of sizes of a scene that the MLP may be asked for."""
    try:
        sizes = scene_sizes(scene)
    except SceneError as error:
        parser.error(str(error))
    kept = [pair for pair in sizes if mlp_recipe.in_range(pair)]
    for pair in (pair for pair in sizes if pair not in kept):
        print(f'left out, as the MLP always answers them exactly: {mlp_recipe.text(pair)}')
    if not kept:
        parser.error(f'{scene}: no pair of sizes is within the range of the mlp')
    return kept


def _commit() -> str:
    try:
        done = subprocess.run(['git', 'rev-parse', 'HEAD'], cwd=Path(__file__).parent,
                              capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return 'unknown'
    return done.stdout.strip()


def _train_mlp(options: argparse.Namespace, name: str) -> None:
    path = options.out / f'{MLP}{name and "-" + name}.safetensors'
    card = mlp_recipe.train(
        path, seed=options.seed, commit=_commit(), quick=options.quick, device=options.device,
        hidden=options.hidden or mlp_recipe.HIDDEN, steps=options.steps, sizes=options.sizes)
    print(f'{path}, {card["training"]["minutes"]} min\n{mlp_recipe.metrics_table(card)}')
    if options.scene:
        print(f'use it: ros2 run box_contact_ros contact_node --ros-args -p model:=mlp '
              f'-p weights:={path.resolve()}')


def _train_paper(options: argparse.Namespace, job: paper_jobs.PaperJob) -> None:
    starts, epochs = job.settings.networks, job.settings.epochs
    if options.quick:
        starts, epochs = QUICK_STARTS, QUICK_EPOCHS
        job = replace(job, counts=QUICK_COUNTS)
    job = replace(job, settings=replace(
        job.settings, networks=options.starts or starts, epochs=options.epochs or epochs))
    card = paper_jobs.train_paper(job, seed=options.seed, commit=_commit(), folder=options.out)
    print(f'{options.out / job.name}.safetensors, {card["training"]["minutes"]} min\n'
          f'{paper_jobs.metrics_table(card)}')


def main(args: Sequence[str] | None = None) -> int:
    """Train what is asked for."""
    options = _options(args)
    torch.set_num_threads(options.threads)
    if options.scene:
        _train_mlp(options, options.scene.stem)
        return 0
    for name in options.what:
        if name == MLP:
            _train_mlp(options, str(options.hidden or ''))
        else:
            _train_paper(options, paper_jobs.JOBS[name])
    return 0
