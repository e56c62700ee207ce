# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fit the network of model `mlp`: the answers, the loss and the training loop.

`PatchNetwork.forward` repeats core/src/mlp/mlp_model.hpp for tensors.
"""
from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from benchmarks.mlp_samples import MlpSamples
from benchmarks.paper.fit import as_layers
from box_contact_ros.core import FEATURES, OUTPUTS
from box_contact_ros.models.weights_file import Layers

LEAST_VOLUME, LEAST_DEVIATION, MOST_DEVIATION = 1e-5, 1e-3, 3.0**-0.5  # as in mlp_model.hpp
START = (-0.3, -0.3, -0.3, 0.4, 0.45, 0.45, 0.45, 0.0, 0.0, 0.0)  # outputs before the training
SOFT = 3e-3  # error below which the loss is quadratic, and above which it is linear
TAIL = 20.0  # weight of the mean square beside it: the worst cases count
UNITS = (0.15, 1.0, 1.0)  # errors of point, volume and covariance that weigh the same


class MlpErrors(NamedTuple):
    """Errors of n contacts, (n,) each."""

    point: Tensor  # [the smaller box's longest edge]
    volume: Tensor  # relative
    covariance: Tensor  # Frobenius norm, relative to the exact trace


class PatchNetwork(torch.nn.Module):
    """Two hidden layers of rectified units; outputs: centroid, volume, covariance's root."""

    def __init__(self, hidden: tuple[int, int]) -> None:
        super().__init__()
        self.first = torch.nn.Linear(FEATURES, hidden[0])
        self.second = torch.nn.Linear(*hidden)
        self.output = torch.nn.Linear(hidden[1], OUTPUTS)
        with torch.no_grad():
            self.output.weight *= 0.1
            self.output.bias.copy_(torch.tensor(START))

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return centroids (n, 3), volumes (n,) and covariances (n, 3, 3) in the patch boxes."""
        said = self.output(torch.relu(self.second(torch.relu(self.first(features)))))
        root = torch.zeros(len(said), 3, 3)
        root[:, (0, 1, 2), (0, 1, 2)] = said[:, 4:7].clamp(LEAST_DEVIATION, MOST_DEVIATION)
        root[:, (1, 2, 2), (0, 0, 1)] = said[:, 7:10].clamp(-MOST_DEVIATION, MOST_DEVIATION)
        return (said[:, :3].clamp(-1.0, 1.0), said[:, 3].square().clamp(LEAST_VOLUME, 1.0),
                root @ root.transpose(1, 2))

    def layers(self) -> Layers:
        """Return the layers."""
        return as_layers(self.parameters())


def tensors(samples: MlpSamples) -> MlpSamples:
    """Return samples as tensors of float32."""
    return samples.each(lambda array: torch.from_numpy(array).float())


def errors_of(network: torch.nn.Module, batch: MlpSamples) -> MlpErrors:
    """Return the errors of contacts, but for moves into the boxes: these make them less."""
    mean, volume, covariance = network(batch.features)
    scale = batch.half[:, :, None] * batch.half[:, None, :]
    trace = torch.diagonal(scale * batch.covariance, dim1=1, dim2=2).sum(1)
    wrong = (covariance - batch.covariance) * scale
    return MlpErrors(((mean - batch.mean) * batch.half).norm(dim=1),
                     (volume / batch.volume - 1.0).abs(),
                     wrong.square().sum((1, 2)).sqrt() / trace)


def loss_of(errors: MlpErrors) -> Tensor:
    """Return the loss: mean errors, and mean squares for the tail."""
    scaled = [(error / unit).clamp(max=2.0) for error, unit in zip(errors, UNITS)]
    return sum((error.square() + SOFT**2).sqrt().mean() + TAIL * error.square().mean()
               for error in scaled)


def fit(network: torch.nn.Module, samples: MlpSamples, *, steps: int, batch: int, rate: float,
        generator: torch.Generator) -> Iterator[Tensor]:
    """Train a network by Adam; yield the loss of every step before the step.

    The learning rate falls from `rate` to zero along half a cosine.
    """
    optimiser = torch.optim.Adam(network.parameters(), lr=rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for _ in range(steps):
        rows = torch.randint(len(samples), (batch,), generator=generator)
        loss = loss_of(errors_of(network, samples.part(rows)))
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        yield loss.detach()
