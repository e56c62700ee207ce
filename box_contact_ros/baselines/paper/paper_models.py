# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models `paper` and `paper-continuous`: contact point and normal from the source's networks.

The separating-axis test decides whether the boxes collide and gives the separation. A network gives
azimuth and elevation of the contact point and of the normal: see baselines/paper/networks.hpp.

One network for all poses is `paper`. `paper-continuous` has one network for each subset without
discontinuities; the features that meet choose it. Both are for two equal boxes: cubes of any edge,
or the very size that the weights were trained for (`paper` only).
"""
from __future__ import annotations

import numpy as np

from ...solver.checks import as_size
from ...solver.contact import Contacts, without_patch
from ...solver.weights_file import WeightsError, weights_for
from . import _networks
from ._networks import FEATURES, INPUTS, OCTANT, OUTPUTS

SAME_SIZE = 1e-9
"""Relative difference of extents up to which a size is the one that the weights were made for."""


def _is_cube(size: np.ndarray) -> bool:
    return bool(np.ptp(size) <= SAME_SIZE * size.max())


class Paper:
    """The source's networks behind the solver's interface.

    size_a, size_b: (1, 3) full extents [m]; weights: a file, or None for the shipped one.
    Raises ValueError for sizes that no weights are for.
    """

    model = 'paper'
    experts: tuple[str, ...] = ('contact',)  # the networks of the weights file
    fold_to = OCTANT  # the way into the networks' domain

    def __init__(self, size_a: np.ndarray, size_b: np.ndarray, weights: str | None) -> None:
        self._check_equal(size_a, size_b)
        size = size_a[0]
        suffix = '' if _is_cube(size) else '-' + 'x'.join(f'{extent:g}' for extent in size)
        self.weights = weights_for(self.model, weights, shipped=self.model + suffix,
                                   boxes=f' for boxes of size {_text(size)}')
        networks = [self.weights.network(name, INPUTS, OUTPUTS, self.model)
                    for name in self.experts]
        try:
            self._size = as_size(self.weights.card['sizes'][0], 'size')[0]
        except (LookupError, TypeError, ValueError) as error:
            raise WeightsError(f'weights file {self.weights.path}: the sizes in its card are no '
                               f'list of three extents') from error
        self._cubes = _is_cube(self._size)
        self._check_sizes(size_a, size_b)
        self._packed = np.stack([network.packed for network in networks])
        self._widths = np.array(networks[0].widths, dtype=np.int64)

    def _check_equal(self, size_a: np.ndarray, size_b: np.ndarray) -> None:
        differs = np.any(np.abs(size_a - size_b) > SAME_SIZE * size_a, axis=1)
        if differs.any():
            row = int(np.argmax(differs))
            raise ValueError(
                f'model {self.model!r} is for two boxes of one size, not '
                f'{_text(size_a[row % len(size_a)])} and '
                f"{_text(size_b[row % len(size_b)])}; any sizes work with model 'exact'")

    def _check_sizes(self, size_a: np.ndarray, size_b: np.ndarray) -> None:
        self._check_equal(size_a, size_b)
        for size in size_a:
            fits = (_is_cube(size) if self._cubes
                    else np.allclose(size, self._size, rtol=SAME_SIZE, atol=0.0))
            if not fits:
                known = 'cubes' if self._cubes else _text(self._size)
                raise ValueError(
                    f'the weights {self.weights.path.name} of model {self.model!r} are for {known},'
                    f" not for size {_text(size)}; any size works with model 'exact'")

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return the contacts of poses (n, 7), sizes (n or 1, 3), and the first refused row or −1.

        One thread solves all rows, whatever `threads` is. Raises ValueError for other sizes.
        """
        self._check_sizes(size_a, size_b)
        *found, refused = _networks.solve(a, b, size_a, size_b, self._packed, self._widths,
                                          self._cubes, self.fold_to)
        return without_patch(*found), refused


class PaperContinuous(Paper):
    """One network for each subset on which the map is continuous; cubes only."""

    model = 'paper-continuous'
    experts = ('vertex_face', 'edge_edge')  # in the order of symmetry.VERTEX_FACE, EDGE_EDGE
    fold_to = FEATURES

    def _check_sizes(self, size_a: np.ndarray, size_b: np.ndarray) -> None:
        if not self._cubes:
            raise WeightsError(f'model {self.model!r} needs weights for cubes')
        super()._check_sizes(size_a, size_b)


def _text(size: np.ndarray) -> str:
    return ' × '.join(f'{extent:g}' for extent in size) + ' m'
