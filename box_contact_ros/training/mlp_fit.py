# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fit the network of model `mlp`: the module, the loss and the training loop.

A contact is SITES patterns for the network. The outputs, times the contact's vectors, add up to the
centroid, the volume and the covariance of the overlap in its bounds (core/src/mlp/).

The contacts are last in all arrays. With the contacts first, a step takes twice as long.
"""
from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ..core import FEATURES, OUTPUTS
from .ensemble import Layers, Scaling, as_layers, drawn
from .samples import COLUMN, ROW, MlpSamples

POINT_WEIGHT, TAIL_WEIGHT = 10.0, 3e3
"""Weights of the squared point error and of its square; the squared offset error has 1. Ten makes
the first two alike over the data; the third counts from errors of 5 % of the edge."""
VOLUME_WEIGHT, COVARIANCE_WEIGHT, PATCH_TAIL = 0.3, 0.3, 10.0
"""Weights of the squared errors of volume and covariance, relative, and of their squares beside
them, which count from errors of 30 %."""
LARGEST_VOLUME_ERROR = 3.0
"""Relative errors of the volume count up to this: at the start some are a hundred times larger."""
PRECISION, PRECISION_REACH = 3.0, 6.0
"""Precision of an uncut cube along an axis, and the logarithm of the most that cuts multiply it."""
START = (-1.0, 0.5, 3.0)
"""Biases from which the outputs for volume, precision and coupling start: cuts shrink the cube."""
CHUNK = 1024
"""Contacts whose errors are computed at a time: large ensembles stay within 200 MB."""


class MlpAnswers(NamedTuple):
    """What a network, or each of an ensemble (…), says of n overlaps in their bounds."""

    offsets: Tensor  # (…, 3, n) as in `MlpSamples`
    log_volume: Tensor  # (…, n) logarithm of the volume by that of the bounds
    covariance: Tensor  # (…, 6, n) as in `MlpSamples`


class SiteNetwork(torch.nn.Module):
    """The network of core/src/mlp/: one hidden layer of rectified units, asked at each site."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.hidden = torch.nn.Linear(FEATURES, hidden)
        self.outputs = torch.nn.Linear(hidden, OUTPUTS)

    def forward(self, batch: MlpSamples) -> MlpAnswers:
        """Return the answers for samples as tensors; see `tensors`."""
        outputs = at_sites(self.outputs, torch.relu_(at_sites(self.hidden, batch.features)))
        f_q = outputs.unflatten(0, (3, 3)).movedim(2, 0)  # (OUTPUTS, f, q, n)
        along = batch.vectors.unflatten(0, (3, 3)).movedim(2, 0)
        cut = batch.cut[:, None]
        slanted = batch.slant.abs() * cut
        log_volume = (slanted * f_q[3]).sum((0, 1)).clamp(max=0.0)
        stretch = (slanted * f_q[4]).sum(0).clamp(0.0, PRECISION_REACH)
        coupling, pushed = batch.slant * f_q[5], (along[0] * f_q[6]).sum(0)
        precision = ((cut * coupling[:, ROW] * coupling[:, COLUMN]).sum(0)
                     + pushed[ROW] * pushed[COLUMN])
        diagonal = precision[:3] + PRECISION * stretch.exp()
        return MlpAnswers((f_q[:3] * along).sum((0, 1)), log_volume,
                          inverted(torch.cat([diagonal, precision[3:]])))

    @torch.no_grad()
    def load(self, layers: Layers) -> None:
        """Take over the layers of a network of the same shape."""
        for own, array in zip(self.parameters(), chain.from_iterable(layers)):
            own.copy_(torch.from_numpy(array))

    def layers(self) -> Layers:
        """Return the layers, for normalised inputs."""
        return as_layers(self.parameters())


def at_sites(layer: torch.nn.Linear, x: Tensor) -> Tensor:
    """Apply a layer at each site: (SITES, inputs, n) to (SITES, outputs, n)."""
    return torch.baddbmm(layer.bias[:, None], layer.weight.expand(len(x), -1, -1), x)


def inverted(matrix: Tensor) -> Tensor:
    """Return the inverses of symmetric matrices, both as (6, n): xx, yy, zz, yz, xz, xy."""
    xx, yy, zz, yz, xz, xy = matrix
    first, *others = cofactors = (
        yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy,
        xz * xy - xx * yz, xy * yz - yy * xz, yz * xz - zz * xy)
    return torch.stack(cofactors) / (xx * first + xy * others[4] + xz * others[3])


def started(units: int, generator: torch.Generator, hidden: Sequence[int] = ()) -> SiteNetwork:
    """Return a network of `units` hidden units before its training; see `drawn`."""
    network: SiteNetwork = drawn(SiteNetwork(units), generator, hidden=hidden)
    with torch.no_grad():
        network.outputs.bias[3:6] = torch.tensor(START)
    return network


def tensors(data: MlpSamples, scaling: Scaling, device: str = 'cpu') -> MlpSamples:
    """Return samples as tensors, their features normalised."""
    features = (data.features - scaling.mean[:, None]) / scaling.deviation[:, None]
    return replace(data, features=features).each(
        lambda array: torch.from_numpy(np.ascontiguousarray(array)).to(device))


def random_batches(data: MlpSamples, scaling: Scaling, rng: np.random.Generator, *, size: int,
                   count: int, device: str = 'cpu') -> Iterator[MlpSamples]:
    """Yield `count` batches of `size` contacts, or of all if there are fewer.

    The data are shuffled once, and each batch starts at a random place: nothing is gathered later.
    """
    shuffled = tensors(data.part(rng.permutation(len(data))), scaling, device)
    size = min(size, len(data))
    for place in rng.integers(0, len(data) - size + 1, count).tolist():
        yield shuffled.part(slice(place, place + size))


def losses_of(answers: MlpAnswers, batch: MlpSamples) -> Tensor:
    """Return the loss (…, n) of each contact.

    Of the point: the squared offset error, the squared point error in edges of the smaller box, and
    its square. Of volume and covariance: the squared relative error and its square. A simulation
    trips over the worst cases, hence the fourth powers.
    """
    offset = answers.offsets - batch.offsets
    point = (offset * batch.scale).square().sum(-2)
    volume = answers.log_volume.exp() / batch.volume - 1.0
    volume = volume.clamp(max=LARGEST_VOLUME_ERROR).square()
    covariance = ((answers.covariance - batch.covariance)
                  * batch.spread[ROW] * batch.spread[COLUMN])
    # All nine, by the trace: what is beside the diagonal counts twice.
    covariance = torch.cat([covariance, covariance[..., 3:, :]], -2).square().sum(-2)
    return (offset.square().mean(-2) + POINT_WEIGHT * point + TAIL_WEIGHT * point.square()
            + VOLUME_WEIGHT * (volume + PATCH_TAIL * volume.square())
            + COVARIANCE_WEIGHT * (covariance + PATCH_TAIL * covariance.square()))


def fit(network: torch.nn.Module, batches: Iterable[MlpSamples], *, steps: int, rate: float,
        ) -> Iterator[Tensor]:
    """Train a network, or an ensemble, by Adam; yield the loss of every step before the step.

    The learning rate falls from `rate` to zero along half a cosine.
    """
    optimiser = torch.optim.Adam(network.parameters(), lr=rate, fused=True)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for batch in batches:
        loss = losses_of(network(batch), batch).mean(-1)
        optimiser.zero_grad()
        loss.sum().backward()
        optimiser.step()
        schedule.step()
        yield loss.detach()


@torch.no_grad()
def point_errors(network: torch.nn.Module, data: MlpSamples, scaling: Scaling) -> np.ndarray:
    """Return point errors (…, n) in edges of the smaller box, before the solver moves the point."""
    device = next(network.parameters()).device.type
    found = []
    for start in range(0, len(data), CHUNK):
        some = tensors(data.part(slice(start, start + CHUNK)), scaling, device)
        found.append(((network(some).offsets - some.offsets) * some.scale).norm(dim=-2))
    return torch.cat(found, -1).cpu().numpy()
