# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `mlp`: SAT, columns under the contact face, and a network between proven brackets.

The algorithm is that of core/src/mlp/. Here its weights are read and checked. Pairs whose brackets
are too far apart are left to `exact`, and counted.
"""
from __future__ import annotations

import numpy as np

from ..core import FEATURES, NETWORK_FORMAT
from .checks import shown
from .models import NativeModel
from .weights_file import Network, Weights, WeightsError, weights_for

FEATURE_NAMES = (
    "largest share of the body's extent beyond a side face", 'sum of these shares',
    'deepest corner along these extents', 'centroid along these extents',
    'sum of how far its own edges truncate the face', 'product of these')
"""Features of what an upper face cuts off (core/src/columns/upper_faces.hpp)."""
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


def mlp(weights: str | None = None) -> NativeModel:
    """Return model `mlp` with the weights of a file, or for None the shipped ones.

    Raises `WeightsError` for a file that does not fit.
    """
    found = load_mlp(weights)
    return NativeModel(name='mlp', weights=found, network=core_numbers(found.networks[NETWORK]))


def load_mlp(weights: str | None = None) -> Weights:
    """Read the weights of an MLP, the shipped ones for None; raises `WeightsError`."""
    found = weights_for('mlp', weights, shipped='mlp')
    number = found.card.get('format')  # a card may say anything
    if type(number) is not int or number != NETWORK_FORMAT:
        raise WeightsError(f'weights file {found.path} has format {shown(number)}; this version '
                           f'reads {NETWORK_FORMAT}')
    network = found.network(NETWORK, FEATURES, 1, model='mlp')
    if len(network.widths) != 3 or network.widths[1] > UNITS_MAX:
        raise WeightsError(f'weights file {found.path}: network {NETWORK!r} must have one hidden '
                           f'layer, of at most {UNITS_MAX} units')
    if found.card.get('activation') != ACTIVATION:
        raise WeightsError(f"weights file {found.path}: this version's units are {ACTIVATION!r}, "
                           f"not {found.card.get('activation')!r}")
    return found
