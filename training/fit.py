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

# As in mlp_model.hpp.
FADE, LEAST_VOLUME, LEAST_DEVIATION, MOST_DEVIATION = 1e-2, 1e-5, 1e-3, 3.0**-0.5
START = (-0.3, -0.3, -0.3, 0.4, 0.45, 0.45, 0.45, 0.0, 0.0, 0.0)  # outputs before the training
SOFT = 3e-3  # error below which the loss is quadratic, and above which it is linear
TAIL = 20.0  # weight of the mean square beside it: the worst cases count
UNITS = (0.1, 1.0, 1.0)  # errors of point, volume and covariance that weigh the same
LEAST_SQUARE = 1e-16  # under roots of errors, whose slope has no bound at 0


class MlpErrors(NamedTuple):
    """Errors of n contacts, (n,) each."""

    point: Tensor  # [the smaller box's longest edge]
    volume: Tensor  # relative
    covariance: Tensor  # Frobenius norm, relative to the exact trace


class MlpAnswers(NamedTuple):
    """Answers for n contacts, in the coordinates of the patch boxes."""

    mean: Tensor  # (n, 3)
    volume: Tensor  # (n,)
    covariance: Tensor  # (n, 6): xx, yy, zz, xy, xz, yz


class PatchNetwork(torch.nn.Module):
    """Two hidden layers of rectified units; outputs: centroid, volume, covariance's root.

    The last layer reads the features, too: a linear path beside the hidden layers.
    """

    mean: Tensor
    deviation: Tensor

    def __init__(self, hidden: tuple[int, int], features: Tensor) -> None:
        """Take the units of the hidden layers, and the features (n, FEATURES) of the data.

        The network reads features less their mean, by their deviation. `layers` folds this in.
        """
        super().__init__()
        self.register_buffer('mean', features.mean(0))
        self.register_buffer('deviation', features.std(0))
        self.first = torch.nn.Linear(FEATURES, hidden[0])
        self.second = torch.nn.Linear(*hidden)
        self.output = torch.nn.Linear(FEATURES + hidden[1], OUTPUTS)
        with torch.no_grad():
            self.output.weight *= 0.1
            self.output.weight[:, :FEATURES] = 0.0
            self.output.bias.copy_(torch.tensor(START))

    def forward(self, features: Tensor) -> MlpAnswers:
        """Return the answers for features (n, FEATURES)."""
        scaled = (features - self.mean) / self.deviation
        units = torch.relu(self.second(torch.relu(self.first(scaled))))
        said = self.output(torch.cat([scaled, units], dim=1))
        fade = (features[:, :3].abs() / FADE).clamp(max=1.0)
        xx, yy, zz = said[:, 4:7].clamp(LEAST_DEVIATION, MOST_DEVIATION).unbind(1)
        yx, zx, zy = said[:, 7:10].clamp(-MOST_DEVIATION, MOST_DEVIATION).unbind(1)
        return MlpAnswers(said[:, :3].clamp(-1.0, 1.0) * fade,
                          said[:, 3].square().clamp(LEAST_VOLUME, 1.0),
                          torch.stack([xx * xx, yx * yx + yy * yy, zx * zx + zy * zy + zz * zz,
                                       yx * xx, zx * xx, zx * yx + zy * yy], dim=1))

    def layers(self) -> Layers:
        """Return the layers for features as they are."""
        (first, bias), second, (output, start) = as_layers(self.parameters())
        mean, deviation = self.mean.numpy(), self.deviation.numpy()
        output = output.copy()
        path = output[:, :FEATURES] = output[:, :FEATURES] / deviation
        first = first / deviation
        return [(first, bias - first @ mean), second, (output, start - path @ mean)]


def tensors(samples: MlpSamples) -> MlpSamples:
    """Return samples as tensors of float32."""
    return samples.each(lambda array: torch.from_numpy(array).float())


def errors_of(network: torch.nn.Module, batch: MlpSamples) -> MlpErrors:
    """Return the errors of contacts, but for moves into the boxes: these make them less."""
    answer = network(batch.features)
    # Relative to the largest half extent: squares of an overlap of nanometres have no float32.
    x, y, z = (batch.half / batch.half.amax(1, keepdim=True)).unbind(1)
    scale = torch.stack([x * x, y * y, z * z, x * y, x * z, y * z], dim=1)
    truth = batch.covariance.flatten(1)[:, (0, 4, 8, 1, 2, 5)] * scale
    wrong = (answer.covariance * scale - truth).square()
    off = ((answer.mean - batch.mean) * batch.half).square().sum(1)
    return MlpErrors((off + LEAST_SQUARE).sqrt(),
                     (answer.volume / batch.volume - 1.0).abs(),
                     (wrong[:, :3].sum(1) + 2.0 * wrong[:, 3:].sum(1) + LEAST_SQUARE).sqrt()
                     / truth[:, :3].sum(1))


def loss_of(errors: MlpErrors) -> Tensor:
    """Return the loss: mean errors, and mean squares for the tail."""
    scaled = [(error / unit).clamp(max=2.0) for error, unit in zip(errors, UNITS)]
    return sum((error.square() + SOFT**2).sqrt().mean() + TAIL * error.square().mean()
               for error in scaled)


def fit(network: torch.nn.Module, samples: MlpSamples, *, steps: int, batch: int, rate: float,
        generator: torch.Generator) -> Iterator[Tensor]:
    """Train a network by Adam; yield the loss of every step before the step.

    The learning rate falls from `rate` to zero along half a cosine. Raises FloatingPointError,
    which names the step, where the loss or its gradient is not finite.
    """
    # One row a contact: a batch is gathered at once, in a quarter of the time of five arrays.
    arrays = [array.flatten(1) if array.ndim > 1 else array[:, None]
              for array in vars(samples).values()]
    columns = [array.shape[1] for array in arrays]
    packed = torch.cat(arrays, dim=1)
    optimiser = torch.optim.Adam(network.parameters(), lr=rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for step in range(steps):
        rows = torch.randint(len(samples), (batch,), generator=generator)
        features, half, volume, mean, covariance = packed[rows].split(columns, dim=1)
        loss = loss_of(errors_of(network, MlpSamples(
            features=features, half=half, volume=volume[:, 0], mean=mean, covariance=covariance)))
        optimiser.zero_grad()
        loss.backward()
        slope = torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        if not torch.isfinite(loss + slope):
            raise FloatingPointError(f'step {step} of {steps}: the loss is {loss.item():g}, its '
                                     f'gradient {slope.item():g}; the training ends here')
        optimiser.step()
        schedule.step()
        yield loss.detach()
