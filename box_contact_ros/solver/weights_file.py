"""Multilayer perceptrons: the file format of their weights.

A weights file is `safetensors`: tensors `<network>.<layer>.weight` (outputs × inputs) and
`<network>.<layer>.bias`, float32, layers counted from 0; hidden units are rectified, in the
paper's networks tanh; the output is linear. Inputs and outputs are in SI units: any scaling is
folded into the weights. The metadata entry `card` is the model card, a JSON object: name, model,
architecture, inputs and outputs with their ranges, sizes it was trained for, data recipe and seed,
commit, metrics, and the `sha256` of the tensors.
"""
from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

CARD_FIELDS = ('name', 'model', 'architecture', 'inputs', 'outputs', 'sizes', 'data', 'seed',
               'commit', 'metrics', 'sha256')
"""Entries that every model card has."""

WEIGHT_LIMIT = 1e4
"""Largest weight a loader believes: trained weights stay below 1e2, a flipped exponent bit does
not."""


@dataclass(frozen=True)
class Network:
    """One perceptron, its numbers in one array."""

    name: str
    widths: tuple[int, ...]
    """Units per layer, inputs first: (6, 20, 18, 4)."""
    packed: np.ndarray
    """float32: for each layer its weights (outputs × inputs, row-major), then its biases."""


@dataclass(frozen=True)
class Weights:
    """The networks of one file and its model card."""

    path: Path
    networks: dict[str, Network]
    card: dict[str, Any]


class WeightsError(ValueError):
    """A weights file that is missing, damaged, or not what its card says."""


def tensors_digest(tensors: dict[str, np.ndarray]) -> str:
    """SHA-256 over names, shapes and bytes of the tensors, in the order of their names."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        array = np.ascontiguousarray(tensors[name], dtype='<f4')
        digest.update(f'{name}{array.shape}'.encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def save_weights(path: Path, networks: dict[str, list[tuple[np.ndarray, np.ndarray]]],
                 card: dict[str, Any]) -> None:
    """Write networks, each a list of (weight, bias) per layer, and their model card."""
    tensors = {}
    for name, layers in networks.items():
        for number, (weight, bias) in enumerate(layers):
            tensors[f'{name}.{number}.weight'] = np.ascontiguousarray(weight, dtype=np.float32)
            tensors[f'{name}.{number}.bias'] = np.ascontiguousarray(bias, dtype=np.float32)
    card = {**card, 'sha256': tensors_digest(tensors)}
    missing = [field for field in CARD_FIELDS if field not in card]
    if missing:
        raise ValueError(f'the model card lacks {", ".join(missing)}')
    path.parent.mkdir(parents=True, exist_ok=True)
    # Not safetensors' save_file, which leaves the file readable to its owner only.
    path.write_bytes(save(tensors, metadata={'card': json.dumps(card, ensure_ascii=False)}))


def load_weights(path: Path | str) -> Weights:
    """Read and check a weights file; raises `WeightsError` that says what is wrong with it."""
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            raise OSError('it is no regular file')  # opening a FIFO would wait for its writer
        with safe_open(path, framework='numpy') as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except FileNotFoundError as error:
        raise WeightsError(f'weights file {path} does not exist') from error
    except (SafetensorError, OSError, ValueError, TypeError, AttributeError) as error:
        # The last two are what number types that NumPy lacks (bfloat16, float8) end in.
        raise WeightsError(f'weights file {path} cannot be read: {error}') from error
    try:
        card = json.loads(metadata['card'])
        if not isinstance(card, dict):
            raise TypeError('the card is no JSON object')
        missing = [field for field in CARD_FIELDS if field not in card]
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise WeightsError(f'weights file {path} has no readable model card') from error
    if missing:
        raise WeightsError(f'weights file {path}: the model card lacks {", ".join(missing)}')
    if not isinstance(card['inputs'], dict):
        raise WeightsError(f'weights file {path}: inputs of the model card is no object')
    for name, array in tensors.items():
        if array.dtype != np.float32:
            raise WeightsError(f'weights file {path}: {name} is {array.dtype}, not float32')
        if not np.all(np.isfinite(array)) or np.any(np.abs(array) > WEIGHT_LIMIT):
            raise WeightsError(
                f'weights file {path}: {name} holds values that are not finite or beyond '
                f'±{WEIGHT_LIMIT:g}')
    if tensors_digest(tensors) != card['sha256']:
        raise WeightsError(f'weights file {path}: checksum differs from its model card')
    networks = {}
    for name in sorted({key.split('.')[0] for key in tensors}):
        networks[name] = _pack(name, tensors, path)
        if list(networks[name].widths) != card['architecture']:
            raise WeightsError(
                f'weights file {path}: {name} is {networks[name].widths}, the model card says '
                f'{card["architecture"]}')
    if not networks:
        raise WeightsError(f'weights file {path} holds no network')
    return Weights(path, networks, card)


def _pack(name: str, tensors: dict[str, np.ndarray], path: Path) -> Network:
    widths: list[int] = []
    parts: list[np.ndarray] = []
    while f'{name}.{len(parts) // 2}.weight' in tensors:
        layer = f'{name}.{len(parts) // 2}'
        weight, bias = tensors[f'{layer}.weight'], tensors.get(f'{layer}.bias')
        fits = weight.ndim == 2 and (not widths or weight.shape[1] == widths[-1])
        if not fits or bias is None or bias.shape != weight.shape[:1]:
            raise WeightsError(f'weights file {path}: {layer} does not fit its neighbours')
        widths = (widths or [weight.shape[1]]) + [weight.shape[0]]
        parts += [weight.ravel(), bias]
    used = sum(len(part) for part in parts)
    mine = [array for key, array in tensors.items() if key.split('.')[0] == name]
    if not parts or used != sum(array.size for array in mine):
        raise WeightsError(f'weights file {path}: {name} has tensors that belong to no layer')
    return Network(name, tuple(widths), np.concatenate(parts))


def unpacked(network: Network) -> list[tuple[np.ndarray, np.ndarray]]:
    """(weight (outputs, inputs), bias (outputs,)) of every layer."""
    layers, place = [], 0
    for inputs, outputs in zip(network.widths, network.widths[1:]):
        end = place + inputs * outputs
        layers.append((network.packed[place:end].reshape(outputs, inputs),
                       network.packed[end:end + outputs]))
        place = end + outputs
    return layers
