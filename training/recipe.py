# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Train the network of model `mlp`: from draws, then from what a search finds hardest.

Networks from several seeds learn from the same data. The one of median error is written, and the
spread of all stands in its model card.
"""
from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from benchmarks.errors import contact_errors
from benchmarks.output import percentiles
from benchmarks.pose_sets import SETS, Pairs
from benchmarks.weights import save_weights
from benchmarks.worst_case import climb, worst_start
from box_contact_ros.core import FEATURES, NETWORK_FORMAT, OUTPUTS
from box_contact_ros.models import make_model
from box_contact_ros.networks.mlp import ACTIVATION, GROUP, NETWORK, core_numbers
from box_contact_ros.networks.weights_file import Network
from box_contact_ros.solver.contact_solver import ContactSolver

from .fit import UNITS, MlpErrors, PatchNetwork, errors_of, fit, tensors
from .samples import MlpSamples, describe, draw_samples, mixture

FEATURE_NAMES = (
    'length of the chords, by level', 'their first moment along x, by level',
    'their first moment along y, by level', 'variances of x and y, covariance of both')
"""Features of the chords of a contact (core/src/mlp/chords.hpp)."""
HIDDEN = (24, 24)
"""Units of both hidden layers."""
SIZES = ((16, 16), (20, 18), (32, 32))
"""The other sizes that the report `frontier` compares."""
HARD_START, HARD_COUNT = 200_000, 3_000
"""Pairs drawn for each search, which climbs from the HARD_COUNT worst."""
HARD_SHARE = 30
"""Contacts that are drawn for each one that a search has found."""

# Streams of random numbers: data, what is measured on, hard data.
_DATA, _METRICS, _HARD = range(3)


@dataclass(frozen=True, kw_only=True)
class MlpRecipe:
    """One training."""

    pairs: int = 1_200_000
    first_steps: int = 1_500  # of a network whose hardest contacts are searched
    steps: int = 6_000
    batch: int = 4096
    rate: float = 5e-3
    generations: int = 40  # of each search for hard contacts
    hard_rounds: int = 2
    metric_pairs: int = 100_000  # pairs of each set in the model card's metrics
    networks: int = 5


QUICK = {'pairs': 50_000, 'first_steps': 50, 'steps': 200, 'generations': 3, 'hard_rounds': 1,
         'metric_pairs': 2_000, 'networks': 2}
"""What `--quick` replaces: enough to see the error fall, in seconds."""


def train(path: Path, *, seed: int, commit: str, quick: bool = False,
          hidden: tuple[int, int] = HIDDEN) -> dict[str, Any]:
    """Train the networks and write one to `path`; return its model card."""
    began = time.monotonic()
    recipe = MlpRecipe(**(QUICK if quick else {}))
    data = draw_samples(mixture, [seed, _DATA], recipe.pairs, progress=True)
    drawn = len(data)
    for number in range(recipe.hard_rounds):
        first = _trained(tensors(data), seed, hidden, recipe, recipe.first_steps,
                         f'round {number + 1}')
        hard = _hard(first, np.random.default_rng([seed, _HARD, number]), recipe)
        data = MlpSamples.joined([data, *[hard] * max(1, drawn // (HARD_SHARE * len(hard)))])
    batches = tensors(data)
    networks = [_trained(batches, seed + number, hidden, recipe, recipe.steps,
                         f'network {number + 1}') for number in range(recipe.networks)]
    summaries = [_summary(network, batches) for network in networks]
    order = np.argsort([sum(entry['p99'] for entry in summary.values()) for summary in summaries])
    chosen = int(order[len(order) // 2])
    card = model_card(path, recipe, hidden, {
        'recipe': mixture.__doc__, 'pairs': recipe.pairs, 'contacts': drawn,
        'hard': len(data) - drawn})
    card |= {'seed': seed + chosen, 'commit': commit, 'spread': summaries}
    card['training']['minutes'] = round((time.monotonic() - began) / 60.0, 2)
    layers = networks[chosen].layers()
    # What is measured is what was written.
    save_weights(path, {NETWORK: layers}, card)
    card['metrics'] = measured(path, seed, recipe.metric_pairs)
    save_weights(path, {NETWORK: layers}, card)
    return card


def header(layers: Any) -> str:
    """Return the text of core/src/mlp/shipped_network.hpp for a network's layers."""
    numbers = [f'{float(number)!r}F' for number in core_numbers(Network(layers))]
    lines = [', '.join(numbers[:2])]
    lines += [', '.join(numbers[at:at + GROUP]) for at in range(2, len(numbers), GROUP)]
    return HEADER.replace('NUMBERS', '\n'.join(f'    {line},' for line in lines))


HEADER = """// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The shipped network of model `mlp`. `python -m training mlp` writes it with the weights file.
#pragma once

namespace box_contact::detail {

// The groups of each hidden layer, then groups of eight units.
// clang-format off
constexpr float shipped_network[] = {
NUMBERS
};
// clang-format on

}  // namespace box_contact::detail
"""


def _trained(batches: MlpSamples, seed: int, hidden: tuple[int, int], recipe: MlpRecipe,
             steps: int, what: str) -> PatchNetwork:
    torch.manual_seed(seed)
    network = PatchNetwork(hidden)
    losses = fit(network, batches, steps=steps, batch=recipe.batch, rate=recipe.rate,
                 generator=torch.Generator().manual_seed(seed))
    with tqdm(losses, desc=what, total=steps, unit='step', mininterval=1.0) as bar:
        for step, loss in enumerate(bar):
            if step % 200 == 0:
                bar.set_postfix(loss=f'{loss.item():.2e}', refresh=False)
    return network


def _hard(network: PatchNetwork, rng: np.random.Generator, recipe: MlpRecipe) -> MlpSamples:
    """Return what a search from the worst of fresh draws finds, over poses and sizes."""
    def score(pairs: Pairs) -> np.ndarray:
        samples, rows = describe(pairs)
        found = np.full(len(rows), -1.0)
        with torch.no_grad():
            errors = errors_of(network, tensors(samples))
        found[rows] = torch.stack([error / unit for error, unit in zip(errors, UNITS)]).amax(0)
        return np.nan_to_num(found, nan=-1.0)

    start = worst_start(mixture(rng, HARD_START), score, HARD_COUNT)
    return describe(climb(rng, start, score, generations=recipe.generations, free_sizes=True)[0])[0]


@torch.no_grad()
def _summary(network: PatchNetwork, batches: MlpSamples) -> dict[str, dict[str, float]]:
    errors = errors_of(network, batches)
    return {name: error_summary(100.0 * values.numpy())
            for name, values in zip(MlpErrors._fields, errors)}


def model_card(path: Path, recipe: MlpRecipe, hidden: tuple[int, int], data: dict[str, Any],
               ) -> dict[str, Any]:
    """Return the card of a network before anything is measured."""
    return {
        'name': path.stem, 'model': 'mlp', 'format': NETWORK_FORMAT,
        'architecture': [FEATURES, *hidden, OUTPUTS], 'activation': ACTIVATION, 'sizes': [],
        'inputs': {'description': 'chords of the overlap in its patch box', 'names': FEATURE_NAMES,
                   'range': [-1.0, 1.0]},
        'outputs': ['exponents of factors: odds of x, y, z; volume; deviations along x, y, z'],
        'data': data, 'metrics': {},
        'training': {'algorithm': 'Adam', 'steps': recipe.steps, 'batch': recipe.batch,
                     'rate': recipe.rate, 'loss units': UNITS, 'threads': torch.get_num_threads()}}


def error_summary(errors: np.ndarray) -> dict[str, float]:
    """Return mean, 99th percentile and worst of errors."""
    p99, worst = percentiles(errors, 99, 100)
    return {'mean': float(errors.mean()), 'p99': p99, 'worst': worst}


def measured(path: Path, seed: int, count: int) -> dict[str, Any]:
    """Return the errors of point, volume and covariance on each pose set."""
    solver = ContactSolver(model=make_model('mlp', weights=path))
    found: dict[str, Any] = {}
    for number, (name, make) in enumerate(SETS.items()):
        pairs = make(np.random.default_rng([seed, _METRICS, number]), count)
        errors = contact_errors(pairs.contacts(solver), pairs.contacts(), pairs.edge)
        found[name] = {quantity: error_summary(values)
                       for quantity, values in errors._asdict().items()}
    return found
