# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Weights files: the perceptrons of a model and its card, in the format safetensors.

A file begins with 8 bytes, the little-endian length of a JSON header. The header gives dtype, shape
and place of each tensor, and the tensors follow without gaps. Reading it needs no library; the
extra `train` brings the one that writes.

Tensors are float32: `<network>.<layer>.weight` (outputs × inputs) and `<network>.<layer>.bias`.
Layers are counted from 0. Hidden units are rectified, in the paper's networks tanh, and the output
is linear. Inputs and outputs are in SI units: any scaling is folded into the weights.
The metadata entry `card` is the model card, a JSON object with `CARD_FIELDS`.
"""
from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..resources import resource_path

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

    @property
    def packed(self) -> np.ndarray:
        """Return for each layer its weights, row-major, then its biases, in one array."""
        return np.concatenate([part.ravel() for layer in self.layers for part in layer])


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
                f'weights file {self.path} has no network {name!r} with {inputs} inputs and '
                f'{outputs} outputs, which model {model!r} needs')
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
    from safetensors.numpy import save  # only here: it is an extra

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


def read_tensors(data: bytes) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return the tensors and the metadata of a safetensors file.

    Raises ValueError, TypeError or LookupError for a damaged file and for other types than float32.
    """
    start = 8 + int.from_bytes(data[:8], 'little')
    header = json.loads(data[8:start].decode('utf-8'))
    metadata = header.pop('__metadata__', {})
    tensors, place = {}, start
    for name, entry in sorted(header.items(), key=lambda item: item[1]['data_offsets']):
        shape, (begin, end) = entry['shape'], entry['data_offsets']
        if entry['dtype'] != 'F32':
            raise ValueError(f'{name} is {entry["dtype"]}, not F32')
        if len(shape) > 2:
            raise ValueError(f'{name} has {len(shape)} dimensions, not 1 or 2')
        if start + begin != place or end - begin != 4 * math.prod(shape):
            raise ValueError(f'{name} has no place of its own')
        # NumPy refuses shapes and places that are not whole numbers within the data.
        tensors[name] = np.ndarray(shape, '<f4', data, place).astype(np.float32)
        place = start + end
    if place != len(data):
        raise ValueError('it does not end with the last tensor')
    return tensors, metadata


def weights_for(model: str, path: str | None, shipped: str, boxes: str = '') -> Weights:
    """Read the weights of a model from `path`, or for None the shipped ones of that name.

    boxes: what the error calls the boxes that have none. Raises `WeightsError`.
    """
    try:
        return load_weights(path or resource_path('weights', f'{shipped}.safetensors'))
    except FileNotFoundError as error:
        raise WeightsError(
            f'model {model!r} has no weights{boxes}: train them, name a file with `weights`, or '
            f"use model 'exact', which needs none") from error


def load_weights(path: Path | str) -> Weights:
    """Read and check a weights file; raises `WeightsError` that says what is wrong with it."""
    path = Path(path)
    try:
        return Weights(path, *_checked(*read_tensors(_read(path))))
    except FileNotFoundError as error:
        raise WeightsError(f'weights file {path} does not exist') from error
    except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
        raise WeightsError(f'weights file {path} cannot be read: {error}') from error


def _read(path: Path) -> bytes:
    if path.exists() and not path.is_file():
        raise OSError('it is no regular file')  # opening a FIFO would wait for its writer
    with path.open('rb') as file:
        data = file.read(FILE_LIMIT + 1)
    if len(data) > FILE_LIMIT:
        raise ValueError(f'it is larger than {FILE_LIMIT} bytes')
    return data


def _checked(tensors: dict[str, np.ndarray], metadata: dict[str, Any],
             ) -> tuple[dict[str, Network], dict[str, Any]]:
    """Return the networks and the card of a file; raises ValueError where they do not fit."""
    try:
        card = json.loads(metadata['card'])
    except (LookupError, TypeError, ValueError, RecursionError):
        card = None
    if not isinstance(card, dict):
        raise ValueError('it has no readable model card')
    _check_complete(card)
    if not isinstance(card['inputs'], dict):
        raise ValueError('inputs of the model card is no object')
    for name, array in tensors.items():
        if not np.all(np.abs(array) <= WEIGHT_LIMIT):  # nor is NaN
            raise ValueError(
                f'{name} holds values that are not finite or beyond ±{WEIGHT_LIMIT:g}')
    if tensors_digest(tensors) != card['sha256']:
        raise ValueError('checksum differs from its model card')
    networks = {name: _network(name, tensors)
                for name in sorted({key.split('.')[0] for key in tensors})}
    for name, network in networks.items():
        wanted = card['architecture']
        wanted = wanted.get(name) if isinstance(wanted, dict) else wanted
        if list(network.widths) != wanted:
            raise ValueError(f'{name} is {network.widths}, the model card says {wanted}')
    if not networks:
        raise ValueError('it holds no network')
    return networks, card


def _network(name: str, tensors: dict[str, np.ndarray]) -> Network:
    own = {key: array for key, array in tensors.items() if key.split('.')[0] == name}
    layers: Layers = []
    while f'{name}.{len(layers)}.weight' in own:
        layer = f'{name}.{len(layers)}'
        weight, bias = own.pop(f'{layer}.weight'), own.pop(f'{layer}.bias', None)
        fits = weight.ndim == 2 and (not layers or weight.shape[1] == len(layers[-1][1]))
        if not fits or bias is None or bias.shape != weight.shape[:1]:
            raise ValueError(f'{layer} does not fit its neighbours')
        layers.append((weight, bias))
    if own:
        raise ValueError(f'{name} has tensors that belong to no layer')
    return Network(layers)
