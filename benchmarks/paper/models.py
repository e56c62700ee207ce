# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The paper's other networks as models for cubes: `ContactSolver(…, model=continuous())`.

- `paper-continuous`: one network 6-20-17-4 for each subset without discontinuities. The features
  that meet, by SAT, choose the network.
- `paper-committee`: section 7. An expert 6-20-18-4 for each kind of contact, and a classifier
  6-20-18-3, which has learnt to tell the kinds apart and weights the experts' answers.

Model `paper` is the package's own.
"""
from __future__ import annotations

from pathlib import Path

import numpy as np

from box_contact_ros.resources import resource_path
from box_contact_ros.solver.paper import (
    OUTPUTS,
    Paper,
    TouchingPairs,
    directions,
    forward,
)
from box_contact_ros.solver.weights_file import load_weights

from .features import EDGE_EDGE, VERTEX_FACE, to_features, to_octant

EXPERTS = ('vertex', 'edge', 'face')  # of the committee, in the order of the classifier's outputs
SUBSETS = {'vertex_face': VERTEX_FACE, 'edge_edge': EDGE_EDGE}


def weights_path(name: str) -> Path:
    """Return the weights file of this name: the package's, or one that only the tables need."""
    here = Path(__file__).parent / 'weights' / f'{name}.safetensors'
    return here if here.exists() else resource_path('weights', here.name)


class Continuous(Paper):
    """One network for each subset without discontinuities."""

    name = 'paper-continuous'
    networks = dict.fromkeys(SUBSETS, OUTPUTS)

    def answer(self, pairs: TouchingPairs) -> tuple[np.ndarray, np.ndarray]:
        """Return directions (n, 3) to the impact point and of the normal, first box's frame."""
        fold, subset = to_features(pairs)
        point, normal = np.empty((2, len(subset), 3))
        for network, number in SUBSETS.items():
            rows = subset == number
            point[rows], normal[rows] = directions(
                forward(self._networks[network], fold.inputs[rows]))
        return fold.unfolded(point), fold.unfolded(normal)


class Committee(Paper):
    """The weighted mean of the experts' directions.

    A weight is what the classifier says of the expert's class, 0 where negative. The likeliest
    expert answers alone where no other has a weight, or where the normals cancel.
    """

    name = 'paper-committee'
    networks = {'classifier': len(EXPERTS), **dict.fromkeys(EXPERTS, OUTPUTS)}

    def answer(self, pairs: TouchingPairs) -> tuple[np.ndarray, np.ndarray]:
        """Return directions (n, 3) to the impact point and of the normal, first box's frame."""
        fold = to_octant(pairs.offset, pairs.rotation)
        classes = forward(self._networks['classifier'], fold.inputs).astype(np.float64)
        said = np.array([directions(forward(self._networks[name], fold.inputs))
                         for name in EXPERTS])  # (experts, 2, n, 3)
        point, normal = np.einsum('nk,kvni->vni', np.maximum(classes, 0.0), said)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        with np.errstate(invalid='ignore'):
            normal = normal / length
        alone = (length[:, 0] == 0.0) | ~point.any(axis=1)
        likeliest = said[classes.argmax(axis=1), :, np.arange(len(classes))]
        return (fold.unfolded(np.where(alone[:, None], likeliest[:, 0], point)),
                fold.unfolded(np.where(alone[:, None], likeliest[:, 1], normal)))


def continuous() -> Continuous:
    """Return model `paper-continuous` with the weights of the checkout."""
    return Continuous(load_weights(weights_path('paper-continuous')))


def committee() -> Committee:
    """Return model `paper-committee` with the weights of the checkout."""
    return Committee(load_weights(weights_path('paper-committee')))
