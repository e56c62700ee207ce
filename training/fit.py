# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fit the network of model `mlp`: samples as tensors, the answers, the loss and the training loop.

The network says where between its brackets the volume is that each upper face cuts off
(core/src/columns/upper_faces.hpp). Volume, centroid and covariance of the overlap follow from it as
in core/src/mlp/mlp_model.hpp.
"""
from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from benchmarks.paper.fit import as_layers
from box_contact_ros.core import FEATURES
from box_contact_ros.solver.weights_file import Layers

from .samples import MlpSamples

SOFT = 1e-5
"""Error below which the loss is quadratic, and above which it is linear."""
TAIL = 300.0  # weight of the mean square beside it: the worst cases count
OF_VOLUME = 100.0
"""Weight of the volume's error. Point and covariance also depend on where an upper face's two
points of mass are. The network cannot change that, and would give up the volume for it."""


class MlpErrors(NamedTuple):
    """Errors of n contacts, (n,) each."""

    point: Tensor  # [root of the covariance's trace]
    volume: Tensor  # relative
    covariance: Tensor  # of the covariance's eigenvalues, relative: Frobenius norm


class ShareNetwork(torch.nn.Module):
    """One hidden layer of rectified units and one output between 0 and 1."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.hidden = torch.nn.Linear(FEATURES, hidden)
        self.output = torch.nn.Linear(hidden, 1)

    def forward(self, features: Tensor) -> Tensor:
        """Return the answers (…,) for features (…, FEATURES)."""
        x = self.output(torch.relu(self.hidden(features)))[..., 0]
        x = x.clamp(-3.0, 3.0)
        return 0.5 + 0.5 * x * (27.0 + x * x) / (27.0 + 9.0 * x * x)

    def layers(self) -> Layers:
        """Return the layers."""
        return as_layers(self.parameters())


def tensors(samples: MlpSamples) -> MlpSamples:
    """Return samples as tensors of float32."""
    return samples.each(lambda array: torch.from_numpy(array).float())


def errors_of(network: torch.nn.Module, batch: MlpSamples) -> MlpErrors:
    """Return the errors of contacts."""
    share = batch.least + network(batch.features) * (batch.most - batch.least)
    cut = (batch.cut * share)[..., None] * batch.carries
    volume = 1.0 - cut.sum((1, 2))
    first = (cut[..., None] * batch.points).sum((1, 2))
    second = torch.einsum('nkp,nkpi,nkpj->nij', cut, batch.points, batch.points)
    shift = first / volume[:, None]
    covariance = ((batch.columns_covariance - second) / volume[:, None, None]
                  - shift[:, :, None] * shift[:, None, :])
    wrong = batch.whitening @ (covariance - batch.covariance) @ batch.whitening.mT
    return MlpErrors((shift + batch.mean).norm(dim=-1), (volume / batch.volume - 1.0).abs(),
                     wrong.square().sum((1, 2)).sqrt())


def loss_of(errors: MlpErrors) -> Tensor:
    """Return the loss: mean errors, and mean squares for the tail."""
    of_point, of_volume, of_covariance = (
        (error.square() + SOFT**2).sqrt().mean() + TAIL * error.square().mean()
        for error in errors)
    return of_point + OF_VOLUME * of_volume + of_covariance


def fit(network: torch.nn.Module, samples: MlpSamples, *, steps: int, batch: int, rate: float,
        generator: torch.Generator) -> Iterator[Tensor]:
    """Train a network by Adam; yield the loss of every step before the step.

    The learning rate falls from `rate` to zero along half a cosine.
    """
    optimiser = torch.optim.Adam(network.parameters(), lr=rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    data = tensors(samples)
    for _ in range(steps):
        rows = torch.randint(len(samples), (min(batch, len(samples)),), generator=generator)
        loss = loss_of(errors_of(network, data.part(rows)))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        yield loss.detach()
