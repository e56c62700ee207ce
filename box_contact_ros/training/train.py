"""Program `train`: make the data sets, fit the networks, write weights/ with model cards.

What is trained, and with which settings, stands in `JOBS` for the paper's networks and in
`mlp` for the MLP's; everything else follows from the seed.
"""
from __future__ import annotations

import argparse
import dataclasses
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from ..resources import resource_path
from ..scene.scene_file import SceneError
from ..solver.arguments import make_folder, seed_number
from ..solver.mlp import UNITS_MAX
from ..solver.weights_file import load_weights, save_weights
from . import mlp_recipe
from .mlp_fit import device_of
from .paper_recipe import dataset
from .paper_recipe.errors import errors_of, figures_by_part
from .paper_recipe.fit import Settings, fit
from .scene_sizes import size_pairs


@dataclasses.dataclass(frozen=True)
class Job:
    """One weights file."""

    name: str
    """Of the file, without its ending."""
    model: str
    """The solver's model that it serves."""
    size: tuple[float, float, float]
    """Full extents [m] of either box."""
    counts: tuple[int, int, int]
    """Patterns in the training, cross-validation and external set (per subset)."""
    folded_in: bool
    """Whether the data are folded into the domain in which the solver asks."""
    settings: Settings
    recipe: str
    """The data in words, for the model card; `_FOLDED` is added for model `paper`."""


_DRAWN = ('Boxes that just touch, one fixed: impact points uniform by area on its trihedron +x +y '
          '+z, each of the 7 vertices of the other trihedron −x −y −z placed there; points '
          'uniform by length on the 9 edges of either trihedron, placed on each other; roll, '
          'pitch, yaw uniform in [−π/2, π/2]; placements deeper than 1e-12 of the size rejected; '
          'half of the patterns vertex-face, half edge-edge. ')

_FOLDED = {False: 'Patterns as drawn.',
           True: 'Folded by the box symmetries: t ≥ 0, angles in [−π/2, π/2].'}

# Learning rate, initial range, batch and epochs were compared on seed 1, by the cross-validation
# error. As drawn, the 8,000 patterns are overfitted after 150 to 250 epochs (0.37 rad RMSE in
# training, 0.39 in cross-validation), so `paper` gets more starts instead of more epochs.
_JUMPS = Settings((6, 20, 18, 4), networks=96, epochs=300, batch=50, rate=0.05, initial=0.7)
_CONTAINERS = Settings((6, 20, 18, 4), networks=48, epochs=400, batch=50, rate=0.1, initial=0.7)
_SMOOTH = Settings((6, 20, 17, 4), networks=24, epochs=1000, batch=50, rate=0.2)

JOBS = {
    'paper': Job(
        'paper', 'paper', dataset.CUBE, dataset.PAPER_COUNTS, True, _JUMPS,
        _DRAWN),
    'paper-continuous': Job(
        'paper-continuous', 'paper-continuous', dataset.CUBE, dataset.CONTINUOUS_COUNTS, True,
        _SMOOTH,
        _DRAWN + 'Split by the winning axis of SAT (a face of the first box: vertex_face; an edge '
        'pair: edge_edge), which is also what the features are folded by (cube symmetries).'),
    'containers': Job(
        'paper-12.192x2.438x2.591', 'paper', dataset.CONTAINER, dataset.PAPER_COUNTS, True,
        _CONTAINERS,
        _DRAWN),
}

MLP = 'mlp'
NAMES = (*JOBS, MLP)
"""What can be asked for."""

# `--quick`: enough to see the error fall, in seconds.
QUICK_COUNTS = (1000, 500, 2000)
QUICK_STARTS, QUICK_EPOCHS = 3, 100


def run(job: Job, *, seed: int, folder: Path, progress: bool = True) -> dict[str, Any]:
    """Make the data, train, write the weights file; returns its model card."""
    recipe = job.recipe + (_FOLDED[job.folded_in] if job.model == 'paper' else '')
    card: dict[str, Any] = {
        'name': job.name,
        'model': job.model,
        'architecture': list(job.settings.widths),
        'sizes': [list(job.size), list(job.size)],
        'data': {'recipe': recipe, 'counts': dict(zip(dataset.SETS, job.counts)),
                 'folded_in': job.folded_in, 'edge_share': 0.5},
        'seed': seed,
        'commit': _commit(),
        'inputs': {},
        'outputs': {},
        'metrics': {},
        'training': {},
    }
    began = time.monotonic()
    networks = {}
    for network, sets in dataset.of_card(card).items():
        settings = dataclasses.replace(job.settings, seed=seed)
        fitted = fit(sets['training'], sets['cross-validation'], settings,
                     progress=f'{job.name}, {network}' if progress else '')
        networks[network] = fitted.export()
        card['inputs'][network] = _ranges(dataset.INPUTS, sets, 'inputs')
        card['outputs'][network] = _ranges(dataset.OUTPUTS, sets, 'outputs')
        card['training'][network] = {
            'algorithm': 'backpropagation with momentum, stopped by cross-validation',
            'starts': settings.networks, 'epochs': settings.epochs, 'batch': settings.batch,
            'rate': settings.rate, 'momentum': settings.momentum, 'initial': settings.initial,
            'best_epoch': int(fitted.epoch[fitted.error.argmin()])}
        card['metrics'][network] = {}
    card['training']['minutes'] = round((time.monotonic() - began) / 60.0, 2)
    # What is measured is what was written: float32 weights, read back, run as the solver runs them.
    path = folder / f'{job.name}.safetensors'
    save_weights(path, networks, card)
    written = load_weights(path).networks
    for network, sets in dataset.of_card(card).items():
        for name, patterns in sets.items():
            errors = errors_of(written[network], patterns.inputs, patterns.outputs)
            card['metrics'][network][name] = figures_by_part(errors)
    save_weights(path, networks, card)
    return card


def _ranges(names: Sequence[str], sets: dict[str, dataset.Patterns], what: str) -> list[dict]:
    """Least and largest value of every input or output over all sets, with its unit."""
    values = [getattr(patterns, what) for patterns in sets.values()]
    return [{'name': name, 'unit': 'm' if name.startswith('t_') else 'rad',
             'min': float(min(v[:, k].min() for v in values)),
             'max': float(max(v[:, k].max() for v in values))} for k, name in enumerate(names)]


def _commit() -> str:
    try:
        done = subprocess.run(['git', 'rev-parse', 'HEAD'], cwd=Path(__file__).parent,
                              capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return 'unknown'
    return done.stdout.strip()


def table(card: dict[str, Any]) -> str:
    """The card's metrics over all outputs, for the terminal."""
    lines = []
    for network, sets in card['metrics'].items():
        for name, parts in sets.items():
            row = ' '.join(f'{key} {value:+.4f}' for key, value in parts['all'].items())
            lines.append(f'  {network:<12} {name:<17} {row} rad')
    return '\n'.join(lines)


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Make the data sets, fit the networks, write the weights files.\n\n'
        'Measured on a machine with two cores (each uses one):\n'
        '  paper             two boxes of edge 2, with discontinuities     2 minutes\n'
        '  paper-continuous  the same without, one network per subset      3 minutes\n'
        '  containers        two boxes of 12.192 x 2.438 x 2.591 m         1 minute\n'
        '  mlp               any two boxes, the point alone                11 minutes\n'
        '  --scene FILE      the boxes of one scene, from the general mlp  3 minutes')
    parser.add_argument('what', nargs='*', metavar='what',
                        help=f'{", ".join(NAMES)}, or all (default)')
    parser.add_argument('--scene', type=Path, metavar='FILE', help='train an MLP for the '
                        'sizes of the pairs in this scene file alone, and say how much error that '
                        'saves; writes mlp-FILE.safetensors to the current folder, or --out')
    parser.add_argument('--seed', type=seed_number, default=1,
                        help='of data and weights (default 1)')
    parser.add_argument('--starts', type=int, help='networks trained at once, of which the best '
                        "is kept, of the paper's (default: 24 to 96, by job)")
    parser.add_argument('--epochs', type=int, help="passes through the training set, of the "
                        "paper's (default: 300 to 1000, by job)")
    parser.add_argument('--hidden', type=int, metavar='UNITS', help='of the MLP: units of '
                        f'its hidden layer (default: {mlp_recipe.HIDDEN[0]}), named in the file')
    parser.add_argument('--steps', type=int, help='of the MLP (default: '
                        f'{mlp_recipe.STEPS:,}; a third of them make errors a tenth larger)')
    parser.add_argument('--out', type=Path, help='folder to write to (default: weights/)')
    parser.add_argument('--fold', action=argparse.BooleanOptionalAction, help='for paper and '
                        'containers: data folded into the domain in which the solver asks, or as '
                        'drawn (default: folded)')
    parser.add_argument('--quick', action='store_true',
                        help='small sets and few epochs, to try it out; needs --out')
    parser.add_argument('--threads', type=int, default=1, help='of PyTorch (default 1; two '
                        'train the MLP in 7 minutes, the others gain nothing)')
    parser.add_argument('--device', choices=('cpu', 'cuda', 'auto'), type=device_of,
                        default='cpu', help='of the MLP (default cpu: the same weights '
                        'everywhere; matrices this small gain little from a GPU)')
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
    for name in ('starts', 'epochs', 'steps', 'threads'):
        value = getattr(options, name)
        if value is not None and value < 1:
            parser.error(f'--{name} {value} is too small')
    if options.hidden is not None and not 1 <= options.hidden <= UNITS_MAX:
        parser.error(f'--hidden {options.hidden} is not between 1 and {UNITS_MAX}')
    options.what = NAMES if 'all' in wanted else [name for name in NAMES if name in wanted]
    options.sizes = None
    if options.scene:
        try:
            options.sizes = size_pairs(options.scene)
        except SceneError as error:
            parser.error(str(error))
        outside = [pair for pair in options.sizes if not mlp_recipe.in_range(pair)]
        for pair in outside:
            print(f'left out, as the MLP always answers them exactly: {mlp_recipe.text(pair)}')
            options.sizes.remove(pair)
        if not options.sizes:
            parser.error(f'{options.scene}: no pair of sizes is within the range of the mlp')
    shipped = resource_path('package.xml').parent / 'weights'
    options.out = make_folder(parser, options.out or (Path() if options.scene else shipped))
    return options


def main(args: Sequence[str] | None = None) -> int:
    """Train what is asked for."""
    options = _options(args)
    torch.set_num_threads(options.threads)
    common = {'seed': options.seed, 'commit': _commit(), 'quick': options.quick,
              'device': options.device}
    if options.scene:
        path = options.out / f'mlp-{options.scene.stem}.safetensors'
        card = mlp_recipe.train_scene(path, options.sizes, **common)
        print(f'{path}, {card["training"]["minutes"]} min\n{mlp_recipe.table(card)}\n'
              f'use it: ros2 run box_contact_ros contact_node --ros-args -p model:=mlp '
              f'-p weights:={path.resolve()}')
        return 0
    for name in options.what:
        if name == MLP:
            units = f'-{options.hidden}' if options.hidden else ''
            path = options.out / f'{MLP}{units}.safetensors'
            hidden = (options.hidden,) if options.hidden else mlp_recipe.HIDDEN
            card = mlp_recipe.train(path, hidden=hidden, steps=options.steps, **common)
            print(f'{path}, {card["training"]["minutes"]} min\n{mlp_recipe.table(card)}')
            continue
        job = JOBS[name]
        starts, epochs = job.settings.networks, job.settings.epochs
        if options.quick:
            starts, epochs = QUICK_STARTS, QUICK_EPOCHS
            job = dataclasses.replace(job, counts=QUICK_COUNTS)
        if options.fold is not None and job.model == 'paper':
            job = dataclasses.replace(job, folded_in=options.fold)
        settings = dataclasses.replace(job.settings, networks=options.starts or starts,
                                       epochs=options.epochs or epochs)
        card = run(dataclasses.replace(job, settings=settings), seed=options.seed,
                   folder=options.out)
        print(f'{options.out / job.name}.safetensors, {card["training"]["minutes"]} min\n'
              f'{table(card)}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
