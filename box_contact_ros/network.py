"""Multilayer perceptrons: the file format of their weights, and the forward kernel.

A weights file is `safetensors`: tensors `<network>.<layer>.weight` (outputs × inputs) and
`<network>.<layer>.bias`, float32, layers counted from 0; hidden units are tanh, the output is
linear. Inputs and outputs are in SI units: any scaling is folded into the weights. The metadata
entry `card` is the model card, a JSON object: name, model, architecture, inputs and outputs with
their ranges, sizes it was trained for, data recipe and seed, commit, metrics, and the `sha256` of
the tensors.
"""
from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from .block import (
    LANES,
)
from .jit import fused_inlined, fused_kernel, inlined, kernel

CARD_FIELDS = ('name', 'model', 'architecture', 'inputs', 'outputs', 'sizes', 'data', 'seed',
               'commit', 'metrics', 'sha256')
"""Entries that every model card has."""

WEIGHT_LIMIT = 1e4
"""Largest weight a loader believes: trained weights stay below 1e2, a flipped exponent bit does
not."""


@dataclass(frozen=True)
class Network:
    """One perceptron, packed for the kernel."""

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
    except (KeyError, TypeError, ValueError) as error:
        raise WeightsError(f'weights file {path} has no readable model card') from error
    if missing:
        raise WeightsError(f'weights file {path}: the model card lacks {", ".join(missing)}')
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


TANH_LIMIT = 3.6467
"""Where the rational tanh below reaches 1; beyond, it is 1."""


@fused_inlined
def rational_tanh(x):
    """The fifth convergent of tanh's continued fraction (Lambert 1770): error below 1.4e-3.

    Networks are trained with this very function, so its error is none of the network's.
    """
    x = min(max(x, np.float32(-TANH_LIMIT)), np.float32(TANH_LIMIT))
    s = x * x
    above = x * (np.float32(945.0) + s * (np.float32(105.0) + s))
    return above / (np.float32(945.0) + s * (np.float32(420.0) + s * np.float32(15.0)))


def unpacked(network: Network) -> list[tuple[np.ndarray, np.ndarray]]:
    """(weight (outputs, inputs), bias (outputs,)) of every layer."""
    layers, place = [], 0
    for inputs, outputs in zip(network.widths, network.widths[1:]):
        end = place + inputs * outputs
        layers.append((network.packed[place:end].reshape(outputs, inputs),
                       network.packed[end:end + outputs]))
        place = end + outputs
    return layers


LAYERS_MAX = 7
_HEADER = LAYERS_MAX + 1


def block_numbers(network: Network) -> np.ndarray:
    """A network laid out for `forward_block` and `forward_one`, float32.

    Widths are widened with zeros to multiples of 4. All is in one array, because every array that
    is passed costs a single call 50 ns:

    1. Header: the number of layers, then their widths, inputs first.
    2. Values: room for a block, max(widths) rows of LANES; inputs before, outputs after.
    3. Spare: room for a block.
    4. Tiles: per layer the biases, then for each group of 4 outputs and each group of 4 inputs the
       16 weights, outputs first: the order in which `forward_block` reads.
    5. Columns: per layer the biases, then for each input the weights to all outputs, for
       `forward_one`.
    """
    widths = [-(-width // 4) * 4 for width in network.widths]
    header = np.zeros(_HEADER, dtype=np.float32)
    header[0] = len(widths) - 1
    header[1:1 + len(widths)] = widths
    tiles, columns = [], []
    for (narrow, narrow_bias), wide_in, wide_out in zip(unpacked(network), widths, widths[1:]):
        weight = np.zeros((wide_out, wide_in), dtype=np.float32)
        bias = np.zeros(wide_out, dtype=np.float32)
        weight[:narrow.shape[0], :narrow.shape[1]] = narrow
        bias[:len(narrow_bias)] = narrow_bias
        grouped = weight.reshape(wide_out // 4, 4, wide_in // 4, 4).transpose(0, 2, 1, 3)
        tiles += [bias, grouped.ravel()]
        columns += [bias, weight.T.ravel()]
    room = np.zeros(2 * max(widths) * LANES, dtype=np.float32)
    return np.concatenate([header, room, *tiles, *columns])


@kernel
def _widest(numbers):
    widest = 0
    for layer in range(int(numbers[0]) + 1):
        widest = max(widest, int(numbers[1 + layer]))
    return widest


@kernel
def network_values(numbers):
    """The room for inputs and outputs, flat: input k of lane i at k · LANES + i."""
    return numbers[_HEADER:_HEADER + _widest(numbers) * LANES]


@fused_kernel
def forward_block(numbers):
    """Run the network on LANES inputs at once.

    Four outputs at a time take in four inputs at a time, so that a value loaded is used four times.
    """
    room = _widest(numbers) * LANES
    place = _HEADER + 2 * room
    tiles = numbers[place:]
    values = numbers[_HEADER:_HEADER + room].reshape(-1, LANES)
    spare = numbers[_HEADER + room:place].reshape(-1, LANES)
    place = 0
    layers = int(numbers[0])
    for layer in range(layers):
        outputs = int(numbers[2 + layer])
        place = _layer_block(tiles, place, int(numbers[1 + layer]), outputs, values, spare)
        if layer < layers - 1:
            _tanh_block(spare, values, outputs)
        else:
            values[:outputs] = spare[:outputs]


@fused_kernel
def _tanh_block(x, y, count):
    for row in range(count):
        for i in range(LANES):
            y[row, i] = rational_tanh(x[row, i])


@fused_kernel
def _layer_block(packed, place, inputs, outputs, x, y):
    tile = place + outputs
    for row in range(0, outputs, 4):
        b0, b1, b2, b3 = (packed[place + row], packed[place + row + 1], packed[place + row + 2],
                          packed[place + row + 3])
        for i in range(LANES):
            y[row, i], y[row + 1, i], y[row + 2, i], y[row + 3, i] = b0, b1, b2, b3
        for column in range(0, inputs, 4):
            p0, p1, p2, p3 = packed[tile], packed[tile + 1], packed[tile + 2], packed[tile + 3]
            q0, q1, q2, q3 = packed[tile + 4], packed[tile + 5], packed[tile + 6], packed[tile + 7]
            r0, r1, r2, r3 = (packed[tile + 8], packed[tile + 9], packed[tile + 10],
                              packed[tile + 11])
            s0, s1, s2, s3 = (packed[tile + 12], packed[tile + 13], packed[tile + 14],
                              packed[tile + 15])
            for i in range(LANES):
                x0, x1, x2, x3 = x[column, i], x[column + 1, i], x[column + 2, i], x[column + 3, i]
                y[row, i] = (((y[row, i] + p0 * x0) + p1 * x1) + p2 * x2) + p3 * x3
                y[row + 1, i] = (((y[row + 1, i] + q0 * x0) + q1 * x1) + q2 * x2) + q3 * x3
                y[row + 2, i] = (((y[row + 2, i] + r0 * x0) + r1 * x1) + r2 * x2) + r3 * x3
                y[row + 3, i] = (((y[row + 3, i] + s0 * x0) + s1 * x1) + s2 * x2) + s3 * x3
            tile += 16
    return tile


@fused_kernel
def forward_one(numbers):
    """`forward_block` for the first lane alone, its sums in the same order."""
    room = _widest(numbers) * LANES
    values = numbers[_HEADER:]
    x = numbers[_HEADER + room:]
    y = numbers[_HEADER + room + LANES:]
    first = _HEADER + 2 * room
    columns = numbers[first + (len(numbers) - first) // 2:]
    layers = int(numbers[0])
    for k in range(int(numbers[1])):
        x[k] = values[k * LANES]
    place = 0
    for layer in range(layers):
        outputs = int(numbers[2 + layer])
        _copy_row(columns[place:], y, outputs)
        place += outputs
        for column in range(0, int(numbers[1 + layer]), 4):
            _four_columns(columns[place:], columns[place + outputs:],
                          columns[place + 2 * outputs:], columns[place + 3 * outputs:],
                          x[column], x[column + 1], x[column + 2], x[column + 3], y, outputs)
            place += 4 * outputs
        if layer < layers - 1:
            for row in range(outputs):
                x[row] = rational_tanh(y[row])
        else:
            for row in range(outputs):
                values[row * LANES] = y[row]


@inlined
def _copy_row(source, target, count):
    for row in range(count):
        target[row] = source[row]


@fused_inlined
def _four_columns(a, b, c, d, x0, x1, x2, x3, y, count):
    for row in range(count):
        y[row] = (((y[row] + a[row] * x0) + b[row] * x1) + c[row] * x2) + d[row] * x3


@kernel
def forward(packed, widths, activation):
    """Run the network on the inputs in `activation[0]`; the outputs are left in the row returned.

    packed: float32, widths: (layers + 1,) int64, activation: (2, widest) float32 scratch.
    """
    here = 0
    place = 0
    layers = len(widths) - 1
    for layer in range(layers):
        inputs = widths[layer]
        outputs = widths[layer + 1]
        bias = place + inputs * outputs
        for row in range(outputs):
            total = packed[bias + row]
            for column in range(inputs):
                total += packed[place + row * inputs + column] * activation[here, column]
            activation[1 - here, row] = total if layer == layers - 1 else math.tanh(total)
        place = bias + outputs
        here = 1 - here
    return here
