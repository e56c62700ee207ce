# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far a network's angles are off: the paper's figures ME, MAE and RMSE.

Networks run as the models run them: on float32 weights, without PyTorch.
"""
from __future__ import annotations

from typing import Any

import numpy as np

from box_contact_ros.models.weights_file import Network

from .numpy_model import forward


def predict(network: Network, inputs: np.ndarray) -> np.ndarray:
    """Return the outputs (n, outputs) float64 of a network for inputs (n, inputs)."""
    return forward(network, inputs).astype(np.float64)


def wrapped(angle: Any) -> Any:
    """Return angles [rad], an array or a tensor, in [−π, π): −π and π are the same direction."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def figures(errors: np.ndarray) -> dict[str, float]:
    """Return mean, mean absolute and root mean square error over all rows and outputs [rad]."""
    return {'ME': float(np.mean(errors)), 'MAE': float(np.mean(np.abs(errors))),
            'RMSE': float(np.sqrt(np.mean(errors**2)))}


def difference(answer: Any, truth: Any, wrap: bool) -> Any:
    """Return answer minus truth [rad], arrays or tensors, wrapped or as it is."""
    return wrapped(answer - truth) if wrap else answer - truth


def errors_of(network: Network, inputs: np.ndarray, outputs: np.ndarray, wrap: bool = True,
              ) -> np.ndarray:
    """Return the errors (n, outputs) [rad]: prediction minus truth."""
    return difference(predict(network, inputs), outputs, wrap)
