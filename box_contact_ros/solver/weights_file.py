# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Weights files: the perceptrons of a model and its card, in the format safetensors.

Tensors are float32: `<network>.<layer>.weight` (outputs × inputs) and `<network>.<layer>.bias`.
Layers are counted from 0. Hidden units are rectified, in the paper's networks tanh, and the output
is linear. Inputs and outputs are in SI units: any scaling is folded into the weights.
The metadata entry `card` is the model card, a JSON object with `CARD_FIELDS`.

The library safetensors is imported where a file is read or written, and nowhere else.
"""
from __future__ import annotations

import hashlib
import json
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .checks import shown

CARD_FIELDS = ('name', 'model', 'architecture', 'inputs', 'outputs', 'sizes', 'data', 'seed',
               'commit', 'metrics', 'sha256')
"""Entries that every model card has: `architecture`, the units of each layer, of all networks or by
network, `inputs` with their ranges, `sizes` it was trained for, the `sha256` of the tensors."""

FILE_LIMIT = 2**24
"""Bytes of the largest file that is read, header and tensors: a thousand times what is shipped."""

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


@dataclass(frozen=True)
class Weights:
    """The networks of one file and its model card."""

    path: Path
    networks: dict[str, Network]
    card: dict[str, Any]

    def network(self, name: str, inputs: int, outputs: int, model: str) -> Network:
        """Return a network for a model; raises `WeightsError` if the file has no such shape."""
        found = self.networks.get(name)
        if found is None or (found.widths[0], found.widths[-1]) != (inputs, outputs):
            raise WeightsError(
                f'weights file {_name(self.path)} has no network {name!r} with {inputs} inputs '
                f'and {outputs} outputs, which model {model!r} needs')
        return found


def tensors_digest(tensors: dict[str, np.ndarray]) -> str:
    """Return the SHA-256 over names, shapes and bytes of tensors, in the order of their names."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        array = np.ascontiguousarray(tensors[name], dtype='<f4')
        digest.update(f'{name}{array.shape}'.encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def save_weights(path: Path, networks: dict[str, Layers], card: dict[str, Any]) -> None:
    """Write networks, each a list of (weight, bias) per layer, and their model card."""
    from safetensors.numpy import save

    tensors = {}
    for name, layers in networks.items():
        for number, (weight, bias) in enumerate(layers):
            tensors[f'{name}.{number}.weight'] = np.ascontiguousarray(weight, dtype=np.float32)
            tensors[f'{name}.{number}.bias'] = np.ascontiguousarray(bias, dtype=np.float32)
    card = {**card, 'sha256': tensors_digest(tensors)}
    _check_complete(card)
    path.parent.mkdir(parents=True, exist_ok=True)
    # Not safetensors' save_file, which leaves the file readable to its owner only.
    path.write_bytes(save(tensors, metadata={'card': json.dumps(card, ensure_ascii=False)}))


def _check_complete(card: dict[str, Any]) -> None:
    missing = [field for field in CARD_FIELDS if field not in card]
    if missing:
        raise ValueError(f'the model card lacks {", ".join(missing)}')


def load_weights(path: Path | str) -> Weights:
    """Read and check a weights file; raises `WeightsError` that says what is wrong with it."""
    try:
        from safetensors import SafetensorError
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f'{error}: weights files need it; pip install safetensors',
                                  name=error.name) from None
    path = Path(path)
    try:
        return Weights(path, *_checked(*_read(path)))
    except FileNotFoundError as error:
        raise WeightsError(f'weights file {_name(path)} does not exist') from error
    except (OSError, ValueError, SafetensorError) as error:
        reason = shown(str(error)) if isinstance(error, SafetensorError) else error
        raise WeightsError(f'weights file {_name(path)} cannot be read: {reason}') from error


def _name(path: Path) -> str:
    """Return a path as refusals show it: nothing in its name starts a line or a terminal code."""
    return shown(str(path))


def _read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return the tensors and the metadata of a file; raises ValueError for other tensors."""
    from safetensors import safe_open

    if path.exists() and not path.is_file():
        raise OSError('it is not a regular file')  # opening a FIFO would wait for its writer
    if path.stat().st_size > FILE_LIMIT:
        raise ValueError(f'it is larger than {FILE_LIMIT} bytes')
    tensors = {}
    with safe_open(path, framework='numpy') as file:
        for name in file.keys():
            part = file.get_slice(name)
            if part.get_dtype() != 'F32':
                raise ValueError(f'{shown(name)} is {part.get_dtype()}, not F32')
            tensors[name] = file.get_tensor(name)
        return tensors, file.metadata() or {}


def _checked(tensors: dict[str, np.ndarray], metadata: dict[str, str],
             ) -> tuple[dict[str, Network], dict[str, Any]]:
    """Return the networks and the card of a file; raises ValueError where they do not fit."""
    try:
        card = json.loads(metadata['card'])
    except (LookupError, ValueError, RecursionError):
        card = None
    if not isinstance(card, dict):
        raise ValueError('it has no readable model card')
    _check_complete(card)
    if not isinstance(card['inputs'], dict):
        raise ValueError('inputs of the model card is no object')
    for name, array in tensors.items():
        if not np.all(np.abs(array) <= WEIGHT_LIMIT):  # nor is NaN
            raise ValueError(f'{shown(name)} holds values that are not finite or beyond '
                             f'±{WEIGHT_LIMIT:g}')
    if tensors_digest(tensors) != card['sha256']:
        raise ValueError('checksum differs from its model card')
    parts: defaultdict[str, dict[str, np.ndarray]] = defaultdict(dict)
    for key in sorted(tensors):
        name, _, part = key.partition('.')
        parts[name][part] = tensors[key]
    networks = {name: _network(name, own) for name, own in parts.items()}
    for name, network in networks.items():
        wanted = card['architecture']
        wanted = wanted.get(name) if isinstance(wanted, dict) else wanted
        if list(network.widths) != wanted:
            raise ValueError(f'{shown(name)} is {shown(network.widths)}, the model card says '
                             f'{shown(wanted)}')
    if not networks:
        raise ValueError('it holds no network')
    return networks, card


def _network(name: str, parts: dict[str, np.ndarray]) -> Network:
    """Return the network of parts by `<layer>.weight` and `<layer>.bias`, or raise ValueError."""
    layers: Layers = []
    while f'{len(layers)}.weight' in parts:
        number = len(layers)
        weight, bias = parts.pop(f'{number}.weight'), parts.pop(f'{number}.bias', None)
        fits = weight.ndim == 2 and (not layers or weight.shape[1] == len(layers[-1][1]))
        if not fits or bias is None or bias.shape != weight.shape[:1]:
            raise ValueError(f'layer {number} of {shown(name)} does not fit its neighbours')
        layers.append((weight, bias))
    if parts:
        raise ValueError(f'{shown(name)} has tensors that belong to no layer')
    return Network(layers)
