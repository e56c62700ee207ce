# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Weights files: the perceptrons of a model and its card, in the format safetensors.

Tensors are float32: `<network>.<layer>.weight` (outputs × inputs) and `<network>.<layer>.bias`.
Layers are counted from 0. Hidden units are rectified, in the paper's networks tanh, and the output
is linear. The last layer of `mlp` reads the inputs before the hidden units, too. Inputs and outputs
are in SI units: any scaling is folded into the weights.
The metadata entry `card` is the model card, a JSON object. Its entry `architecture` holds the units
of each layer, of all networks or by network.

The library safetensors is imported where a file is read, and nowhere else.
"""
from __future__ import annotations

import json
import os
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..resources import open_regular
from ..solver.checks import short_repr

WEIGHT_LIMIT = 1e4
"""Largest weight a loader believes: trained weights stay below 1e2, a flipped exponent bit does
not."""

Layers = list[tuple[np.ndarray, np.ndarray]]
"""Weight (outputs, inputs) and bias (outputs,) of each layer, float32."""


class WeightsError(ValueError):
    """A weights file that is missing, damaged, or not what its card says."""


@dataclass(frozen=True)
class Network:
    """One perceptron."""

    layers: Layers

    @property
    def widths(self) -> tuple[int, ...]:
        """Return the units per layer, inputs first: (6, 20, 18, 4)."""
        return (self.layers[0][0].shape[1], *(len(bias) for _, bias in self.layers))

    @property
    def has_path(self) -> bool:
        """Return whether the last layer reads the inputs before the units: a linear path."""
        return len(self.layers) > 1 and self.layers[-1][0].shape[1] > self.widths[-2]


@dataclass(frozen=True)
class Weights:
    """The networks of one file and its model card."""

    path: Path
    networks: dict[str, Network]
    card: dict[str, Any]

    def network(self, name: str, inputs: int, outputs: int, model: str) -> Network:
        """Return a network for a model.

        Raises `WeightsError` if the file has no such shape.
        """
        network = self.networks.get(name)
        if network is None or network.widths[0] != inputs or network.widths[-1] != outputs:
            raise WeightsError(
                f'weights file {short_repr(str(self.path))} has no network {name!r} with {inputs} '
                f'inputs and {outputs} outputs, which model {model!r} needs')
        return network


def load_weights(path: str | os.PathLike[str]) -> Weights:
    """Read and check a weights file; raises `WeightsError` that says what is wrong with it."""
    from safetensors import SafetensorError

    path = Path(path)
    file = f'weights file {short_repr(str(path))}'
    try:
        tensors, card = _read(path)
        return Weights(path, _networks(tensors, card.get('architecture')), card)
    except FileNotFoundError as error:
        raise WeightsError(f'{file} does not exist') from error
    except (OSError, ValueError, SafetensorError) as error:
        reason = short_repr(str(error)) if isinstance(error, SafetensorError) else error
        raise WeightsError(f'{file} cannot be read: {reason}') from error


def _read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return tensors of credible values and the model card, or raise ValueError."""
    from safetensors import safe_open

    open_regular(path).close()
    tensors = {}
    with safe_open(path, framework='numpy') as file:
        for name in file.keys():
            dtype = file.get_slice(name).get_dtype()
            if dtype != 'F32':
                raise ValueError(f'{short_repr(name)} is {dtype}, not F32')
            tensors[name] = file.get_tensor(name)
            if not np.all(np.abs(tensors[name]) <= WEIGHT_LIMIT):  # nor is NaN
                raise ValueError(f'{short_repr(name)} holds values that are not finite or beyond '
                                 f'±{WEIGHT_LIMIT:g}')
        text = (file.metadata() or {}).get('card', '')
    try:
        card = json.loads(text)
    except (ValueError, RecursionError):  # no JSON, or nested deeply
        card = None
    if not isinstance(card, dict):
        raise ValueError('it has no readable model card')
    return tensors, card


def _networks(tensors: dict[str, np.ndarray], architecture: Any) -> dict[str, Network]:
    """Return the networks of tensors; raises ValueError where they do not fit the architecture."""
    parts: defaultdict[str, dict[str, np.ndarray]] = defaultdict(dict)
    for key in sorted(tensors):
        name, _, part = key.partition('.')
        parts[name][part] = tensors[key]
    networks = {name: _network(name, own) for name, own in parts.items()}
    for name, network in networks.items():
        wanted = architecture.get(name) if isinstance(architecture, dict) else architecture
        if list(network.widths) != wanted:
            raise ValueError(f'{short_repr(name)} is {short_repr(network.widths)}, the model card '
                             f'says {short_repr(wanted)}')
    if not networks:
        raise ValueError('it holds no network')
    return networks


def _network(name: str, parts: dict[str, np.ndarray]) -> Network:
    """Return the network of parts by `<layer>.weight` and `<layer>.bias`, or raise ValueError."""
    layers: Layers = []
    while f'{len(layers)}.weight' in parts:
        number = len(layers)
        weight, bias = parts.pop(f'{number}.weight'), parts.pop(f'{number}.bias', None)
        fits = weight.ndim == 2
        if layers and fits:
            units, inputs = len(layers[-1][1]), layers[0][0].shape[1]
            is_last = f'{number + 1}.weight' not in parts
            fits = weight.shape[1] in ((units, inputs + units) if is_last else (units,))
        if not fits or bias is None or bias.shape != weight.shape[:1]:
            raise ValueError(f'layer {number} of {short_repr(name)} does not fit its neighbours')
        layers.append((weight, bias))
    if parts:
        raise ValueError(f'{short_repr(name)} has tensors that belong to no layer')
    return Network(layers)
