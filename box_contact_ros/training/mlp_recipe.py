# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Train the network of model `mlp`, for all boxes or for the boxes of one scene.

The general network learns from `samples.mixture` and serves any two boxes. A scene's network starts
from the general one and goes on with the scene's own pairs of sizes. The solver asks it for these
sizes only, and answers others exactly (box_contact_ros/solver/mlp.py).
"""
from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from inspect import getdoc
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from ..core import ASPECT_MAX, DEPTH_MAX, FEATURES, OUTPUTS, SIZE_RATIO_MAX
from ..output import percentiles
from ..resources import resource_path
from ..scene.pose_sets import SETS, ContactErrors, Generator, Pairs, contact_errors
from ..solver.contact_solver import ContactSolver
from ..solver.mlp import ACTIVATION, DESCRIPTION, FEATURE_NAMES, FORMAT
from ..solver.weights_file import load_weights, save_weights
from .ensemble import Scaling
from .mlp_fit import SiteNetwork, fit, point_errors, random_batches, started
from .samples import MlpSamples, SizePair, draw_samples, mixture, scene_mixture

HIDDEN = 20
"""Hidden units: what fits the time that a batch has for the network (docs/results/search.md)."""
HARD_ROUNDS, HARD_PART, HARD_SHARE = (0.4, 0.55, 0.7, 0.85), 0.01, 0.2
"""After each of these parts of the steps, a pool of fresh pairs is searched for the hardest part.
From then on, all that were found so far make up that share of what is learned from."""
SHOWN_EVERY = 200  # steps between two losses in the progress bar

# Streams of random numbers: data, what is measured on, hard data, weights, places of batches.
_DATA, _METRICS, _HARD, _WEIGHTS, _PLACES = range(5)


@dataclass(frozen=True, kw_only=True)
class MlpRecipe:
    """One training."""

    pairs: int
    steps: int
    batch: int = 4096
    rate: float
    pool: int  # pairs that each round of hard ones searches
    metric_pairs: int = 100_000  # pairs of each set in the model card's metrics


GENERAL = MlpRecipe(pairs=1_000_000, steps=30_000, rate=1e-2, pool=1_000_000)
SCENE = MlpRecipe(pairs=1_000_000, steps=25_000, rate=3e-3, pool=1_000_000)
QUICK = {'pairs': 20_000, 'steps': 400, 'pool': 20_000, 'metric_pairs': 2_000}
"""What `--quick` replaces: enough to see the error fall, in seconds."""


def device_of(name: str) -> str:
    """Return what a program's argument --device names; `auto` is a GPU where PyTorch finds one."""
    if name == 'cuda' and not torch.cuda.is_available():
        raise argparse.ArgumentTypeError('cuda: PyTorch finds no GPU here')
    return ('cuda' if torch.cuda.is_available() else 'cpu') if name == 'auto' else name


def train(path: Path, *, seed: int, commit: str, quick: bool = False, hidden: int = HIDDEN,
          steps: int | None = None, device: str = 'cpu', sizes: Sequence[SizePair] = (),
          ) -> dict[str, Any]:
    """Train a network and write it to `path`; return its model card.

    With `sizes` it is a scene's: it starts from the general one and learns these pairs of sizes.
    """
    began = time.monotonic()
    recipe = replace(SCENE if sizes else GENERAL, **(QUICK if quick else {}))
    recipe = replace(recipe, steps=steps or recipe.steps)
    make: Generator = partial(scene_mixture, sizes=sizes) if sizes else mixture
    data = draw_samples(make, [seed, _DATA], recipe.pairs, progress=True)
    scaling = Scaling.of(data.features.swapaxes(1, 2))
    recipe_card: dict[str, Any] = {'recipe': getdoc(scene_mixture if sizes else mixture)}
    if sizes:
        general = load_weights(resource_path('weights', 'mlp.safetensors'))
        start = general.networks['point']
        network = SiteNetwork(start.widths[1])
        network.load(scaling.unfolded(start.layers))
        recipe_card['started from'] = general.card['sha256']
    else:
        network = started(hidden, torch.Generator().manual_seed(seed))
    network.to(device)

    batches = harder_batches(network, data, scaling, recipe, make, seed)
    losses = fit(network, batches, steps=recipe.steps, rate=recipe.rate)
    with tqdm(losses, desc=path.stem, total=recipe.steps, unit='step', mininterval=1.0) as bar:
        for step, loss in enumerate(bar):
            if step % SHOWN_EVERY == 0:
                bar.set_postfix(loss=f'{loss.item():.2e}', refresh=False)

    layers = scaling.folded(network.layers())
    card = model_card(path, network, recipe, {**recipe_card, 'pairs': len(data)})
    card |= {'seed': seed, 'commit': commit, 'sizes': [[list(a), list(b)] for a, b in sizes]}
    card['training']['minutes'] = round((time.monotonic() - began) / 60.0, 2)
    # What is measured is what was written.
    save_weights(path, {'point': layers}, card)
    card['metrics'] = measured(path, sizes, seed, recipe.metric_pairs)
    save_weights(path, {'point': layers}, card)
    return card


def harder_batches(network: SiteNetwork, data: MlpSamples, scaling: Scaling, recipe: MlpRecipe,
                   make: Generator, seed: int) -> Iterator[MlpSamples]:
    """Yield the batches of a training: after each hard round also what the network is worst at."""
    device = next(network.parameters()).device.type
    rng = np.random.default_rng([seed, _PLACES])
    rounds = [round(part * recipe.steps) for part in HARD_ROUNDS]
    hard: list[MlpSamples] = []
    for number, (start, end) in enumerate(zip([0, *rounds], [*rounds, recipe.steps])):
        mixed = data
        if number:
            fresh = draw_samples(make, [seed, _HARD, number - 1], recipe.pool)
            hard.append(hardest(network, fresh, scaling))
            found = MlpSamples.joined(hard)
            times = HARD_SHARE / (1.0 - HARD_SHARE) * len(data) / len(found)
            mixed = MlpSamples.joined([data, *[found] * max(1, round(times))])
        yield from random_batches(mixed, scaling, rng, size=recipe.batch, count=end - start,
                                  device=device)


def hardest(network: SiteNetwork, data: MlpSamples, scaling: Scaling) -> MlpSamples:
    """Return the part of the samples in which the network's point errs most."""
    errors = point_errors(network, data, scaling)
    count = max(1, round(HARD_PART * len(errors)))
    return data.part(np.sort(np.argsort(errors, kind='stable')[-count:]))


# --- the model card -------------------------------------------------------------------------------


def model_card(path: Path, network: SiteNetwork, recipe: MlpRecipe, data: dict[str, Any],
               ) -> dict[str, Any]:
    """Return the card of a network before anything is measured."""
    parameter = next(network.parameters())
    return {
        'name': path.stem, 'model': 'mlp', 'format': FORMAT,
        'architecture': [FEATURES, len(parameter), OUTPUTS],
        'activation': ACTIVATION,
        'inputs': {'description': DESCRIPTION, 'names': FEATURE_NAMES,
                   'range': {'aspect': ASPECT_MAX, 'size ratio': SIZE_RATIO_MAX,
                             'depth by the shortest edge': DEPTH_MAX}},
        'outputs': ['of the push', 'of the pull along the faces', 'of what others pass on',
                    'volume', 'precision along an axis', 'coupling by the faces',
                    'coupling by their push'],
        'data': data, 'metrics': {},
        'training': {'algorithm': 'Adam', 'steps': recipe.steps, 'batch': recipe.batch,
                     'rate': recipe.rate, 'device': parameter.device.type,
                     'threads': torch.get_num_threads()}}


def solver_errors(pairs: Pairs, weights: Path | None) -> ContactErrors:
    """Return the errors of `mlp` against `exact` in contacts of n pairs."""
    solver = ContactSolver((1, 1, 1), (1, 1, 1), model='mlp', weights=weights and str(weights))
    return contact_errors(pairs.contacts(solver), pairs.contacts(), pairs.edge)


def error_summary(errors: np.ndarray) -> dict[str, float]:
    """Return mean, 99th percentile and worst of errors."""
    p99, worst = percentiles(errors, 99, 100)
    return {'mean': float(errors.mean()), 'p99': p99, 'worst': worst}


def measured(path: Path, sizes: Sequence[SizePair], seed: int, count: int) -> dict[str, Any]:
    """Return the errors of point, volume and covariance on each pose set.

    For a scene: those for each pair of sizes, of the general network and of this one.
    """
    def summaries(pairs: Pairs, weights: Path | None) -> dict[str, dict[str, float]]:
        errors = solver_errors(pairs, weights)
        return {name: error_summary(values) for name, values in errors._asdict().items()}

    makers: dict[str, Generator] = {text(pair): partial(scene_mixture, sizes=[pair])
                                    for pair in sizes}
    found: dict[str, Any] = {}
    for number, (name, make) in enumerate((makers or SETS).items()):
        pairs = make(np.random.default_rng([seed, _METRICS, number]), count)
        after = summaries(pairs, path)
        found[name] = {'before': summaries(pairs, None), 'after': after} if sizes else after
    return found


def in_range(pair: SizePair) -> bool:
    """Return whether the MLP may be asked for boxes of these sizes at all."""
    longest, shortest = [max(size) for size in pair], [min(size) for size in pair]
    return (all(one <= ASPECT_MAX * other for one, other in zip(longest, shortest))
            and max(longest) <= SIZE_RATIO_MAX * min(longest))


def text(pair: SizePair) -> str:
    """Return a pair of sizes as it is printed."""
    return ' on '.join(' × '.join(f'{extent:g}' for extent in size) for size in pair)


def metrics_table(card: dict[str, Any]) -> str:
    """Return the card's metrics for the terminal."""
    def shown(f: dict[str, float]) -> str:
        return f'{f["mean"]:.3f} / {f["p99"]:.2f} / {f["worst"]:.1f}'

    lines = ["errors against exact, %: mean / p99 / worst; the point's by the smaller box's "
             "longest edge, the covariance's by its trace"]
    width = max(map(len, card['metrics']))
    for name, entry in card['metrics'].items():
        for quantity, new in entry.get('after', entry).items():
            said = shown(new)
            if 'before' in entry:
                old = entry['before'][quantity]
                saved = ' / '.join(f'{100.0 * (1.0 - new[key] / old[key]):.0f} %' for key in old)
                said = f'general {shown(old)}, this {said}: saved {saved}'
            lines.append(f'{name:<{width}}  {quantity:<10}  {said}')
    return '\n'.join(f'  {line}' for line in lines)
