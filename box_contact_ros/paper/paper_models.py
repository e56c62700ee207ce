# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The source's networks as models: contact point and normal of two equal boxes.

The separating-axis test decides whether the boxes collide and gives the separation. A network gives
azimuth and elevation of the contact point and of the normal: see networks.hpp.

- `paper`: one network for all poses.
- `paper-continuous`: one for each subset without discontinuities; the features that meet choose it.
- `paper-committee`: one for each kind of contact. A network that has learnt to tell the kinds apart
  weights their answers, as the source proposes for further work.

Weights are for cubes of any edge, or for the very size that they were trained for (`paper` only).
"""
from __future__ import annotations

from functools import partial

import numpy as np

from box_contact_ros.solver.checks import as_size
from box_contact_ros.solver.models import NativeModel
from box_contact_ros.solver.weights_file import Network, Weights, WeightsError, weights_for

from ._networks import FEATURES, INPUTS, KERNEL, MOST_UNITS, OCTANT, OUTPUTS, SAME_SIZE

EXPERTS = ('vertex', 'edge', 'face')  # of the committee, in the order of the classifier's outputs


def paper(size_a: np.ndarray, size_b: np.ndarray, weights: str | None) -> NativeModel:
    """Return model `paper` for full extents (1, 3) [m]; weights: a file, None for the shipped one.

    Raises ValueError for sizes that no weights are for.
    """
    return _model('paper', {'contact': OUTPUTS}, OCTANT, size_a[0], size_b[0], weights)


def paper_continuous(size_a: np.ndarray, size_b: np.ndarray, weights: str | None) -> NativeModel:
    """Return model `paper-continuous`: see `paper`."""
    # In the order of symmetry.VERTEX_FACE, EDGE_EDGE.
    return _model('paper-continuous', {'vertex_face': OUTPUTS, 'edge_edge': OUTPUTS}, FEATURES,
                  size_a[0], size_b[0], weights)


def paper_committee(size_a: np.ndarray, size_b: np.ndarray, weights: str | None) -> NativeModel:
    """Return model `paper-committee`: see `paper`."""
    outputs = {'classifier': len(EXPERTS), **dict.fromkeys(EXPERTS, OUTPUTS)}
    return _model('paper-committee', outputs, OCTANT, size_a[0], size_b[0], weights)


def _model(model: str, outputs: dict[str, int], fold_to: int, size_a: np.ndarray,
           size_b: np.ndarray, path: str | None) -> NativeModel:
    """Return a model; outputs: of each network of its weights file, in the kernel's order."""
    cubes = _is_cube(size_a)
    suffix = '' if cubes else '-' + 'x'.join(f'{extent:g}' for extent in size_a)
    _refuse(_pair_fault(model, size_a, size_b))
    weights = weights_for(model, path, shipped=model + suffix,
                          boxes=f' for boxes of size {_text(size_a)}')
    networks = [weights.network(name, INPUTS, count, model) for name, count in outputs.items()]
    size = _size_of(weights)
    if fold_to == FEATURES and not _is_cube(size):
        raise WeightsError(f'model {model!r} needs weights for cubes')
    if max(width for network in networks for width in network.widths) > MOST_UNITS:
        raise WeightsError(f'weights file {weights.path}: a layer has more than {MOST_UNITS} units')
    fault = partial(_size_fault, model, weights.path.name, size)
    _refuse(fault(size_a, size_b))
    numbers = np.concatenate([[fold_to], size, *map(_numbers, networks)])
    return NativeModel(kernel=KERNEL, weights=weights, size_fault=fault,
                       network=numbers.astype(np.float32))


def _numbers(network: Network) -> np.ndarray:
    """Return a network as the kernel reads it: its layers, their units, its parameters."""
    return np.concatenate([[len(network.widths)], network.widths, network.packed])


def _size_of(weights: Weights) -> np.ndarray:
    try:
        return as_size(weights.card['sizes'][0], 'size')[0]
    except (LookupError, TypeError, ValueError) as error:
        raise WeightsError(f'weights file {weights.path}: the sizes in its card are no list of '
                           f'three extents') from error


def _size_fault(model: str, file: str, trained: np.ndarray, size_a: np.ndarray,
                size_b: np.ndarray) -> str | None:
    """Return why weights trained for a size (3,) are not for two sizes (3,), or None."""
    if _is_cube(trained):
        known, fits = 'cubes', _is_cube(size_a)
    else:
        known, fits = _text(trained), np.allclose(size_a, trained, rtol=SAME_SIZE, atol=0.0)
    return _pair_fault(model, size_a, size_b) or (None if fits else (
        f'the weights {file} of model {model!r} are for {known}, not for size {_text(size_a)}; '
        f"any size works with model 'exact'"))


def _pair_fault(model: str, size_a: np.ndarray, size_b: np.ndarray) -> str | None:
    if np.allclose(size_b, size_a, rtol=SAME_SIZE, atol=0.0):
        return None
    return (f'model {model!r} is for two boxes of one size, not {_text(size_a)} and '
            f"{_text(size_b)}; any sizes work with model 'exact'")


def _is_cube(size: np.ndarray) -> bool:
    return bool(np.ptp(size) <= SAME_SIZE * size.max())


def _refuse(fault: str | None) -> None:
    if fault:
        raise ValueError(fault)


def _text(size: np.ndarray) -> str:
    return ' × '.join(f'{extent:g}' for extent in size) + ' m'
