# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Weights files of model `mlp`, whose algorithm is that of core/src/mlp/.

The shipped weights are compiled into the core, so only the option `weights` reads a file.
"""
from __future__ import annotations

import numpy as np

from ..core import FEATURES, NETWORK_FORMAT
from ..resources import resource_path
from .checks import short_repr
from .weights_file import Network, Weights, WeightsError, load_weights

NETWORK = 'share'  # name of the network in a weights file
ACTIVATION = 'relu'  # activation of the hidden units; weights made for another one are refused
UNITS_MAX = 64  # most hidden units


def core_numbers(network: Network) -> np.ndarray:
    """Return a network as the core reads it: float32 (1 + 8 · units,).

    The bias of the output comes first. For each unit follow its bias, its weights for the features,
    and its weight to the output.
    """
    (first, bias), (last, last_bias) = network.layers
    units = np.concatenate([bias[:, None], first, last.T], axis=1)
    return np.concatenate([last_bias, units.ravel()]).astype(np.float32)


def load_mlp(path: str | None = None) -> Weights:
    """Read the weights of an MLP, for None the shipped file's; raises `WeightsError`."""
    loaded = load_weights(path or resource_path('weights', 'mlp.safetensors'))
    file = f'weights file {short_repr(str(loaded.path))}'
    number = loaded.card.get('format')  # a card may say anything
    if type(number) is not int or number != NETWORK_FORMAT:
        raise WeightsError(f'{file} has format {short_repr(number)}; this version reads '
                           f'{NETWORK_FORMAT}')
    network = loaded.network(NETWORK, FEATURES, 1, model='mlp')
    if len(network.widths) != 3 or network.widths[1] > UNITS_MAX:
        raise WeightsError(f'{file}: network {NETWORK!r} must have one hidden layer, of at most '
                           f'{UNITS_MAX} units')
    if loaded.card.get('activation') != ACTIVATION:
        raise WeightsError(f"{file}: this version's units are {ACTIVATION!r}, not "
                           f"{short_repr(loaded.card.get('activation'))}")
    return loaded
