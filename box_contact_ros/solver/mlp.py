# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `mlp`: SAT decides and gives normal and depth; a network gives point, volume, covariance.

The algorithm is that of core/src/mlp/. Here its weights are read and checked. Outside the range
that the network was trained for, the answer is the exact one, and counted. So it is for boxes that
the card of the weights does not list, if it lists any: those of a scene (`train --scene`).
"""
from __future__ import annotations

import numpy as np

from ..core import FEATURES, NETWORK_FORMAT, OUTPUTS, POINT_OUTPUTS
from .checks import shown
from .models import NativeModel
from .weights_file import Network, Weights, WeightsError, weights_for

FEATURE_NAMES = (
    'slant · cut', '|slant · push|', 'slant · push of these faces · of the others',
    'larger slant along another axis · cut',
    'cut of these faces', '|push of these faces|', 'their push · of the others along it',
    'cut of all faces',
    'slant · cut of all faces along this axis', '|push of all faces| along it',
    'larger slant · cut of all faces along another', '|push of all faces| along all axes')
"""Features at a site: four of its own, four that all sites of its faces have, four of its axis."""
FORMAT, DESCRIPTION = NETWORK_FORMAT, 'cuts of the bounds by the slab, at nine sites'
"""Of new weights: what their numbers mean, for programs and for people."""
BOUNDS = {FORMAT: 'slab', 1: 'edges'}
"""Method of the bounds by a card's format (core/src/overlap/bounds.hpp). Weights of another format
are refused. Those of format 1 give the point alone."""
_NATIVE = {'slab': 'mlp', 'edges': 'mlp-edges'}  # names that the core has for the models
ACTIVATION = 'relu'  # activation of the hidden units; weights made for another one are refused
UNITS_MAX = 64  # most hidden units: as far as the search for their number goes


def core_numbers(network: Network) -> np.ndarray:
    """Return a network as the core reads it: float32 (7 + 20 · units,).

    The biases of the outputs come first. For each unit follow its bias, its weights for features of
    faces, axis and site, and its weights to the outputs. Outputs that the network lacks are zeros.
    """
    (first, bias), (last, last_bias) = network.layers
    missing = OUTPUTS - len(last_bias)
    last, last_bias = np.pad(last, ((0, missing), (0, 0))), np.pad(last_bias, (0, missing))
    units = np.concatenate([bias[:, None], first[:, 4:8], first[:, 8:12], first[:, :4], last.T],
                           axis=1)
    return np.concatenate([last_bias, units.ravel()]).astype(np.float32)


def mlp(weights: str | None = None) -> NativeModel:
    """Return model `mlp` with the weights of a file, or for None the shipped ones.

    `exact` answers for boxes that the weights' card does not list, if it lists any. Raises
    `WeightsError` for a file that does not fit.
    """
    found = load_mlp(weights)
    return NativeModel(name=_NATIVE[bounds_of(found)], weights=found,
                       network=core_numbers(found.networks['point']), listed=_listed_sizes(found))


def load_mlp(weights: str | None = None) -> Weights:
    """Read the weights of an MLP, the shipped ones for None; raises `WeightsError`."""
    found = weights_for('mlp', weights, shipped='mlp')
    number = found.card.get('format')  # a card may say anything
    bounds = BOUNDS.get(number) if type(number) is int else None
    outputs = POINT_OUTPUTS if bounds == 'edges' else OUTPUTS
    network = found.network('point', FEATURES, outputs, model='mlp')
    if len(network.widths) != 3 or network.widths[1] > UNITS_MAX:
        raise WeightsError(f"weights file {found.path}: network 'point' must have one hidden "
                           f'layer, of at most {UNITS_MAX} units')
    if bounds is None:
        raise WeightsError(f'weights file {found.path} has format {shown(number)}; this version '
                           f'reads {FORMAT} and 1')
    if found.card.get('activation') != ACTIVATION:
        raise WeightsError(f"weights file {found.path}: this version's units are {ACTIVATION!r}, "
                           f"not {found.card.get('activation')!r}")
    return found


def bounds_of(weights: Weights) -> str:
    """Return the method of the bounds that the weights were made for: 'slab' or 'edges'."""
    return BOUNDS[weights.card['format']]


def _listed_sizes(weights: Weights) -> np.ndarray | None:
    """Return the pairs of sizes (pairs, 2, 3) that a card lists, extents sorted, or None: any."""
    listed = weights.card['sizes']
    try:
        sizes = np.array(listed, dtype=np.float64)
    except (TypeError, ValueError):
        sizes = np.empty(0)
    if listed and (sizes.ndim != 3 or sizes.shape[1:] != (2, 3) or not np.all(sizes > 0.0)):
        raise WeightsError(f'weights file {weights.path}: the sizes in its card are no pairs of '
                           f'three extents')
    return np.sort(sizes, axis=-1) if listed else None
