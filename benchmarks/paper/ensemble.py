# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Networks in PyTorch: their layers, what they start from, and many trained at once."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.func import functional_call, stack_module_state, vmap

from box_contact_ros.solver.weights_file import Layers


class Ensemble(torch.nn.Module):
    """Networks of the same shape as one module: answers have a first dimension more, `networks`.

    The networks see the same inputs and learn apart from each other.

    units: one for each network, in which its parameters are kept. Adam moves a number by its rate,
    whatever the scale of the gradient. So `units` are learning rates, for a rate of 1.
    """

    _units: Tensor | None

    def __init__(self, networks: Sequence[torch.nn.Module], units: Sequence[float] | None = None,
                 ) -> None:
        super().__init__()
        self._shape = [networks[0]]  # in a list: its own parameters are not the ensemble's
        stacked, _ = stack_module_state(list(networks))
        self._names = list(stacked)
        self.register_buffer('_units', None if units is None else torch.tensor(units))
        self._stacked = torch.nn.ParameterList(
            torch.nn.Parameter(self._times(value.detach(), -1)) for value in stacked.values())

    def forward(self, *inputs: Any) -> Tensor:
        """Return the answers (networks, …) of all networks to the same inputs."""
        return vmap(lambda state: functional_call(self._shape[0], state, inputs))(self.state())

    def state(self) -> dict[str, Tensor]:
        """Return the parameters (networks, …) by their names in one network."""
        return {name: self._times(value, 1) for name, value in zip(self._names, self._stacked)}

    def layers(self, network: int) -> Layers:
        """Return the layers of one network."""
        return as_layers(value[network] for value in self.state().values())

    def _times(self, value: Tensor, power: int) -> Tensor:
        if self._units is None:
            return value
        return value * self._units.view(-1, *[1] * (value.dim() - 1))**power


def as_layers(parameters: Iterable[Tensor]) -> Layers:
    """Return the parameters of one network as arrays, layer by layer."""
    arrays = [value.detach().cpu().numpy() for value in parameters]
    return list(zip(arrays[::2], arrays[1::2]))


@torch.no_grad()
def drawn(network: Any, generator: torch.Generator, *, reach: float = math.sqrt(3.0),
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
        # Summed in float64: there are tens of millions. An input that never varies stays as it is.
        axes = tuple(range(inputs.ndim - 1))
        mean = inputs.mean(axes, dtype=np.float64)
        deviation = inputs.std(axes, dtype=np.float64)
        return Scaling(mean.astype(np.float32), (deviation + 1e-6).astype(np.float32))

    def folded(self, layers: Layers) -> Layers:
        """Return the network that takes raw inputs, from one that takes normalised inputs."""
        weight = layers[0][0].astype(np.float64) / self.deviation
        bias = layers[0][1] - weight @ self.mean
        return [(weight.astype(np.float32), bias.astype(np.float32)), *layers[1:]]

    def unfolded(self, layers: Layers) -> Layers:
        """Return the network that takes normalised inputs, from one that takes raw inputs."""
        weight = layers[0][0].astype(np.float64)
        bias = layers[0][1] + weight @ self.mean
        return [((weight * self.deviation).astype(np.float32), bias.astype(np.float32)),
                *layers[1:]]
