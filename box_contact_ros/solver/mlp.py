"""Model `mlp`: SAT decides and gives normal and depth; a network gives point, volume, covariance.

The algorithm is that of core/src/mlp.hpp. Here its weights are read and checked. Outside the range
that the network was trained for, the answer is the exact one, and counted. So it is for boxes that
the card of the weights does not list, if it lists any: those of a scene (`train --scene`).
"""
from __future__ import annotations

import numpy as np

from ..core import FEATURES, OUTPUTS, POINT_OUTPUTS, native
from .contact import Contacts
from .models import Exact
from .weights_file import Network, Weights, WeightsError, weights_for

FEATURE_NAMES = (
    'slant · cut', '|slant · push|', 'slant · push of these faces · of the others',
    'larger slant along another axis · cut',
    'cut of these faces', '|push of these faces|', 'their push · of the others along it',
    'cut of all faces',
    'slant · cut of all faces along this axis', '|push of all faces| along it',
    'larger slant · cut of all faces along another', '|push of all faces| along all axes')
"""Features at a site: four of its own, four that all sites of its faces have, four of its axis."""
DESCRIPTION = 'cuts of the bounds by the slab, at nine sites'
"""What the features of shipped weights mean; see core/src/overlap/bounds.hpp."""
BOUNDS = {DESCRIPTION: 'slab', 'cuts of the unit cube, at nine sites': 'edges'}
"""Method of the bounds by the description in a card; weights made for another one are refused.
Those for 'edges' give the point alone."""
_NATIVE = {'slab': 'mlp', 'edges': 'mlp-edges'}  # names that the core has for the models
ACTIVATION = 'relu'  # activation of the hidden units; weights made for another one are refused
UNITS_MAX = 64  # most hidden units: as far as the search for their number goes
SAME_EXTENT = 1e-6
"""Relative difference up to which an extent is a trained one: sizes may come through float32."""


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


class Mlp:
    """SAT and a network, for boxes of any sizes or for those that the weights' card lists.

    size_a, size_b: (1, 3) full extents of single calls [m]; weights: a file, or None for the
    shipped one. Raises `WeightsError` for a file that does not fit.
    """

    def __init__(self, size_a: np.ndarray, size_b: np.ndarray, weights: str | None = None) -> None:
        self.weights = load_mlp(weights)
        numbers = core_numbers(self.weights.networks['point'])
        name = _NATIVE[bounds_of(self.weights)]
        self._pairs = native.PairSolver(name, (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), numbers)
        self._exact = Exact()
        self._answered_exactly = 0
        self._listed = _listed_sizes(self.weights)
        self._looked_up = (b'', np.zeros(1, dtype=np.bool_))
        # Single calls have no test of the sizes, so one for boxes that are not listed ends here.
        listed = self._in_card(size_a, size_b).all()
        self.single = (name, numbers) if listed else (None, None)

    @property
    def exact_answers(self) -> int:
        """Contacts outside the trained range or sizes so far, which were answered exactly."""
        return self._answered_exactly + self._pairs.answered_exactly

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        listed = self._in_card(size_a, size_b)
        if listed.all():
            *found, refused = self._pairs.solve(a, b, size_a, size_b, threads)
            return Contacts(*found), refused
        answers, refused = self._exact.solve(a, b, size_a, size_b, threads)
        if refused >= 0:
            return answers, refused
        listed = np.broadcast_to(listed, len(a))
        self._answered_exactly += int(np.count_nonzero(answers.colliding & ~listed))
        rows = np.flatnonzero(listed)
        one, other = (size if len(size) == 1 else size[rows] for size in (size_a, size_b))
        *by_network, _ = self._pairs.solve(a[rows], b[rows], one, other, threads)
        for all_rows, some in zip(answers, by_network):
            all_rows[rows] = some
        return answers, refused

    def _in_card(self, size_a: np.ndarray, size_b: np.ndarray) -> np.ndarray:
        """(n or 1,) whether the card lists these sizes (n or 1, 3), or any.

        The order of the boxes does not matter, nor which of a box's axes is called x, y, z.
        """
        if self._listed is None:
            return np.ones(1, dtype=np.bool_)
        shared = len(size_a) == len(size_b) == 1  # mostly the solver's own: looked up once
        key = size_a.tobytes() + size_b.tobytes() if shared else b''
        if shared and key == self._looked_up[0]:
            return self._looked_up[1]
        sizes = np.sort(np.stack(np.broadcast_arrays(size_a, size_b), axis=1))
        listed = np.zeros(len(sizes), dtype=np.bool_)
        for pair in self._listed:
            for known in (pair, pair[::-1]):
                listed |= (abs(sizes - known) <= SAME_EXTENT * known).all(axis=(1, 2))
        if shared:
            self._looked_up = (key, listed)
        return listed


def load_mlp(weights: str | None = None) -> Weights:
    """Read the weights of an MLP, the shipped ones for None; raises `WeightsError`."""
    found = weights_for('mlp', weights, shipped='mlp')
    bounds = str(found.card['inputs'].get('description'))  # a card may say anything
    outputs = POINT_OUTPUTS if BOUNDS.get(bounds) == 'edges' else OUTPUTS
    network = found.network('point', FEATURES, outputs, model='mlp')
    if len(network.widths) != 3 or network.widths[1] > UNITS_MAX:
        raise WeightsError(f"weights file {found.path}: network 'point' must have one hidden "
                           f'layer, of at most {UNITS_MAX} units')
    if bounds not in BOUNDS:
        raise WeightsError(f'weights file {found.path} is for other inputs than this version has')
    if found.card.get('activation') != ACTIVATION:
        raise WeightsError(f"weights file {found.path}: this version's units are {ACTIVATION!r}, "
                           f"not {found.card.get('activation')!r}")
    return found


def bounds_of(weights: Weights) -> str:
    """Return the method of the bounds that the weights were made for: 'slab' or 'edges'."""
    return BOUNDS[weights.card['inputs']['description']]


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
