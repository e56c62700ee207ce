"""Fit the network of model `mlp`: the module, the loss and the training loop.

A contact is SITES patterns for the network. The outputs, times the contact's vectors, add up to an
offset in half extents: the centroid from the middle of the bounds (core/mlp.hpp).

Automatic differentiation takes 2.3 ms for a step of 4,096 contacts. With the contacts first, not
last, it takes 4.6 ms.
"""
from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from ..core import FEATURES, OUTPUTS
from .ensemble import Layers, Scaling, linear_layers
from .samples import MlpSamples

POINT_WEIGHT, TAIL_WEIGHT = 10.0, 3e3
"""Weights of the squared point error and of its square; the squared offset error has 1. Ten makes
the first two alike over the data; the third counts from errors of 5 % of the edge."""
CHUNK = 1024  # contacts whose errors are computed at a time: large ensembles stay within 200 MB


class SiteNetwork(torch.nn.Module):
    """The network of core/mlp.hpp: one hidden layer of rectified units, asked at each site."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.hidden = torch.nn.Linear(FEATURES, hidden)
        self.outputs = torch.nn.Linear(hidden, OUTPUTS)

    def forward(self, features: Tensor, vectors: Tensor) -> Tensor:
        """Return offsets (3, n) from features (SITES, FEATURES, n), vectors (SITES, OUTPUTS, n)."""
        outputs = at_sites(self.outputs, torch.relu_(at_sites(self.hidden, features)))
        return (outputs * vectors).unflatten(0, (3, 3)).sum((0, 2))

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


def loss_of(answers: Tensor, batch: MlpSamples) -> Tensor:
    """Return the loss, or one for each network, of answers (…, 3, n).

    Three terms: the squared offset error, the squared point error in edges of the smaller box, and
    the fourth power of the point error. A simulation trips over the worst cases, hence the last.
    """
    error = answers - batch.offsets
    squared = (error * batch.scale).square().sum(-2)
    return (error.square().mean((-2, -1)) + POINT_WEIGHT * squared.mean(-1)
            + TAIL_WEIGHT * squared.square().mean(-1))


def fit(network: torch.nn.Module, batches: Iterable[MlpSamples], *, steps: int, rate: float,
        ) -> Iterator[Tensor]:
    """Train a network, or an ensemble, by Adam; yield the loss of every step before the step.

    The learning rate falls from `rate` to zero along half a cosine.
    """
    optimiser = torch.optim.Adam(network.parameters(), lr=rate, fused=True)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for batch in batches:
        loss = loss_of(network(batch.features, batch.vectors), batch)
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
        error = network(some.features, some.vectors) - some.offsets
        found.append((error * some.scale).norm(dim=-2))
    return torch.cat(found, -1).cpu().numpy()
