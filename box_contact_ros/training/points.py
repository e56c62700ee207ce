"""Fit networks for model `committee`: many at once, of any hidden widths, by Adam.

All networks of a call are one batch of matrices with a leading dimension `networks`, as in `fit`;
hidden layers are as wide as the widest network needs, and the units that a network does not have
are masked to zero. What is learned is the offset of the centroid from the inside point, in half
extents of the bounding box (`committee`); what is minimised weighs it three ways: as it is, as the
error of the point in edges of the smaller box, and that to the fourth power, because the worst
cases are what a simulation trips over.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from ..network import TANH_LIMIT
from .contacts import Contacts

POINT_WEIGHT, TAIL_WEIGHT = 10.0, 3e3
"""Weights of the squared point error, and of its square, beside the squared offset error. Ten makes
the first two alike over the data; the third counts from errors of 5 % of the edge."""
BETA1, BETA2, TINY = 0.9, 0.999, 1e-8  # Adam's usual constants (Kingma and Ba 2015)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """One call of `fit_points`. Sequences have an entry per network."""

    hidden: Sequence[tuple[int, int]]
    """Units of the two hidden layers of each network."""
    steps: int
    batch: int = 4096
    rate: float | Sequence[float] = 4e-3
    """Learning rate at the start; it falls to zero along half a cosine."""
    seed: int = 0
    device: str = 'cpu'


@dataclass(frozen=True)
class State:
    """Networks in training: parameters with the moments of their gradients, and the step."""

    parameters: list[torch.Tensor]
    """Three weights (networks, inputs, outputs), then three biases (networks, 1, outputs)."""
    first: list[torch.Tensor]
    second: list[torch.Tensor]
    mean: torch.Tensor
    deviation: torch.Tensor

    def export(self, network: int, hidden: tuple[int, int]) -> list[tuple[np.ndarray, np.ndarray]]:
        """(weight (outputs, inputs), bias (outputs,)) per layer, for inputs as `committee` has."""
        sizes = (len(self.mean), *hidden, self.parameters[5].shape[-1])
        layers = []
        for number in range(3):
            weight = self.parameters[number][network].T.cpu().double().numpy()
            bias = self.parameters[3 + number][network, 0].cpu().double().numpy()
            if number == 0:
                weight = weight / self.deviation.cpu().numpy()
                bias = bias - weight @ self.mean.cpu().numpy()
            rows, columns = sizes[number + 1], sizes[number]
            layers.append((weight[:rows, :columns].astype(np.float32),
                           bias[:rows].astype(np.float32)))
        return layers


def rational_tanh(x: torch.Tensor) -> torch.Tensor:
    """The networks' activation, as in `network.rational_tanh`."""
    x = x.clamp(-TANH_LIMIT, TANH_LIMIT)
    s = x * x
    return x * (945.0 + s * (105.0 + s)) / (945.0 + s * (420.0 + s * 15.0))


class Fit:
    """A training that can be asked for its errors, stopped, and taken up again."""

    def __init__(self, data: Contacts, settings: Settings) -> None:
        s = self.settings = settings
        self.device = torch.device(s.device)
        self.inputs, self.offsets, self.scale = (
            torch.tensor(part, device=self.device)
            for part in (data.inputs, data.offsets, data.scale))
        mean = self.inputs.mean(dim=0)
        deviation = self.inputs.std(dim=0) + 1e-6  # an input that never varies stays as it is
        self.inputs = (self.inputs - mean) / deviation
        generator = torch.Generator().manual_seed(s.seed)
        self.generator = generator
        count = len(s.hidden)
        widest = [max(units[layer] for units in s.hidden) for layer in (0, 1)]
        sizes = (self.inputs.shape[1], *widest, self.offsets.shape[1])
        weights = [(2.0 * torch.rand((count, n_in, n_out), generator=generator) - 1.0)
                   * math.sqrt(3.0 / n_in) for n_in, n_out in zip(sizes, sizes[1:])]
        biases = [torch.zeros((count, 1, n_out)) for n_out in sizes[1:]]
        parameters = [p.to(self.device) for p in weights + biases]
        self.state = State(parameters, [torch.zeros_like(p) for p in parameters],
                           [torch.zeros_like(p) for p in parameters], mean, deviation)
        self.masks = [torch.tensor([[float(k < units[layer]) for k in range(widest[layer])]
                                    for units in s.hidden], device=self.device)[:, None, :]
                      for layer in (0, 1)]
        self.masked = any(bool((mask == 0).any()) for mask in self.masks)
        rate = np.broadcast_to(np.asarray(s.rate, dtype=np.float32), (count,)).copy()
        self.rate = torch.tensor(rate, device=self.device).reshape(-1, 1, 1)
        self.step = 0

    def layers(self, inputs: torch.Tensor) -> list[torch.Tensor]:
        """Activations of every layer, inputs first, each (networks, patterns, units)."""
        p = self.state.parameters
        found = [inputs.expand(p[0].shape[0], -1, -1)]
        for layer in range(3):
            total = torch.baddbmm(p[3 + layer], found[-1], p[layer])
            if layer < 2:
                total = rational_tanh(total)
                if self.masked:
                    total = total * self.masks[layer]
            found.append(total)
        return found

    def run(self, steps: int) -> torch.Tensor:
        """Take so many steps (at most to the end); returns the last loss of each network."""
        s, p = self.settings, self.state.parameters
        loss = torch.full((len(s.hidden),), math.nan)
        for _ in range(min(steps, s.steps - self.step)):
            rows = torch.randint(0, len(self.inputs), (s.batch,), generator=self.generator,
                                 ).to(self.device)
            layers = self.layers(self.inputs[rows])
            error = layers[-1] - self.offsets[rows]
            squared_scale = self.scale[rows].square()
            squared = (error.square() * squared_scale).sum(dim=-1, keepdim=True)
            outputs = error.shape[-1]
            delta = error * ((2.0 / outputs)
                             + squared_scale * (2.0 * POINT_WEIGHT + 4.0 * TAIL_WEIGHT * squared))
            delta = delta / s.batch
            gradients: list[torch.Tensor] = [torch.empty(0)] * 6
            for layer in (2, 1, 0):
                gradients[layer] = torch.bmm(layers[layer].transpose(1, 2), delta)
                gradients[3 + layer] = delta.sum(dim=1, keepdim=True)
                if layer:
                    # The slope of tanh, which is that of the rational one to 1e-3.
                    below = layers[layer]
                    delta = torch.bmm(delta, p[layer].transpose(1, 2)) * (1.0 - below * below)
                    if self.masked:
                        delta = delta * self.masks[layer - 1]
            rate = self.rate * (0.5 * (1.0 + math.cos(math.pi * self.step / s.steps)))
            self.step += 1
            scale = math.sqrt(1.0 - BETA2**self.step) / (1.0 - BETA1**self.step)
            for value, first, second, gradient in zip(p, self.state.first, self.state.second,
                                                      gradients):
                first.mul_(BETA1).add_(gradient, alpha=1.0 - BETA1)
                second.mul_(BETA2).addcmul_(gradient, gradient, value=1.0 - BETA2)
                value.sub_(rate * scale * first / (second.sqrt() + TINY))
            loss = error.square().mean(dim=(1, 2)) + POINT_WEIGHT * squared.mean(
                dim=(1, 2)) + TAIL_WEIGHT * squared.square().mean(dim=(1, 2))
        return loss.cpu()

    def point_errors(self, data: Contacts) -> np.ndarray:
        """(networks, n) point errors in edges of the smaller box, clamped as the solver does."""
        inputs = (torch.tensor(data.inputs, device=self.device) - self.state.mean
                  ) / self.state.deviation
        inside = torch.tensor(data.inside, device=self.device)
        truth = torch.tensor(data.offsets, device=self.device) + inside
        scale = torch.tensor(data.scale, device=self.device)
        found = []
        for rows in torch.arange(len(inputs)).split(65_536):
            point = (self.layers(inputs[rows])[-1] + inside[rows]).clamp(-0.5, 0.5)
            found.append(((point - truth[rows]) * scale[rows]).norm(dim=-1).cpu())
        return torch.cat(found, dim=1).numpy()
