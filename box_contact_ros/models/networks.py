# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models `mlp` and `paper` by weights files. Their algorithms are in core/src/mlp/.

The shipped weights of `mlp` are compiled into the core: no file is read for them.
"""
from __future__ import annotations

import os
from typing import NamedTuple

import numpy as np

from ..core import FEATURES, NETWORK_FORMAT, OUTPUTS, UNITS_MAX, native
from ..resources import resource_path
from ..solver.checks import as_size, short_repr
from ..solver.contact import Contacts
from .weights_file import Network, Weights, WeightsError, load_weights


class Kind(NamedTuple):
    """What the network of a model must be."""

    network: str  # its name in a weights file
    inputs: int
    outputs: int
    activation: str  # of the hidden units
    has_path: bool  # whether the last layer reads the inputs, too


MLP, PAPER = 'mlp', 'paper'
KINDS = {MLP: Kind('patch', FEATURES, OUTPUTS, 'relu', True),
         PAPER: Kind('contact', 6, 4, 'tanh', False)}
"""Networks by model.

`mlp` reads what the boxes cut off the patch box, and gives the overlap there. `paper` reads t_x t_y
t_z roll pitch yaw. It gives azimuth and elevation of the point and of the normal, seen from the
first box's centre. Lengths are in halves of the longest edge.
"""
GROUP, INPUTS_TOGETHER = 8, 4
"""Units, and inputs, that the core reads together."""
SHIPPED_PAPERS = ('paper', 'paper-12.192x2.438x2.591')
"""Weights files of `paper`, for cubes of any edge and for 40 ft containers."""
SAME_SIZE = 1e-6
"""Relative difference of extents up to which two sizes are one, and a size that of the weights."""


def core_numbers(network: Network, *, is_tanh: bool = False, in_half_edges: bool = False,
                 ) -> np.ndarray:
    """Return a network as the core reads it (core/src/mlp/network.hpp): float32 (n,).

    The header has inputs, units of both hidden layers, outputs, and three flags. Each group of
    `GROUP` units has its biases, and for each input the units' weights for it. Units that fill a
    group, and inputs that fill a multiple of `INPUTS_TOGETHER`, are zero.
    """
    numbers = [np.array([*network.widths, is_tanh, in_half_edges, network.has_path], np.float32)]
    for number, (weight, bias) in enumerate(network.layers):
        # A last layer with a linear path reads two lists: inputs, and units of the layer before.
        is_last = number == len(network.layers) - 1
        lists = np.split(weight, [network.widths[0]] if is_last and network.has_path else [], 1)
        columns = np.hstack([bias[:, None], *(_filled(part, 1, INPUTS_TOGETHER)
                                              for part in lists)])
        layer = _filled(columns, 0, GROUP)
        numbers.append(layer.reshape(-1, GROUP, layer.shape[1]).swapaxes(1, 2).ravel())
    return np.concatenate(numbers).astype(np.float32)


def _filled(array: np.ndarray, axis: int, multiple: int) -> np.ndarray:
    """Return an array (n, m) with zeros up to a multiple along an axis."""
    more = [(0, 0), (0, 0)]
    more[axis] = (0, -array.shape[axis] % multiple)
    return np.pad(array, more)


def network_of(weights: Weights, model: str) -> Network:
    """Return the network of a model in its weights file; raises `WeightsError`."""
    file, kind = f'weights file {short_repr(str(weights.path))}', KINDS[model]
    number = weights.card.get('format')  # a card may say anything
    if model == MLP and (type(number) is not int or number != NETWORK_FORMAT):
        raise WeightsError(f'{file} has format {short_repr(number)}; this version reads '
                           f'{NETWORK_FORMAT}')
    network = weights.network(kind.network, kind.inputs, kind.outputs, model)
    if len(network.widths) != 4 or max(network.widths[1:3]) > UNITS_MAX:
        raise WeightsError(f'{file}: network {kind.network!r} must have two hidden layers, of at '
                           f'most {UNITS_MAX} units')
    if network.has_path != kind.has_path:
        raise WeightsError(f'{file}: the last layer of network {kind.network!r} must read '
                           f'{"inputs and units" if kind.has_path else "units alone"}')
    activation = weights.card.get('activation', 'tanh' if model == PAPER else None)
    if activation != kind.activation:
        raise WeightsError(f"{file}: this version's units are {kind.activation!r}, not "
                           f'{short_repr(activation)}')
    return network


def mlp_numbers(path: str | os.PathLike[str]) -> np.ndarray:
    """Return the network of `mlp` in a file as the core reads it; raises `WeightsError`."""
    return core_numbers(network_of(load_weights(path), MLP))


def read_mlp(path: str | os.PathLike[str]) -> native.Mlp:
    """Return model `mlp` with the weights of a file; raises `WeightsError`."""
    return native.Mlp(mlp_numbers(path))


class PaperWeights:
    """The paper's network with one file's weights: for cubes of any edge, or for one size."""

    def __init__(self, weights: Weights) -> None:
        network = network_of(weights, PAPER)
        try:
            self.size = as_size(weights.card['sizes'][0], 'size')[0]
        except (LookupError, TypeError, ValueError) as error:
            raise WeightsError(f'weights file {short_repr(str(weights.path))}: the sizes in its '
                               'card are no list of three extents') from error
        self.file, self.cubes = weights.path.name, is_cube(self.size)
        self.numbers = core_numbers(network, is_tanh=True, in_half_edges=self.cubes)
        self.model = native.Paper(self.numbers)

    def fits(self, size_a: np.ndarray, size_b: np.ndarray) -> np.ndarray:
        """Return which rows of full extents (n, 3) the weights are for, (n,)."""
        wanted = size_a[:, :1] if self.cubes else self.size
        return np.all((np.abs(size_a - size_b) <= SAME_SIZE * size_a)
                      & (np.abs(size_a - wanted) <= SAME_SIZE * wanted), axis=1)


class Paper:
    """Model `paper` by some weights files: each pair by those for its sizes."""

    def __init__(self, *files: Weights) -> None:
        self._weights = [PaperWeights(weights) for weights in files]

    def native_for(self, size_a: np.ndarray, size_b: np.ndarray) -> native.Paper | None:
        """Return what answers for two full extents (3,) [m], or None: no weights are for them."""
        return next((weights.model for weights in self._weights
                     if weights.fits(size_a[None], size_b[None])[0]), None)

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        size_a, size_b = (size[:1] if np.array_equal(size[1:], size[:-1]) else size
                          for size in (size_a, size_b))  # many rows of one size are checked once
        fits = np.array([weights.fits(size_a, size_b) for weights in self._weights])
        which = fits.argmax(axis=0)
        first, *others = np.unique(which) if len(which) else (0,)
        contacts, refused = self._weights[first].model.solve(a, b, size_a, size_b, threads, False)
        misfits = np.flatnonzero(~fits.any(axis=0))[:len(a)]
        if len(misfits) and not 0 <= refused < misfits[0]:
            refused = int(misfits[0])
        for number in others if refused < 0 else ():
            rows = np.flatnonzero(which == number)
            sizes = (size[rows] if len(size) > 1 else size for size in (size_a, size_b))
            part, _ = self._weights[number].model.solve(a[rows], b[rows], *sizes, threads, False)
            contacts.point[rows], contacts.normal[rows] = part.point, part.normal
        return contacts, refused

    def size_fault(self, size_a: np.ndarray, size_b: np.ndarray) -> str | None:
        """Return why no weights are for two full extents (3,) [m], or None."""
        if self.native_for(size_a, size_b) is not None:
            return None
        asked = f'{in_words(size_a)} and {in_words(size_b)}'
        if len(self._weights) > 1:
            return (f"model 'paper' has no weights for boxes of {asked}: train them and give "
                    "make_model their file, or use model 'exact', which needs none")
        weights = self._weights[0]
        known = 'cubes of one size' if weights.cubes else f'boxes of {in_words(weights.size)}'
        return (f"the weights {short_repr(weights.file)} of model 'paper' are for two {known}, not "
                f"for {asked}; any sizes work with model 'exact'")


def read_paper(path: str | os.PathLike[str] | None = None) -> Paper:
    """Return model `paper` with the weights of a file, for None the shipped ones.

    Raises `WeightsError`.
    """
    files = [path] if path is not None else [resource_path('weights', f'{name}.safetensors')
                                             for name in SHIPPED_PAPERS]
    return Paper(*map(load_weights, files))


def is_cube(size: np.ndarray) -> bool:
    """Return whether full extents (3,) are those of a cube."""
    return bool(np.ptp(size) <= SAME_SIZE * size.max())


def in_words(size: np.ndarray) -> str:
    """Return full extents (3,) [m] for a refusal."""
    return ' × '.join(f'{extent:g}' for extent in size) + ' m'
