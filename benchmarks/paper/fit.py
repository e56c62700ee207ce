# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Backpropagation with momentum, for many of the paper's networks at once.

1. Inputs are normalised to mean 0 and deviation 1; `export` folds that into the first layer.
2. Every epoch goes through the training set once in random order. The learning rate falls from its
   value to zero along half a cosine over the epochs.
3. The loss is the squared error of the angles. Differences are wrapped into [−π, π), as −π and π
   are the same direction, unless the settings leave them as they are.
4. Cross-validation: each network keeps the weights of the epoch in which its error on the
   cross-validation set was least.

The same seed gives the same weights on the same machine with the same number of threads.
"""
from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.func import functional_call, stack_module_state, vmap
from tqdm import tqdm

from box_contact_ros.models.weights_file import WEIGHT_LIMIT, Layers

from .dataset import Patterns
from .errors import difference

CHECKS = 200  # least number of times that the cross-validation error is looked at in a training
DEVIATION_MIN = 1e-3
"""Least deviation by which an input is divided: folding multiplies its weights by the inverse."""
ROWS = 5000  # patterns whose answers are in memory at a time, of all networks


@dataclass(frozen=True)
class PaperSettings:
    """One training of several networks. Sequences have an entry for each; numbers hold for all."""

    widths: tuple[int, ...]  # units of each layer, inputs first: (6, 20, 18, 4)
    networks: int = 12
    epochs: int = 800
    batch: int = 50
    rate: float | Sequence[float] = 0.02
    """Learning rate at the start, for the mean loss of a mini-batch."""
    momentum: float | Sequence[float] = 0.9
    initial: float | Sequence[float] = 1.0
    """Range of the initial weights, times √(inputs of the layer)."""
    hidden: Sequence[tuple[int, ...]] = ()
    """Units of the hidden layers that each network has, if it has fewer than `widths`."""
    wrap: bool = True  # whether differences of angles are wrapped
    seed: int = 0


class Ensemble(torch.nn.Module):
    """Networks of the same shape as one module: answers have a first dimension more, `networks`.

    The networks see the same inputs and learn apart from each other.
    """

    def __init__(self, networks: Sequence[torch.nn.Module]) -> None:
        super().__init__()
        self._shape = [networks[0]]  # in a list: its own parameters are not the ensemble's
        stacked, _ = stack_module_state(list(networks))
        self._names = list(stacked)
        self._stacked = torch.nn.ParameterList(
            torch.nn.Parameter(value.detach()) for value in stacked.values())

    def forward(self, inputs: Tensor) -> Tensor:
        """Return the answers (networks, …) of all networks to the same inputs."""
        state = dict(zip(self._names, self._stacked))
        return vmap(lambda one: functional_call(self._shape[0], one, inputs))(state)

    def layers(self, network: int) -> Layers:
        """Return the layers of one network."""
        return as_layers(value[network] for value in self._stacked)


def as_layers(parameters: Iterable[Tensor]) -> Layers:
    """Return the parameters of one network as arrays, layer by layer."""
    arrays = [value.detach().cpu().numpy() for value in parameters]
    return list(zip(arrays[::2], arrays[1::2]))


@torch.no_grad()
def drawn(network: Any, generator: torch.Generator, *, reach: float,
          hidden: Sequence[int] = ()) -> Any:
    """Return the network with weights uniform in ± reach / √(inputs of the layer), biases 0.

    hidden: units of the hidden layers that are used. The weights of all others are zero, and stay
    so: such a unit's activation is zero, and with it each of its gradients.
    """
    layers = [part for part in network.modules() if isinstance(part, torch.nn.Linear)]
    inputs = [layers[0].in_features, *(hidden or [layer.out_features for layer in layers[:-1]])]
    for layer, count in zip(layers, inputs):
        bound = reach / math.sqrt(count)
        torch.nn.init.uniform_(layer.weight, -bound, bound, generator=generator)
        torch.nn.init.zeros_(layer.bias)
    for width, layer, following in zip(hidden, layers, layers[1:]):
        layer.weight[width:] = 0.0
        following.weight[:, width:] = 0.0
    return network


@dataclass(frozen=True)
class Scaling:
    """Mean and deviation (inputs,) by which inputs are normalised."""

    mean: np.ndarray
    deviation: np.ndarray

    @staticmethod
    def of(inputs: np.ndarray) -> Scaling:
        """Return the scaling that gives inputs (…, inputs) mean 0 and deviation 1."""
        # Summed in float64: there are tens of millions.
        axes = tuple(range(inputs.ndim - 1))
        mean = inputs.mean(axes, dtype=np.float64)
        deviation = inputs.std(axes, dtype=np.float64)
        deviation = np.maximum(deviation + 1e-6, DEVIATION_MIN)
        return Scaling(mean.astype(np.float32), deviation.astype(np.float32))

    def limit(self) -> Tensor:
        """Return the largest weights (inputs,) that a loader accepts once they are folded.

        Half of `WEIGHT_LIMIT`, shared by all inputs: so the sum of weights and means, which becomes
        the bias, is within it too.
        """
        share = 0.5 * WEIGHT_LIMIT / len(self.mean)
        return torch.tensor(share * self.deviation / np.maximum(1.0, np.abs(self.mean)))

    def folded(self, layers: Layers) -> Layers:
        """Return the network that takes raw inputs, from one that takes normalised inputs."""
        weight = layers[0][0].astype(np.float64) / self.deviation
        bias = layers[0][1] - weight @ self.mean
        return [(weight.astype(np.float32), bias.astype(np.float32)), *layers[1:]]


class Momentum(torch.optim.Optimizer):
    """The paper's step: Δw = −α ∂J/∂w + μ Δw of the step before, α and μ those of each network.

    A schedule changes `lr`, a factor of all α.
    """

    def __init__(self, networks: Ensemble, rate: Tensor, momentum: Tensor) -> None:
        super().__init__(networks.parameters(), {'lr': 1.0})
        self.rate, self.momentum = rate, momentum

    @torch.no_grad()
    def step(self, closure: None = None) -> None:  # type: ignore[override]
        """Take a step."""
        group = self.param_groups[0]
        for p in group['params']:
            rate, momentum = (one.view(-1, *[1] * (p.dim() - 1)) for one in (
                group['lr'] * self.rate, self.momentum))
            step = self.state[p].setdefault('step', torch.zeros_like(p))
            step.mul_(momentum).sub_(rate * p.grad)
            p.add_(step)


@dataclass
class Fitted:
    """Networks in training, with their best weights by cross-validation."""

    networks: Ensemble  # with the best weights
    scaling: Scaling
    error: Tensor  # (networks,) least root mean square cross-validation error [rad]
    epoch: Tensor  # (networks,) epoch of the best weights
    history: list[Tensor]
    """Per check, cross-validation errors (networks,) [rad] in the course of the training."""
    wrap: bool = True  # whether differences of angles are wrapped

    @torch.no_grad()
    def check(self, epoch: int, networks: Ensemble, error: Tensor) -> None:
        """Keep the weights of networks that are better than before."""
        self.history.append(error)
        better = error < self.error  # False for NaN: a network that diverged keeps its best
        self.error = torch.where(better, error, self.error)
        self.epoch[better] = epoch
        for kept, now in zip(self.networks.parameters(), networks.parameters()):
            kept[better] = now[better]

    def export(self) -> Layers:
        """Return the layers of the best network, for inputs in SI units."""
        return self.scaling.folded(self.networks.layers(int(self.error.argmin())))

    def errors(self, patterns: Patterns) -> Tensor:
        """Return the RMSE (networks,) of the best weights [rad]."""
        return rmse(self.networks, *tensors(patterns, self.scaling), self.wrap)


def perceptron(widths: Sequence[int]) -> torch.nn.Sequential:
    """Return the paper's network: hidden units by tanh, linear outputs."""
    parts: list[torch.nn.Module] = []
    for n_in, n_out in pairwise(widths):
        parts += [torch.nn.Linear(n_in, n_out), torch.nn.Tanh()]
    return torch.nn.Sequential(*parts[:-1])


def tensors(patterns: Patterns, scaling: Scaling) -> tuple[Tensor, Tensor]:
    """Return normalised inputs and outputs."""
    x = (patterns.inputs - scaling.mean) / scaling.deviation
    return (torch.tensor(x, dtype=torch.float32),
            torch.tensor(patterns.outputs, dtype=torch.float32))


@torch.no_grad()
def rmse(networks: Ensemble, x: Tensor, y: Tensor, wrap: bool) -> Tensor:
    """Return the root mean square errors (networks,) [rad]."""
    squares = [difference(networks(inputs), outputs, wrap).square().mean(2)
               for inputs, outputs in zip(x.split(ROWS), y.split(ROWS))]
    return torch.cat(squares, dim=1).mean(1).sqrt()


def fit(training: Patterns, checking: Patterns, settings: PaperSettings, *, progress: str = '',
        ) -> Fitted:
    """Train; `progress` is the title of a progress bar, none if empty."""
    s = settings
    generator = torch.Generator().manual_seed(s.seed)
    rate, momentum, initial = (torch.tensor(value, dtype=torch.float32).expand(s.networks).clone()
                               for value in (s.rate, s.momentum, s.initial))
    networks = Ensemble([
        drawn(perceptron(s.widths), generator, reach=float(reach), hidden=hidden)
        for reach, hidden in zip(initial, s.hidden or [()] * s.networks)])
    scaling = Scaling.of(training.inputs)
    x, y = tensors(training, scaling)
    check = tensors(checking, scaling)
    fitted = Fitted(copy.deepcopy(networks), scaling, torch.full((s.networks,), math.inf),
                    torch.zeros(s.networks, dtype=torch.int64), [], s.wrap)
    limit, first = scaling.limit(), next(networks.parameters())
    optimiser = Momentum(networks, rate, momentum)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, s.epochs)

    epochs = tqdm(range(1, s.epochs + 1), desc=progress, unit='epoch', mininterval=1.0,
                  disable=not progress)
    for epoch in epochs:
        order = torch.randperm(len(x), generator=generator)
        for inputs, outputs in zip(x[order].split(s.batch), y[order].split(s.batch)):
            loss = 0.5 * difference(networks(inputs), outputs, s.wrap).square().sum(-1).mean(-1)
            optimiser.zero_grad()
            loss.sum().backward()
            optimiser.step()
            first.data.clamp_(-limit, limit)
        schedule.step()
        if epoch % max(1, s.epochs // CHECKS) == 0 or epoch == s.epochs:
            fitted.check(epoch, networks, rmse(networks, *check, s.wrap))
            epochs.set_postfix(rmse=f'{fitted.error.min():.4f}', refresh=False)
    return fitted
