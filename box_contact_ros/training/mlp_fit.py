"""Fit the network of model `mlp`: the module, the loss and the training loop.

A contact is SITES patterns for the network. The outputs, times the contact's vectors, add up to the
centroid, the volume and the covariance of the overlap in its bounds (core/mlp.hpp).

The contacts are last in all arrays. With the contacts first, a step takes twice as long.
"""
from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ..core import FEATURES, OUTPUTS
from .ensemble import Layers, Scaling, drawn, linear_layers
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

    offsets: Tensor
    """(…, 3, n): as in `MlpSamples`."""
    log_volume: Tensor
    """(…, n): logarithm of the volume by that of the bounds."""
    covariance: Tensor
    """(…, 6, n): as in `MlpSamples`."""


class SiteNetwork(torch.nn.Module):
    """The network of core/mlp.hpp: one hidden layer of rectified units, asked at each site."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.hidden = torch.nn.Linear(FEATURES, hidden)
        self.outputs = torch.nn.Linear(hidden, OUTPUTS)

    def forward(self, features: Tensor, vectors: Tensor, slant: Tensor, cut: Tensor) -> MlpAnswers:
        """Return the answers for the fields of `MlpSamples`, features normalised."""
        outputs = at_sites(self.outputs, torch.relu_(at_sites(self.hidden, features)))
        f_q = outputs.unflatten(0, (3, 3)).movedim(2, 0)  # (OUTPUTS, f, q, n)
        along = vectors.unflatten(0, (3, 3)).movedim(2, 0)
        slanted = slant.abs() * cut[:, None]
        log_volume = (slanted * f_q[3]).sum((0, 1)).clamp(max=0.0)
        stretch = (slanted * f_q[4]).sum(0).clamp(0.0, PRECISION_REACH)
        coupling, pushed = slant * f_q[5], (along[0] * f_q[6]).sum(0)
        precision = ((cut[:, None] * coupling[:, ROW] * coupling[:, COLUMN]).sum(0)
                     + pushed[ROW] * pushed[COLUMN])
        diagonal = precision[:3] + PRECISION * stretch.exp()
        return MlpAnswers((f_q[:3] * along).sum((0, 1)), log_volume,
                          inverted(torch.cat([diagonal, precision[3:]])))

    @torch.no_grad()
    def load(self, layers: Layers) -> None:
        """Take over the layers of a network of the same shape."""
        for own, (weight, bias) in zip(linear_layers(self), layers):
            own.weight.copy_(torch.from_numpy(weight))
            own.bias.copy_(torch.from_numpy(bias))

    def layers(self) -> Layers:
        """Return the layers, for normalised inputs."""
        return [(own.weight.detach().cpu().numpy(), own.bias.detach().cpu().numpy())
                for own in linear_layers(self)]


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


def asked(network: torch.nn.Module, batch: MlpSamples) -> MlpAnswers:
    """Return a network's answers for samples as tensors."""
    answers: MlpAnswers = network(batch.features, batch.vectors, batch.slant, batch.cut)
    return answers


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
    volume, covariance = patch_errors(answers, batch)
    volume = volume.clamp(max=LARGEST_VOLUME_ERROR).square()
    covariance = covariance.square().sum(-2)
    return (offset.square().mean(-2) + POINT_WEIGHT * point + TAIL_WEIGHT * point.square()
            + VOLUME_WEIGHT * (volume + PATCH_TAIL * volume.square())
            + COVARIANCE_WEIGHT * (covariance + PATCH_TAIL * covariance.square()))


def patch_errors(answers: MlpAnswers, batch: MlpSamples) -> tuple[Tensor, Tensor]:
    """Return errors of the volume (…, n), relative, and the covariance (…, 9, n) by its trace."""
    volume = answers.log_volume.exp() / batch.volume - 1.0
    covariance = ((answers.covariance - batch.covariance)
                  * batch.spread[ROW] * batch.spread[COLUMN])
    return volume, torch.cat([covariance, covariance[..., 3:, :]], -2)


def fit(network: torch.nn.Module, batches: Iterable[MlpSamples], *, steps: int, rate: float,
        ) -> Iterator[Tensor]:
    """Train a network, or an ensemble, by Adam; yield the loss of every step before the step.

    The learning rate falls from `rate` to zero along half a cosine.
    """
    optimiser = torch.optim.Adam(network.parameters(), lr=rate, fused=True)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for batch in batches:
        loss = losses_of(asked(network, batch), batch).mean(-1)
        optimiser.zero_grad()
        loss.sum().backward()
        optimiser.step()
        schedule.step()
        yield loss.detach()


@torch.no_grad()
def evaluated(network: torch.nn.Module, data: MlpSamples, scaling: Scaling,
              measure: Callable[[MlpAnswers, MlpSamples], Tensor]) -> np.ndarray:
    """Return what `measure` says of a network's answers, some contacts after the other."""
    device = next(network.parameters()).device.type
    found = []
    for start in range(0, len(data), CHUNK):
        some = tensors(data.part(slice(start, start + CHUNK)), scaling, device)
        found.append(measure(asked(network, some), some))
    return torch.cat(found, -1).cpu().numpy()


def point_errors(answers: MlpAnswers, batch: MlpSamples) -> Tensor:
    """Return point errors (…, n) in edges of the smaller box, before the solver moves the point."""
    return ((answers.offsets - batch.offsets) * batch.scale).norm(dim=-2)
