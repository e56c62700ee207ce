# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Weights files: what is shipped is what its card says, and anything damaged is refused."""
from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load, load_file, save_file

from box_contact_ros import make_model
from box_contact_ros.models.weights_file import WeightsError, load_weights
from box_contact_ros.resources import resource_path

WIDTHS = (6, 5, 3, 4)


def layers(seed: int = 0) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(seed)
    return [(rng.normal(size=(b, a)).astype(np.float32), rng.normal(size=b).astype(np.float32))
            for a, b in zip(WIDTHS, WIDTHS[1:])]


def card(**changes: object) -> dict[str, object]:
    return {'architecture': list(WIDTHS), 'sizes': [], **changes}


def tensors() -> dict[str, np.ndarray]:
    return {f'n.{i}.{what}': array for i, pair in enumerate(layers())
            for what, array in zip(('weight', 'bias'), pair)}


def write(path: Path, content: dict[str, np.ndarray], **changes: object) -> Path:
    """Return a weights file, whatever is in it; changes: of its card."""
    save_file(content, path, metadata={'card': json.dumps(card(**changes))})
    return path


@pytest.fixture
def good(tmp_path: Path) -> Path:
    return write(tmp_path / 'good.safetensors', tensors())


def test_networks_and_card_are_read(good: Path) -> None:
    """Weights (outputs × inputs) and biases of each layer."""
    weights = load_weights(good)
    network = weights.networks['n']
    assert network.widths == WIDTHS and weights.card == card()
    for (weight, bias), (want, want_bias) in zip(network.layers, layers(), strict=True):
        np.testing.assert_array_equal(weight, want)
        np.testing.assert_array_equal(bias, want_bias)


def test_the_last_layer_may_read_the_inputs(tmp_path: Path) -> None:
    """Before the units: a linear path. No other layer may, and no last one reads more."""
    content = tensors()
    content['n.2.weight'] = np.hstack([np.ones((4, 6), np.float32), content['n.2.weight']])
    network = load_weights(write(tmp_path / 'path', content)).networks['n']
    assert network.has_path and network.widths == WIDTHS
    more = content | {'n.2.weight': np.hstack([content['n.2.weight'], np.ones((4, 1), np.float32)])}
    middle = tensors()
    middle['n.1.weight'] = np.hstack([np.ones((3, 6), np.float32), middle['n.1.weight']])
    for number, wrong in ((2, more), (1, middle)):
        with pytest.raises(WeightsError, match=f"layer {number} of 'n' does not fit"):
            load_weights(write(tmp_path / 'wrong', wrong))


@pytest.mark.parametrize('share', [0.0, 0.02, 0.5, 0.999])
def test_truncated(good: Path, share: float) -> None:
    content = good.read_bytes()
    good.write_bytes(content[:int(share * len(content))])
    with pytest.raises(WeightsError, match='cannot be read'):
        load_weights(good)


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf, 1e5])
def test_values_no_training_gives(tmp_path: Path, value: float) -> None:
    content = tensors()
    content['n.1.weight'][2, 1] = value
    with pytest.raises(WeightsError, match=r"'n\.1\.weight' holds values that are not finite"):
        load_weights(write(tmp_path / 'x', content))


@pytest.mark.parametrize(('change', 'message'), [
    ({'n.1.weight': np.zeros((3, 4), dtype=np.float32)}, "1 of 'n' does not fit its neighbours"),
    ({'n.1.weight': np.zeros(15, dtype=np.float32)}, "1 of 'n' does not fit its neighbours"),
    ({'n.2.bias': np.zeros(5, dtype=np.float32)}, "2 of 'n' does not fit its neighbours"),
    ({'n.1.bias': None}, "1 of 'n' does not fit its neighbours"),
    ({'n.1.weight': None, 'n.1.bias': None}, 'belong to no layer'),
    ({'n.4.bias': np.zeros(4, dtype=np.float32)}, 'belong to no layer'),
    ({'odd': np.zeros(0, dtype=np.float32)}, 'belong to no layer'),
    ({'n.0.bias': np.zeros(5)}, 'is F64, not F32'),
])
def test_shapes_that_are_no_network(tmp_path: Path, change: dict, message: str) -> None:
    content = {**tensors(), **change}
    content = {name: array for name, array in content.items() if array is not None}
    with pytest.raises(WeightsError, match=message):
        load_weights(write(tmp_path / 'x', content))


@pytest.mark.parametrize('architecture', [[6, 5, 4], [6, 5, 3, 3], 5, None])
def test_architecture_of_the_card(tmp_path: Path, architecture: object) -> None:
    with pytest.raises(WeightsError, match='the model card says'):
        load_weights(write(tmp_path / 'x', tensors(), architecture=architecture))


@pytest.mark.parametrize('sizes', [[], {}, None, 5, [5], [None], [[2, 2]], [[2, 2, -1]], ['abc']])
def test_sizes_that_are_none(tmp_path: Path, sizes: object) -> None:
    """The paper's networks are for the boxes of their card."""
    shipped = resource_path('weights', 'paper.safetensors')
    card = {**load_weights(shipped).card, 'sizes': sizes}
    save_file(load_file(shipped), tmp_path / 'x', metadata={'card': json.dumps(card)})
    with pytest.raises(WeightsError, match='no list of three extents'):
        make_model('paper', weights=tmp_path / 'x')


@pytest.mark.parametrize('text', [None, '', '{', '3', '"name"', '[]',
                                  '[["name", "a pair"]]', '[' * 100_000, '{"a":' * 100_000,
                                  '{"sizes": ' + '1' * 10_000 + '}'])
def test_no_card(tmp_path: Path, text: str | None) -> None:
    metadata = {} if text is None else {'card': text}
    save_file(tensors(), tmp_path / 'x', metadata=metadata)
    with pytest.raises(WeightsError, match='no readable model card'):
        load_weights(tmp_path / 'x')


def test_every_edited_byte_of_the_header(good: Path) -> None:
    """What is still read has the bits that were written, under whatever name."""
    content = good.read_bytes()
    want = sorted(array.tobytes() for array in load(content).values())
    read = 0
    for place in range(8 + int.from_bytes(content[:8], 'little')):
        edited = bytearray(content)
        edited[place] ^= 1 << place % 7
        good.write_bytes(bytes(edited))
        try:
            networks = load_weights(good).networks
        except WeightsError:
            continue
        assert sorted(array.tobytes() for network in networks.values()
                      for layer in network.layers for array in layer) == want
        read += 1
    assert read > 0  # a letter of the card


def test_many_networks_take_no_quadratic_time(tmp_path: Path) -> None:
    """20,000 in one file are read in a second or so; a hundred times that, where each asks all."""
    count = 20_000
    one = {'0.weight': np.zeros((1, 1), np.float32), '0.bias': np.zeros(1, np.float32)}
    path = write(tmp_path / 'x', {f'n{k}.{part}': array for k in range(count)
                                  for part, array in one.items()}, architecture=[1, 1])
    began = time.process_time()
    assert len(load_weights(path).networks) == count
    assert time.process_time() - began < 30.0


def test_a_refusal_is_one_line_without_terminal_codes(tmp_path: Path) -> None:
    """Names of tensors and files are a stranger's."""
    odd = 'n\n\x1b[31m'
    for content, file in (({f'{odd}.0.weight': np.zeros((1, 2), np.float32)}, 'x'),
                          ({f'{odd}.0.weight': np.full((1, 2), np.nan, np.float32)}, 'x'),
                          ({odd: np.zeros(2)}, 'x'), (tensors() | {odd: np.zeros(2, 'f4')}, odd)):
        path = write(tmp_path / file, content, architecture=[[odd]])
        with pytest.raises(WeightsError) as refused:
            load_weights(path)
        assert str(refused.value).isprintable()
    with pytest.raises(WeightsError) as refused:
        load_weights(tmp_path / f'{odd}{odd}')
    assert str(refused.value).isprintable()


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match='does not exist'):
        load_weights(tmp_path / 'x')
    os.mkfifo(tmp_path / 'pipe')
    for path in (tmp_path, tmp_path / 'pipe'):
        with pytest.raises(WeightsError, match='cannot be read: it is not a regular file'):
            load_weights(path)
    save_file({}, tmp_path / 'y', metadata={'card': json.dumps(card())})
    with pytest.raises(WeightsError, match='holds no network'):
        load_weights(tmp_path / 'y')
