# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Weights files of model `mlp`, whose algorithm is that of core/src/mlp/.

The shipped weights are compiled into the core: no file is read for them.
"""
from __future__ import annotations

import os

import numpy as np

from ..core import FEATURES, NETWORK_FORMAT, OUTPUTS, UNITS_MAX, native
from ..resources import resource_path
from ..solver.checks import short_repr
from .weights_file import Network, Weights, WeightsError, load_weights

NETWORK = 'patch'  # name of the network in a weights file
ACTIVATION = 'relu'  # activation of the hidden units; weights made for another one are refused
GROUP = 8
"""Units that the core reads together."""


def core_numbers(network: Network) -> np.ndarray:
    """Return a network as the core reads it (core/src/mlp/network.hpp): float32 (n,).

    The numbers of groups of both hidden layers come first. Each group of `GROUP` units has its
    biases, and for each input the units' weights for it. Units that fill a group are zero.
    """
    numbers, inputs = [], FEATURES
    counts = [-(-len(bias) // GROUP) for _, bias in network.layers]
    for groups, (weight, bias) in zip(counts, network.layers):
        layer = np.zeros((GROUP * groups, 1 + inputs), np.float32)
        layer[:len(bias), 0] = bias
        layer[:len(bias), 1:1 + weight.shape[1]] = weight
        numbers.append(layer.reshape(groups, GROUP, 1 + inputs).swapaxes(1, 2).ravel())
        inputs = GROUP * groups
    return np.concatenate([np.array(counts[:2], np.float32), *numbers])


def read_mlp(path: str | os.PathLike[str]) -> native.Mlp:
    """Return model `mlp` with the weights of a file; raises `WeightsError`."""
    return native.Mlp(core_numbers(load_mlp(path).networks[NETWORK]))


def load_mlp(path: str | os.PathLike[str] | None = None) -> Weights:
    """Read the weights of an MLP, for None the shipped file's; raises `WeightsError`."""
    loaded = load_weights(path or resource_path('weights', 'mlp.safetensors'))
    file = f'weights file {short_repr(str(loaded.path))}'
    number = loaded.card.get('format')  # a card may say anything
    if type(number) is not int or number != NETWORK_FORMAT:
        raise WeightsError(f'{file} has format {short_repr(number)}; this version reads '
                           f'{NETWORK_FORMAT}')
    network = loaded.network(NETWORK, FEATURES, OUTPUTS, model='mlp')
    if len(network.widths) != 4 or max(network.widths[1:3]) > UNITS_MAX:
        raise WeightsError(f'{file}: network {NETWORK!r} must have two hidden layers, of at most '
                           f'{UNITS_MAX} units')
    if loaded.card.get('activation') != ACTIVATION:
        raise WeightsError(f"{file}: this version's units are {ACTIVATION!r}, not "
                           f"{short_repr(loaded.card.get('activation'))}")
    return loaded
