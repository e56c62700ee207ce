# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Train the network of model `mlp`.

Networks from several seeds learn from the same data. The one of least loss on a draw that none has
learnt from is written, and the errors of all are in its model card.
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
from benchmarks.mlp_samples import (
    MlpSamples,
    draw_samples,
    mixture,
    with_mirror_images,
)
from benchmarks.output import percentiles
from benchmarks.pose_sets import LOADS, SETS, Generator, Pairs, joined, symmetric
from benchmarks.timing import usable_cores
from benchmarks.weights import save_weights
from box_contact_ros.core import FEATURES, NETWORK_FORMAT, OUTPUTS
from box_contact_ros.models.make_model import make_model
from box_contact_ros.models.networks import KINDS, MLP
from box_contact_ros.solver.contact_solver import ContactSolver

from .fit import TAIL, UNITS, PatchNetwork, errors_of, fit, loss_of, tensors

FEATURE_NAMES = ('cuts along x, y, z', 'depths of cuts', 'their squares',
                 'xx, yy, zz, xy, xz, yz of cuts', 'depths at the eight corners')
"""Features of a contact (core/src/mlp/features.hpp)."""
HIDDEN = (24, 24)
"""Units of both hidden layers."""
STEP_SECONDS = 8e-3  # of one network, on one core of AMD EPYC, family 25

# Streams of random numbers: data, what is measured on, what chooses among networks.
_DATA, _METRICS, _CHECK = range(3)


@dataclass(frozen=True, kw_only=True)
class MlpRecipe:
    """One training."""

    pairs: int = 1_200_000
    steps: int = 40_000
    batch: int = 4096
    rate: float = 5e-3
    check_pairs: int = 200_000  # by which one of the networks is chosen
    metric_pairs: int = 100_000  # pairs of each set in the model card's metrics
    networks: int = 4

    def minutes(self) -> float:
        """Return about how long all steps take on the cores of this process."""
        rounds = -(-self.networks // min(len(usable_cores()), self.networks))
        return STEP_SECONDS / 60.0 * rounds * self.steps


QUICK = {'pairs': 50_000, 'steps': 200, 'check_pairs': 5_000, 'metric_pairs': 2_000,
         'networks': 2}
"""What `--quick` replaces: enough to see the error fall, in seconds."""


def checks(rng: np.random.Generator, n: int) -> Pairs:
    """Draw what chooses among networks: the mixture, and as many pairs with a mirror."""
    return joined([mixture(rng, n // 2), symmetric(rng, n // 2)])


def train(path: Path, recipe: MlpRecipe, *, seed: int, commit: str,
          hidden: tuple[int, int] = HIDDEN) -> dict[str, Any]:
    """Train the networks and write the best to `path`; return its model card."""
    began = time.monotonic()
    data = draw_samples(mixture, [seed, _DATA], recipe.pairs, progress=True)
    batches = tensors(with_mirror_images(data))
    networks = _in_processes(partial(_trained, batches, hidden=hidden, recipe=recipe),
                             [seed + number for number in range(recipe.networks)])
    checked = tensors(draw_samples(checks, [seed, _CHECK], recipe.check_pairs))
    found = [_checked(network, checked) for network in networks]
    chosen = int(np.argmin([errors['loss'] for errors in found]))
    card = model_card(path, recipe, hidden, {
        'recipe': mixture.__doc__, 'pairs': recipe.pairs, 'contacts': len(data),
        'mirror images': len(batches) - len(data)})
    card |= {'seed': seed + chosen, 'commit': commit, 'networks': found}
    card['training']['minutes'] = round((time.monotonic() - began) / 60.0, 2)
    layers = networks[chosen].layers()
    # What is measured is what was written.
    save_weights(path, {KINDS[MLP].network: layers}, card)
    card['metrics'] = measured(path, seed, recipe.metric_pairs)
    save_weights(path, {KINDS[MLP].network: layers}, card)
    return card


def _trained(batches: MlpSamples, seed: int, hidden: tuple[int, int], recipe: MlpRecipe,
             ) -> PatchNetwork:
    torch.set_num_threads(1)  # matrices this small gain nothing from more
    torch.manual_seed(seed)
    network = PatchNetwork(hidden, batches.features)
    losses = fit(network, batches, steps=recipe.steps, batch=recipe.batch, rate=recipe.rate,
                 generator=torch.Generator().manual_seed(seed))
    with tqdm(losses, f'seed {seed}', recipe.steps, unit='step', mininterval=10.0) as bar:
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


@torch.no_grad()
def _checked(network: PatchNetwork, batches: MlpSamples) -> dict[str, Any]:
    """Return the loss of a network, and its errors [%]."""
    errors = errors_of(network, batches)
    return {'loss': float(loss_of(errors)), **{
        name: error_summary(100.0 * values.numpy())
        for name, values in errors._asdict().items()}}


def model_card(path: Path, recipe: MlpRecipe, hidden: tuple[int, int], data: dict[str, Any],
               ) -> dict[str, Any]:
    """Return the card of a network before anything is measured."""
    return {
        'name': path.stem, 'model': 'mlp', 'format': NETWORK_FORMAT,
        'architecture': [FEATURES, *hidden, OUTPUTS], 'activation': KINDS[MLP].activation,
        'sizes': [],
        'inputs': {'description': 'what both boxes cut off the patch box', 'names': FEATURE_NAMES,
                   'range': [-12.0, 24.0]},
        'linear path': 'the last layer reads the inputs, then the units of the second layer',
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
