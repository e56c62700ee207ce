"""Fit networks for model `mlp`: many at once, of any hidden widths, by Adam.

All networks of a call are one batch of matrices with a leading dimension `networks`, as in `fit`.
They have equally many hidden layers, as wide as the widest network needs (`batched`). A contact is
SITES patterns for the network. The outputs, times the contact's vectors, add up to an offset in
half extents: the centroid from the middle of the bounding box (core/mlp.hpp).

The loss has three terms: the squared offset error, the squared point error in edges of the smaller
box, and the fourth power of the point error. A simulation trips over the worst cases, hence the
last.
"""
from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from ..core import FEATURES, OUTPUTS
from .samples import MlpSamples

POINT_WEIGHT, TAIL_WEIGHT = 10.0, 3e3
"""Weights of the squared point error, and of its square, beside the squared offset error. Ten makes
the first two alike over the data; the third counts from errors of 5 % of the edge."""
BETA1, BETA2, TINY = 0.9, 0.999, 1e-8  # Adam's usual constants (Kingma and Ba 2015)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """One training. Sequences have an entry per network."""

    hidden: Sequence[tuple[int, ...]]
    """Units of the hidden layers of each network, all with as many layers."""
    steps: int
    batch: int = 4096
    rate: float | Sequence[float] = 4e-3
    """Learning rate at the start; it falls to zero along half a cosine."""
    seed: int = 0
    device: str = 'cpu'


def device_of(name: str) -> str:
    """What a program's argument --device names: `auto` is a GPU where PyTorch finds one."""
    if name == 'cuda' and not torch.cuda.is_available():
        raise argparse.ArgumentTypeError('cuda: PyTorch finds no GPU here')
    return ('cuda' if torch.cuda.is_available() else 'cpu') if name == 'auto' else name


Layers = list[tuple[np.ndarray, np.ndarray]]
"""(weight (outputs, inputs), bias (outputs,)) of each layer, float32."""


def drawn(rng: np.random.Generator, widths: Sequence[int], reach: float = math.sqrt(3.0)) -> Layers:
    """A network to start from: weights uniform in ± reach / √(inputs of the layer), biases 0."""
    return [((reach / math.sqrt(n_in) * rng.uniform(-1.0, 1.0, (n_out, n_in))).astype(np.float32),
             np.zeros(n_out, dtype=np.float32)) for n_in, n_out in zip(widths, widths[1:])]


def batched(networks: Sequence[Layers]) -> list[torch.Tensor]:
    """Networks with equally many layers as one batch of matrices, padded with zeros.

    Returns the weights (networks, inputs, outputs) of all layers, then their biases
    (networks, 1, outputs). Units that a network does not have need no mask: with all weights zero
    on both sides their activation and every gradient are zero, and they stay so.
    """
    weights, biases = [], []
    for layer in zip(*networks):
        n_out, n_in = (max(weight.shape[axis] for weight, _ in layer) for axis in (0, 1))
        weights.append(torch.zeros((len(networks), n_in, n_out)))
        biases.append(torch.zeros((len(networks), 1, n_out)))
        for k, (weight, bias) in enumerate(layer):
            weights[-1][k, :weight.shape[1], :weight.shape[0]] = torch.tensor(weight.T.copy())
            biases[-1][k, 0, :len(bias)] = torch.tensor(bias)
    return weights + biases


def unbatched(parameters: Sequence[torch.Tensor], networks: Sequence[Sequence[int]],
              ) -> list[Layers]:
    """What `batched` was given, from its result and the widths of each network."""
    count = len(parameters) // 2
    host = [p.cpu().numpy() for p in parameters]
    return [[(host[layer][k, :widths[layer], :widths[layer + 1]].T.copy(),
              host[count + layer][k, 0, :widths[layer + 1]].copy()) for layer in range(count)]
            for k, widths in enumerate(networks)]


def normalisation(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and deviation (inputs,) that normalise inputs (n, sites, inputs)."""
    # An input that never varies stays as it is. Summed in float64: there are tens of millions.
    mean, deviation = (of(inputs, axis=(0, 1), dtype=np.float64) for of in (np.mean, np.std))
    return mean.astype(np.float32), (deviation + 1e-6).astype(np.float32)


def folded(layers: Layers, mean: np.ndarray, deviation: np.ndarray) -> Layers:
    """The network that takes raw inputs and says what `layers` say of normalised ones."""
    weight = layers[0][0].astype(np.float64) / deviation
    bias = layers[0][1] - weight @ mean.astype(np.float64)
    return [(weight.astype(np.float32), bias.astype(np.float32)), *layers[1:]]


def unfolded(layers: Layers, mean: np.ndarray, deviation: np.ndarray) -> Layers:
    """The inverse of `folded`."""
    weight = layers[0][0].astype(np.float64)
    bias = layers[0][1] + weight @ mean.astype(np.float64)
    return [((weight * deviation).astype(np.float32), bias.astype(np.float32)), *layers[1:]]


def relu(x: torch.Tensor) -> torch.Tensor:
    """Return the hidden units' activation, that of core/mlp.hpp; x is overwritten."""
    return x.relu_()


class Fit:
    """A training that can be run step by step, and asked for its errors in between."""

    def __init__(self, data: MlpSamples, settings: Settings, *,
                 start: Sequence[Layers] | None = None) -> None:
        """`start`: the layers of every network for normalised inputs, instead of random ones."""
        s = self.settings = settings
        self.device = torch.device(s.device)
        self.mean, self.deviation = normalisation(data.features)
        self.batch = min(s.batch, len(data))
        self._places = np.random.default_rng([s.seed, 1])
        self.feed(data)
        self.widths = [(FEATURES, *hidden, OUTPUTS) for hidden in s.hidden]
        if start is None:
            start = [drawn(np.random.default_rng([s.seed, 2, k]), widths)
                     for k, widths in enumerate(self.widths)]
        self.parameters = [p.to(self.device) for p in batched(start)]
        self._first = [torch.zeros_like(p) for p in self.parameters]
        self._second = [torch.zeros_like(p) for p in self.parameters]
        rate = np.broadcast_to(np.asarray(s.rate, dtype=np.float32), (len(start),)).copy()
        self._rate = torch.tensor(rate, device=self.device).reshape(-1, 1, 1)
        self.step = 0

    def feed(self, data: MlpSamples) -> None:
        """Go on with these data; the normalisation of the inputs stays that of the first ones."""
        # Batches are slices from a random place on: the data are shuffled once, and rows need not
        # be gathered in every step (a third of its time).
        order = np.random.default_rng([self.settings.seed, 0]).permutation(len(data))
        self.inputs = self._normalised(data.features[order])
        self.vectors, self.offsets, self.squared_scale = (
            torch.tensor(part[order], device=self.device)
            for part in (data.vectors, data.offsets, data.scale))
        self.squared_scale.square_()

    def _normalised(self, inputs: np.ndarray) -> torch.Tensor:
        return torch.tensor((inputs - self.mean) / self.deviation, device=self.device)

    def layers(self, inputs: torch.Tensor) -> list[torch.Tensor]:
        """Activations (networks, n · SITES, units) of all layers for inputs (n, SITES, inputs)."""
        p = self.parameters
        count = len(p) // 2
        found = [inputs.reshape(1, -1, FEATURES).expand(p[0].shape[0], -1, -1)]
        for layer in range(count):
            total = torch.baddbmm(p[count + layer], found[-1], p[layer])
            found.append(relu(total) if layer < count - 1 else total)
        return found

    @staticmethod
    def answers(outputs: torch.Tensor, vectors: torch.Tensor) -> torch.Tensor:
        """Offsets (networks, n, 3) from outputs (networks, n · SITES, OUTPUTS)."""
        products = outputs.view(len(outputs), *vectors.shape) * vectors
        return products.view(len(outputs), len(vectors), 3, 3, OUTPUTS).sum(dim=(2, 4))

    def run(self, steps: int) -> np.ndarray:
        """Take so many steps (at most to the end); returns the last loss (networks,)."""
        s, p = self.settings, self.parameters
        count = len(p) // 2
        loss = torch.full((len(p[0]),), math.nan)
        steps = min(steps, s.steps - self.step)
        places = self._places.integers(0, len(self.inputs) - self.batch + 1, steps)
        for place in places.tolist():
            rows = slice(place, place + self.batch)
            layers = self.layers(self.inputs[rows])
            error = self.answers(layers[-1], self.vectors[rows]) - self.offsets[rows]
            squared_scale = self.squared_scale[rows]
            squared = (error.square() * squared_scale).sum(dim=-1, keepdim=True)
            # The gradient of what `loss` is below, written out: half the time of automatic
            # differentiation.
            slope = squared_scale * (squared.mul(4.0 * TAIL_WEIGHT).add_(2.0 * POINT_WEIGHT))
            slope.add_(2.0 / error.shape[-1]).mul_(error).mul_(1.0 / self.batch)
            delta = (slope[:, :, None, :, None]
                     * self.vectors[rows].view(-1, 3, 3, OUTPUTS)).view(layers[-1].shape)
            gradients: list[torch.Tensor] = [torch.empty(0)] * (2 * count)
            for layer in reversed(range(count)):
                gradients[layer] = torch.bmm(layers[layer].transpose(1, 2), delta)
                gradients[count + layer] = delta.sum(dim=1, keepdim=True)
                if layer:
                    delta = torch.bmm(delta, p[layer].transpose(1, 2)).mul_(layers[layer] > 0.0)
            self._adam(gradients)
        if steps:
            loss = (error.square().mean(dim=(1, 2)) + POINT_WEIGHT * squared.mean(dim=(1, 2))
                    + TAIL_WEIGHT * squared.square().mean(dim=(1, 2)))
        return loss.cpu().numpy()

    def _adam(self, gradients: list[torch.Tensor]) -> None:
        rate = self._rate * (0.5 * (1.0 + math.cos(math.pi * self.step / self.settings.steps)))
        self.step += 1
        scale = math.sqrt(1.0 - BETA2**self.step) / (1.0 - BETA1**self.step)
        for value, first, second, gradient in zip(self.parameters, self._first, self._second,
                                                  gradients):
            first.mul_(BETA1).add_(gradient, alpha=1.0 - BETA1)
            second.mul_(BETA2).addcmul_(gradient, gradient, value=1.0 - BETA2)
            value.sub_(rate * scale * first / (second.sqrt() + TINY))

    def networks(self) -> list[Layers]:
        """The layers of every network, for normalised inputs."""
        return unbatched(self.parameters, self.widths)

    def export(self, network: int) -> Layers:
        """The layers of one network, for inputs as `mlp` has them."""
        return folded(self.networks()[network], self.mean, self.deviation)

    def point_errors(self, data: MlpSamples) -> np.ndarray:
        """Return point errors (networks, n) in edges of the smaller box, before the clamp."""
        found = []
        for start in range(0, len(data), self.batch):
            rows = slice(start, start + self.batch)
            vectors, offsets, scale = (torch.tensor(part[rows], device=self.device)
                                       for part in (data.vectors, data.offsets, data.scale))
            outputs = self.layers(self._normalised(data.features[rows]))[-1]
            error = self.answers(outputs, vectors).sub_(offsets)
            found.append(error.mul_(scale).norm(dim=-1).cpu())
        return torch.cat(found, dim=1).numpy()
