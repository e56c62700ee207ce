# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The committee of the paper's section 7 as a model for cubes: `ContactSolver(…, committee())`.

There is an expert 6-20-18-4 for each kind of contact. A classifier 6-20-18-3 has learnt to tell the
kinds apart, and weights the experts' answers. Model `paper` is the package's own.
"""
from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros.models.weights_file import load_weights
from box_contact_ros.resources import resource_path

from .numpy_model import (
    OUTPUTS,
    NumpyPaper,
    TouchingPairs,
    directions,
    forward,
    network_inputs,
    octant_signs,
)

EXPERTS = ('vertex', 'edge', 'face')  # of the committee, in the order of the classifier's outputs


def weights_path(name: str) -> Path:
    """Return the weights file of this name: the package's, or one that only the tables need."""
    here = Path(__file__).parent / 'weights' / f'{name}.safetensors'
    return here if here.exists() else resource_path('weights', here.name)


class Folds(NamedTuple):
    """n pairs, folded by the boxes' symmetries as model `paper` folds them: t' = M t, R' = M R N.

    M and N are diagonal, of signs; t' ≥ 0, and roll, pitch and yaw of R' are in [−π/2, π/2].
    """

    signs: np.ndarray  # (n, 3) diagonal of M
    inputs: np.ndarray  # (n, 6) of a network: t', and roll, pitch and yaw of R'

    def folded(self, vectors: np.ndarray) -> np.ndarray:
        """Return points or directions (n, 3) of the first box's frame, folded; or unfolded."""
        return self.signs * vectors


def to_octant(offset: np.ndarray, rotation: np.ndarray) -> Folds:
    """Fold n boxes of any shape, at offsets t (n, 3), turned by R (n, 3, 3)."""
    m, n = octant_signs(offset, rotation)
    return Folds(m, network_inputs(m * offset, m[:, :, None] * rotation * n[:, None]))


class Committee(NumpyPaper):
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
        return (fold.folded(np.where(alone[:, None], likeliest[:, 0], point)),
                fold.folded(np.where(alone[:, None], likeliest[:, 1], normal)))


def committee() -> Committee:
    """Return model `paper-committee` with the weights of the checkout."""
    return Committee(load_weights(weights_path('paper-committee')))
