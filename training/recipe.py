# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Train the network of model `mlp`: from draws, then from what a search finds hardest.

Networks from several seeds learn from the same data. The one of median error is written, and the
spread of all stands in its model card.
"""
from __future__ import annotations

import multiprocessing
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from benchmarks import settled
from benchmarks.errors import contact_errors
from benchmarks.mlp_samples import MlpSamples, describe, draw_samples, mixture
from benchmarks.output import percentiles
from benchmarks.pose_sets import LOADS, SETS, Generator, Pairs
from benchmarks.timing import usable_cores
from benchmarks.weights import save_weights
from benchmarks.worst_case import climb, worst_start
from box_contact_ros.core import FEATURES, NETWORK_FORMAT, OUTPUTS
from box_contact_ros.models.make_model import make_model
from box_contact_ros.models.networks import KINDS, MLP
from box_contact_ros.solver.contact_solver import ContactSolver

from .fit import TAIL, UNITS, MlpErrors, PatchNetwork, errors_of, fit, tensors

FEATURE_NAMES = ('cuts along x, y, z', 'depths of cuts', 'their squares',
                 'xx, yy, zz, xy, xz, yz of cuts', 'depths at the eight corners')
"""Features of a contact (core/src/mlp/features.hpp)."""
HIDDEN = (32, 32)
"""Units of both hidden layers."""
HARD_START, HARD_COUNT = 200_000, 3_000
"""Pairs drawn for each search, which climbs from the HARD_COUNT worst."""
HARD_SHARE = 30  # contacts that are drawn for each one that a search has found

# Streams of random numbers: data, what is measured on, hard data.
_DATA, _METRICS, _HARD = range(3)


@dataclass(frozen=True, kw_only=True)
class MlpRecipe:
    """One training."""

    pairs: int = 1_200_000
    first_steps: int = 1_500  # of a network whose hardest contacts are searched
    steps: int = 16_000
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
        first = _trained(tensors(data), seed, hidden, recipe, recipe.first_steps)
        hard = _hard(first, np.random.default_rng([seed, _HARD, number]), recipe)
        data = MlpSamples.joined([data, *[hard] * max(1, drawn // (HARD_SHARE * len(hard)))])
    batches = tensors(data)
    networks = _in_processes(partial(_trained, batches, hidden=hidden, recipe=recipe),
                             [seed + number for number in range(recipe.networks)])
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
    save_weights(path, {KINDS[MLP].network: layers}, card)
    card['metrics'] = measured(path, seed, recipe.metric_pairs)
    save_weights(path, {KINDS[MLP].network: layers}, card)
    return card


def _trained(batches: MlpSamples, seed: int, hidden: tuple[int, int], recipe: MlpRecipe,
             steps: int = 0) -> PatchNetwork:
    torch.set_num_threads(1)  # matrices this small gain nothing from more
    torch.manual_seed(seed)
    network = PatchNetwork(hidden)
    steps = steps or recipe.steps
    losses = fit(network, batches, steps=steps, batch=recipe.batch, rate=recipe.rate,
                 generator=torch.Generator().manual_seed(seed))
    with tqdm(losses, desc=f'seed {seed}', total=steps, unit='step', mininterval=10.0) as bar:
        for step, loss in enumerate(bar):
            if step % 500 == 0:
                bar.set_postfix(loss=f'{loss.item():.2e}', refresh=False)
    return network


def _in_processes(train_one: partial[PatchNetwork], seeds: Sequence[int]) -> list[PatchNetwork]:
    """Return a network for each seed: a process on each core, where there is more than one."""
    cores = min(len(usable_cores()), len(seeds))
    if cores == 1:
        return [train_one(seed) for seed in seeds]
    with ProcessPoolExecutor(cores, multiprocessing.get_context('spawn')) as pool:
        return list(pool.map(train_one, seeds))


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
    return {name: error_summary(100.0 * values.numpy())
            for name, values in zip(MlpErrors._fields, errors_of(network, batches))}


def model_card(path: Path, recipe: MlpRecipe, hidden: tuple[int, int], data: dict[str, Any],
               ) -> dict[str, Any]:
    """Return the card of a network before anything is measured."""
    return {
        'name': path.stem, 'model': 'mlp', 'format': NETWORK_FORMAT,
        'architecture': [FEATURES, *hidden, OUTPUTS], 'activation': KINDS[MLP].activation,
        'sizes': [],
        'inputs': {'description': 'what both boxes cut off the patch box', 'names': FEATURE_NAMES,
                   'range': [-12.0, 24.0]},
        'outputs': ['x, y, z of the centroid', 'root of the volume',
                    'xx, yy, zz, yx, zx, zy of a root of the covariance'],
        'data': data, 'metrics': {},
        'training': {'algorithm': 'Adam', 'steps': recipe.steps, 'batch': recipe.batch,
                     'rate': recipe.rate, 'loss units': UNITS, 'loss tail': TAIL}}


def error_summary(errors: np.ndarray) -> dict[str, float]:
    """Return mean, 99th percentile and worst of errors."""
    p99, worst = percentiles(errors, 99, 100)
    return {'mean': float(errors.mean()), 'p99': p99, 'worst': worst}


def measured(path: Path, seed: int, count: int) -> dict[str, Any]:
    """Return the errors of point, volume and covariance on each pose set, and of goods at rest."""
    solver = ContactSolver(model=make_model(MLP, weights=path))
    sets: dict[str, Generator] = {
        **SETS, **LOADS, 'settled': settled.at_rest}
    found: dict[str, Any] = {}
    for number, (name, make) in enumerate(sets.items()):
        pairs = make(np.random.default_rng([seed, _METRICS, number]), count)
        pairs = pairs.rows(pairs.contacts().colliding)
        errors = contact_errors(pairs.contacts(solver), pairs.contacts(), pairs.edge)
        found[name] = {quantity: error_summary(values)
                       for quantity, values in errors._asdict().items()}
    return found
