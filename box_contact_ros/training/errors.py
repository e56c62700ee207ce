"""How far a network's angles are off: the paper's figures ME, MAE and RMSE.

Networks are run as they are used, by the Numba kernel on float32 weights, without PyTorch.
"""
from __future__ import annotations

import numpy as np

from ..jit import kernel
from ..network import Network, forward

PARTS = {'all': slice(0, 4), 'point': slice(0, 2), 'normal': slice(2, 4)}
"""Outputs that are reported together."""


@kernel
def _predict(packed, widths, activation, inputs, outputs):
    for row in range(inputs.shape[0]):
        for k in range(inputs.shape[1]):
            activation[0, k] = inputs[row, k]
        last = forward(packed, widths, activation)
        for k in range(outputs.shape[1]):
            outputs[row, k] = activation[last, k]


def predict(network: Network, inputs: np.ndarray) -> np.ndarray:
    """Outputs (n, outputs) float64 of a network for inputs (n, inputs)."""
    outputs = np.empty((len(inputs), network.widths[-1]))
    activation = np.empty((2, max(network.widths)), dtype=np.float32)
    _predict(network.packed, np.array(network.widths), activation,
             np.ascontiguousarray(inputs, dtype=np.float64), outputs)
    return outputs


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles [rad] in [−π, π), so that −π and π are the same direction."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def figures(errors: np.ndarray) -> dict[str, float]:
    """Mean, mean absolute and root mean square error over all rows and outputs [rad]."""
    return {'ME': float(np.mean(errors)), 'MAE': float(np.mean(np.abs(errors))),
            'RMSE': float(np.sqrt(np.mean(errors**2)))}


def errors_of(network: Network, inputs: np.ndarray, outputs: np.ndarray) -> np.ndarray:
    """Wrapped errors (n, outputs) [rad]: what the network says minus what is right."""
    return wrapped(predict(network, inputs) - outputs)


def figures_by_part(errors: np.ndarray) -> dict[str, dict[str, float]]:
    """`figures` over all four outputs, over those of the point and over those of the normal."""
    return {part: figures(errors[:, columns]) for part, columns in PARTS.items()}
