"""Backpropagation with momentum, for many multilayer perceptrons at once.

All networks of a call have the same layers and see the same mini-batches; they are one batch of
matrices with a leading dimension `networks`, so that ten starts cost little more than one, and a
search over thousands is the same computation on a larger first dimension (or on a GPU). Learning
rate, momentum and range of the initial weights may differ from network to network.

1. Inputs are normalised to mean 0 and deviation 1; `export` folds that into the first layer.
2. Weights start uniform in ± range / √(inputs of the layer), biases at 0.
3. Every epoch goes through the training set once in random order. The learning rate falls from its
   value to zero along half a cosine over the epochs.
4. The loss is the squared error of the angles, differences wrapped into [−π, π): −π and π are the
   same direction. The gradient is written out; it is the paper's algorithm and a third of the time
   that automatic differentiation takes.
5. Cross-validation: each network keeps the weights of the epoch in which its error on the
   cross-validation set was least.

The same seed gives the same weights on the same machine with the same number of threads.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from .dataset import Patterns

CHECKS = 200
"""Least number of times that the cross-validation error is looked at in a training."""


@dataclass(frozen=True)
class Settings:
    """What a training is like. Sequences have an entry per network; numbers hold for all."""

    widths: tuple[int, ...]
    """Units per layer, inputs first: (6, 20, 18, 4)."""
    networks: int = 12
    epochs: int = 800
    batch: int = 50
    rate: float | Sequence[float] = 0.02
    """Learning rate at the start, for the mean loss of a mini-batch."""
    momentum: float | Sequence[float] = 0.9
    initial: float | Sequence[float] = 1.0
    """Range of the initial weights, times √(inputs of the layer)."""
    seed: int = 0
    device: str = 'cpu'


@dataclass(frozen=True)
class Fitted:
    """Networks after training, with their best weights by cross-validation."""

    weights: list[torch.Tensor]
    """Per layer (networks, inputs, outputs)."""
    biases: list[torch.Tensor]
    """Per layer (networks, 1, outputs)."""
    mean: np.ndarray
    """(inputs,) of the training set."""
    deviation: np.ndarray
    """(inputs,) of the training set."""
    error: np.ndarray
    """(networks,) root mean square cross-validation error [rad]."""
    epoch: np.ndarray
    """(networks,) epoch of the best weights."""
    history: np.ndarray
    """(checks, networks) cross-validation error [rad] in the course of the training."""

    def export(self, network: int | None = None) -> list[tuple[np.ndarray, np.ndarray]]:
        """(weight (outputs, inputs), bias (outputs,)) per layer, for inputs in SI units.

        Of the best network by cross-validation, unless another is asked for.
        """
        k = int(np.argmin(self.error)) if network is None else network
        layers = [(w[k].T.cpu().double().numpy(), b[k, 0].cpu().double().numpy())
                  for w, b in zip(self.weights, self.biases)]
        weight, bias = layers[0]
        weight = weight / self.deviation
        layers[0] = (weight, bias - weight @ self.mean)
        return [(w.astype(np.float32), b.astype(np.float32)) for w, b in layers]


def outputs_of(weights: list[torch.Tensor], biases: list[torch.Tensor], inputs: torch.Tensor,
               ) -> list[torch.Tensor]:
    """Activations of every layer, inputs first, each (networks, patterns, units)."""
    layers = [inputs.expand(weights[0].shape[0], -1, -1)]
    for number, (weight, bias) in enumerate(zip(weights, biases)):
        total = torch.baddbmm(bias, layers[-1], weight)
        layers.append(total if number == len(weights) - 1 else total.tanh_())
    return layers


def wrapped(angle: torch.Tensor) -> torch.Tensor:
    """Angles [rad] in [−π, π)."""
    return torch.remainder(angle + math.pi, 2.0 * math.pi) - math.pi


def gradients(weights: list[torch.Tensor], layers: list[torch.Tensor], error: torch.Tensor,
              ) -> tuple[list[torch.Tensor], list[torch.Tensor]]:
    """Gradients, by backpropagation, of ½ mean over patterns of Σ error², per network."""
    by_weight, by_bias = [], []
    delta = error / error.shape[1]
    for number in reversed(range(len(weights))):
        by_weight.append(torch.bmm(layers[number].transpose(1, 2), delta))
        by_bias.append(delta.sum(dim=1, keepdim=True))
        if number:
            below = layers[number]
            delta = torch.bmm(delta, weights[number].transpose(1, 2)) * (1.0 - below * below)
    return by_weight[::-1], by_bias[::-1]


def fit(training: Patterns, checking: Patterns, settings: Settings, *, progress: str = '',
        start: Sequence[torch.Tensor] | None = None) -> Fitted:
    """Train; `progress` is the title of a progress bar, none if empty.

    start: weights (networks, inputs, outputs) of all layers, then biases (networks, 1, outputs),
    for normalised inputs, in place of random ones. Hidden units whose weights are all zero stay
    so: narrower networks can be padded with them.
    """
    s = settings
    generator = torch.Generator().manual_seed(s.seed)
    device = torch.device(s.device)
    mean, deviation = training.inputs.mean(axis=0), training.inputs.std(axis=0)

    def tensors(patterns: Patterns) -> tuple[torch.Tensor, torch.Tensor]:
        return (torch.tensor((patterns.inputs - mean) / deviation, dtype=torch.float32,
                             device=device),
                torch.tensor(patterns.outputs, dtype=torch.float32, device=device))

    def per_network(value: float | Sequence[float]) -> torch.Tensor:
        array = np.broadcast_to(np.asarray(value, dtype=np.float32), (s.networks,))
        return torch.tensor(array.reshape(-1, 1, 1).copy(), device=device)

    x, y = tensors(training)
    check_x, check_y = tensors(checking)
    rate, momentum, initial = map(per_network, (s.rate, s.momentum, s.initial))
    # Drawn on the CPU, whatever the device: the same start everywhere.
    if start is None:
        weights = [initial / math.sqrt(n_in) * (2.0 * torch.rand(
            (s.networks, n_in, n_out), generator=generator).to(device) - 1.0)
            for n_in, n_out in zip(s.widths, s.widths[1:])]
        biases = [torch.zeros((s.networks, 1, n_out), device=device) for n_out in s.widths[1:]]
    else:
        copies = [p.to(device, copy=True) for p in start]
        weights, biases = copies[:len(copies) // 2], copies[len(copies) // 2:]
    parameters = weights + biases
    steps = [torch.zeros_like(p) for p in parameters]
    best = [p.clone() for p in parameters]
    best_error = torch.full((s.networks,), math.inf, device=device)
    best_epoch = torch.zeros(s.networks, dtype=torch.int64, device=device)
    history = []
    every = max(1, s.epochs // CHECKS)

    epochs = range(1, s.epochs + 1)
    if progress:
        from tqdm import tqdm
        epochs = tqdm(epochs, desc=progress, unit='epoch', mininterval=1.0)
    for epoch in epochs:
        now = rate * (0.5 * (1.0 + math.cos(math.pi * (epoch - 1) / s.epochs)))
        order = torch.randperm(len(x), generator=generator).to(device)
        shuffled_x, shuffled_y = x[order], y[order]
        for start in range(0, len(x), s.batch):
            layers = outputs_of(weights, biases, shuffled_x[start:start + s.batch])
            error = wrapped(layers[-1] - shuffled_y[start:start + s.batch])
            by_weight, by_bias = gradients(weights, layers, error)
            for p, step, gradient in zip(parameters, steps, by_weight + by_bias):
                step.mul_(momentum).sub_(now * gradient)
                p.add_(step)
        if epoch % every == 0 or epoch == s.epochs:
            error = wrapped(outputs_of(weights, biases, check_x)[-1] - check_y)
            rmse = error.square().mean(dim=(1, 2)).sqrt()
            history.append(rmse.cpu().numpy())
            better = rmse < best_error  # False for NaN: a network that diverged keeps its best
            best_error = torch.where(better, rmse, best_error)
            best_epoch[better] = epoch
            for kept, p in zip(best, parameters):
                kept[better] = p[better]
            if progress:
                epochs.set_postfix(rmse=f'{float(best_error.min()):.4f}', refresh=False)
    layers_count = len(weights)
    return Fitted(best[:layers_count], best[layers_count:], mean, deviation,
                  best_error.cpu().numpy(), best_epoch.cpu().numpy(), np.array(history))
