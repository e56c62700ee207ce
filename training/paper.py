# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Train the paper's network 6-20-18-4 for the scene that is asked.

The paper draws boxes that just touch, at any angle to ±90°. A scene asks for other pairs. Here the
8,000 patterns are contacts of the scene, folded by the symmetries as model `paper` folds them
(benchmarks/paper/numpy_model.py).
"""
from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import settled
from benchmarks.errors import point_errors
from benchmarks.mlp_samples import nearly_settled
from benchmarks.output import percentiles
from benchmarks.paper.dataset import INPUTS, OUTPUTS, PAPER_COUNTS, SETS, Patterns, spherical
from benchmarks.paper.fit import PaperSettings, fit
from benchmarks.paper.jobs import SHIPPED
from benchmarks.paper.numpy_model import network_inputs, octant_signs, touching_pairs, turned
from benchmarks.pose_sets import LOADS, Generator, Pairs, drawn
from benchmarks.pose_sets import SETS as POSE_SETS
from benchmarks.weights import save_weights
from box_contact_ros.models.make_model import make_model
from box_contact_ros.models.networks import is_cube
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.pose import rotation_matrix


def cubes_nearly_settled(rng: np.random.Generator, n: int) -> Pairs:
    """Draw cubes on each other: recorded ones, each turned and moved by up to a thousandth."""
    pairs = settled.touching(learnt=True)
    pairs = nearly_settled(rng, 2 * n, pairs.rows(settled.cubes(pairs)))
    return pairs.rows(pairs.contacts().colliding).rows(slice(n))


SCENES: dict[str, Generator] = {**POSE_SETS, **LOADS, 'cubes at rest': cubes_nearly_settled}
SETTINGS = PaperSettings((6, 20, 18, 4), networks=16, epochs=500, rate=0.1, initial=0.7)
METRIC_PAIRS = 20_000


def scene_patterns(pairs: Pairs) -> Patterns:
    """Return the patterns of pairs of two equal boxes, as model `paper` asks for them."""
    exact = pairs.contacts()
    first, touch = touching_pairs(pairs.pose_a, pairs.pose_b, exact)
    # The exact centroid in the first box's frame, half the depth farther: boxes are moved apart.
    to_first = rotation_matrix(first[:, 3:]).swapaxes(1, 2)
    point = (turned(to_first, exact.point - first[:, :3])
             - 0.5 * exact.separation[:, None] * touch.normal)
    unit = 0.5 * pairs.size_a[:, :1] if is_cube(pairs.size_a[0]) else 1.0
    m, n = octant_signs(touch.offset, touch.rotation)
    inputs = network_inputs(m * touch.offset / unit,
                            m[:, :, None] * touch.rotation * n[:, None])
    return Patterns(inputs, np.concatenate(
        [spherical(m * point), spherical(m * touch.normal)], axis=1))


def train(folder: Path, scene: str, *, seed: int, commit: str,
          counts: tuple[int, ...] = PAPER_COUNTS, networks: int = 0, epochs: int = 0,
          ) -> dict[str, Any]:
    """Train the network for a scene of two equal boxes, and write it; return its model card.

    networks, epochs: instead of those of `SETTINGS`. Raises ValueError for a scene of other boxes,
    and where the file would replace the paper's own network.
    """
    settings = replace(SETTINGS, networks=networks or SETTINGS.networks,
                       epochs=epochs or SETTINGS.epochs, seed=seed)
    streams = [drawn(SCENES[scene], np.random.default_rng([seed, number]), count)
               for number, count in enumerate(counts)]
    sizes = np.concatenate([pairs.size_a for pairs in streams]
                           + [pairs.size_b for pairs in streams])
    if np.ptp(sizes, axis=0).any():
        raise ValueError(f'scene {scene!r} has boxes of several sizes; the network is for two '
                         'equal ones')
    size = '' if is_cube(sizes[0]) else '-' + 'x'.join(f'{extent:g}' for extent in sizes[0])
    path = folder / f'paper{size}.safetensors'
    if path == SHIPPED / 'paper.safetensors':
        raise ValueError(f'scene {scene!r} has cubes, but {path} is for the poses of the paper: '
                         'name another folder by --out')
    sets = dict(zip(SETS, (scene_patterns(pairs) for pairs in streams)))
    fitted = fit(sets['training'], sets['cross-validation'], settings, progress=scene)
    card: dict[str, Any] = {
        'name': path.stem, 'model': 'paper', 'architecture': {'contact': list(settings.widths)},
        'sizes': [sizes[0].tolist()] * 2, 'seed': seed, 'commit': commit, 'metrics': {},
        'data': {'scene': scene, 'recipe': SCENES[scene].__doc__,
                 'counts': dict(zip(SETS, counts))},
        'inputs': {'names': INPUTS}, 'outputs': OUTPUTS,
        'training': {'algorithm': 'backpropagation with momentum, stopped by cross-validation',
                     'starts': settings.networks, 'epochs': settings.epochs,
                     'rate': settings.rate, 'momentum': settings.momentum}}
    layers = {'contact': fitted.export()}
    save_weights(path, layers, card)
    # What is measured is what was written.
    pairs = streams[-1].rows(slice(METRIC_PAIRS))
    solver = ContactSolver(sizes[0], sizes[0], model=make_model('paper', weights=path))
    errors = point_errors(pairs.contacts(solver).point, pairs.contacts().point, pairs.edge)
    card['metrics'] = dict(zip(('p50', 'p99'), percentiles(errors, 50, 99)))
    save_weights(path, layers, card)
    return card
