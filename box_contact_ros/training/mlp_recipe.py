"""Train the network of model `mlp`, for all boxes or for the boxes of one scene.

The general network learns from `contacts.mixture` and serves any two boxes. A scene's network
starts from the general one and goes on with the scene's own pairs of sizes only. The solver then
asks it for these sizes alone, and answers others exactly (box_contact_ros/solver/mlp.py).
"""
from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from inspect import getdoc
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ..core import ASPECT_MAX, DEPTH_MAX, FEATURES, OUTPUTS, SIZE_RATIO_MAX
from ..resources import resource_path
from ..scene.pose_sets import SETS, Pairs
from ..solver.contact_solver import ContactSolver
from ..solver.mlp import ACTIVATION, DESCRIPTION, FEATURE_NAMES
from ..solver.weights_file import load_weights, save_weights, unpacked
from .mlp_fit import Fit, Settings, normalisation, unfolded
from .samples import MlpSamples, SizePair, draw_samples, mixture, scene_mixture

HIDDEN = (12,)
"""Hidden units: what fits the time that a batch has for the network (docs/search.md)."""
PAIRS, STEPS, BATCH, RATE = 1_500_000, 60_000, 4096, 2e-2
HARD_ROUNDS, HARD_POOL, HARD_PART, HARD_SHARE = (0.4, 0.55, 0.7, 0.85), 2_000_000, 0.01, 0.2
"""After each of these parts of the steps, a pool of fresh pairs is searched for the hardest part,
and from then on all that were found so far make up that share of what is learned from."""
SCENE_PAIRS, SCENE_STEPS, SCENE_RATE = 1_000_000, 25_000, 3e-3
QUICK_PAIRS, QUICK_STEPS = 20_000, 400
METRIC_PAIRS, QUICK_METRIC_PAIRS = 100_000, 2_000
"""Pairs of each set in the model card's metrics."""

# Streams of random numbers, one each for the data, and for what is measured on.
_DATA, _METRICS, _HARD = 0, 1, 2


def point_errors(pairs: Pairs, weights: Path | str | None) -> np.ndarray:
    """Return point errors (n,) of `mlp` against `exact` [longest edge of the smaller box]."""
    found = []
    for model, file in (('exact', None), ('mlp', weights)):
        solver = ContactSolver((1, 1, 1), (1, 1, 1), model=model, weights=file and str(file))
        found.append(solver.batch(pairs.pose_a, pairs.pose_b, size_a=pairs.size_a,
                                  size_b=pairs.size_b).point)
    edge = np.minimum(pairs.size_a.max(axis=1), pairs.size_b.max(axis=1))
    return np.linalg.norm(found[0] - found[1], axis=1) / edge


def figures(errors: np.ndarray) -> dict[str, float]:
    """Return mean, 99th percentile and worst, in per cent."""
    return {'mean': 100.0 * float(errors.mean()), 'p99': 100.0 * float(np.quantile(errors, 0.99)),
            'worst': 100.0 * float(errors.max())}


def train(path: Path, *, seed: int, commit: str, quick: bool = False,
          hidden: tuple[int, ...] = HIDDEN, steps: int | None = None, device: str = 'cpu',
          progress: bool = True) -> dict[str, Any]:
    """Train the general network and write it to `path`; returns its model card."""
    began = time.monotonic()
    pairs, steps = (QUICK_PAIRS, steps or QUICK_STEPS) if quick else (PAIRS, steps or STEPS)
    data = draw_samples(mixture, [seed, _DATA], pairs, progress)
    fit = Fit(data, Settings(hidden=[hidden], steps=steps, batch=BATCH, rate=RATE, seed=seed,
                             device=device))
    _run(fit, data, path.stem, progress, [seed, _HARD], QUICK_PAIRS if quick else HARD_POOL,
         mixture)
    card = _card(path, hidden, seed, commit, [], fit, {'recipe': getdoc(mixture)})
    card['training']['minutes'] = round((time.monotonic() - began) / 60.0, 2)
    layers = {'point': fit.export(0)}
    save_weights(path, layers, card)
    # What is measured is what was written.
    for number, (name, make) in enumerate(SETS.items()):
        sample = make(np.random.default_rng([seed, _METRICS, number]),
                      QUICK_METRIC_PAIRS if quick else METRIC_PAIRS)
        card['metrics'][name] = figures(point_errors(sample, path))
    save_weights(path, layers, card)
    return card


def train_scene(path: Path, sizes: Sequence[SizePair], *, seed: int, commit: str,
                quick: bool = False, device: str = 'cpu', progress: bool = True) -> dict[str, Any]:
    """Go on from the general network with pairs of these sizes; returns the model card.

    Its metrics hold, for each pair of sizes, the error with the general network ('before') and
    with this one ('after'), on pairs that it was not trained on.
    """
    began = time.monotonic()
    general = resource_path('weights', 'mlp.safetensors')
    weights = load_weights(general)
    start = weights.networks['point']
    hidden = start.widths[1:-1]
    pairs, steps = (QUICK_PAIRS, QUICK_STEPS) if quick else (SCENE_PAIRS, SCENE_STEPS)
    data = draw_samples(scene_mixture, [seed, _DATA], pairs, progress, sizes)
    fit = Fit(data, Settings(hidden=[hidden], steps=steps, batch=BATCH, rate=SCENE_RATE, seed=seed,
                             device=device),
              start=[unfolded(unpacked(start), *normalisation(data.features))])
    _run(fit, data, path.stem, progress, [seed, _HARD], QUICK_PAIRS if quick else HARD_POOL // 2,
         scene_mixture, sizes)
    card = _card(path, hidden, seed, commit, [[list(a), list(b)] for a, b in sizes], fit,
                 {'recipe': getdoc(scene_mixture), 'started from': weights.card['sha256']})
    card['training']['minutes'] = round((time.monotonic() - began) / 60.0, 2)
    layers = {'point': fit.export(0)}
    save_weights(path, layers, card)
    for number, pair in enumerate(sizes):
        sample = scene_mixture(np.random.default_rng([seed, _METRICS, number]),
                               QUICK_METRIC_PAIRS if quick else METRIC_PAIRS, [pair])
        card['metrics'][text(pair)] = {'before': figures(point_errors(sample, general)),
                                       'after': figures(point_errors(sample, path))}
    save_weights(path, layers, card)
    return card


def _run(fit: Fit, data: MlpSamples, title: str, progress: bool, seed: Sequence[int], pool: int,
         make: Callable[..., Pairs], *rest: object) -> None:
    """Train to the end, with a progress bar, and harder data from time to time."""
    from tqdm import tqdm

    steps = fit.settings.steps
    chunk = max(1, steps // 200)
    hard: list[MlpSamples] = []
    with tqdm(total=steps, desc=title, unit='step', mininterval=1.0, disable=not progress) as bar:
        while fit.step < steps:
            if len(hard) < len(HARD_ROUNDS) and fit.step >= HARD_ROUNDS[len(hard)] * steps:
                fresh = draw_samples(make, [*seed, len(hard)], pool, False, *rest)
                hard.append(_hardest(fit, fresh, HARD_PART))
                found = MlpSamples.joined(hard)
                times = HARD_SHARE / (1.0 - HARD_SHARE) * len(data) / len(found)
                fit.feed(MlpSamples.joined([data, *[found] * max(1, round(times))]))
            before = fit.step
            loss = fit.run(chunk)
            bar.set_postfix(loss=f'{loss.min():.2e}', refresh=False)
            bar.update(fit.step - before)


def _hardest(fit: Fit, data: MlpSamples, part: float) -> MlpSamples:
    """Return the part of the samples in which the network errs most."""
    errors = fit.point_errors(data)[0]
    count = max(1, round(part * len(errors)))
    return data.rows(np.sort(np.argsort(errors, kind='stable')[-count:]))


def _card(path: Path, hidden: tuple[int, ...], seed: int, commit: str, sizes: list[Any],
          fit: Fit, data: dict[str, Any]) -> dict[str, Any]:
    s = fit.settings
    return {
        'name': path.stem, 'model': 'mlp', 'architecture': [FEATURES, *hidden, OUTPUTS],
        'activation': ACTIVATION, 'seed': seed, 'commit': commit, 'sizes': sizes,
        'inputs': {'description': DESCRIPTION, 'names': FEATURE_NAMES,
                   'range': {'aspect': ASPECT_MAX, 'size ratio': SIZE_RATIO_MAX,
                             'depth by the shortest edge': DEPTH_MAX}},
        'outputs': ['of the push', 'of the pull along the faces', 'of what others pass on'],
        'data': {**data, 'pairs': len(fit.inputs)}, 'metrics': {},
        'training': {'algorithm': 'Adam', 'steps': s.steps, 'batch': s.batch, 'rate': s.rate,
                     'device': s.device, 'threads': torch.get_num_threads()}}


def in_range(pair: SizePair) -> bool:
    """Whether the MLP may be asked for boxes of these sizes at all."""
    longest, shortest = [max(size) for size in pair], [min(size) for size in pair]
    return (all(one <= ASPECT_MAX * other for one, other in zip(longest, shortest))
            and max(longest) <= SIZE_RATIO_MAX * min(longest))


def text(pair: SizePair) -> str:
    """A pair of sizes, as it is printed."""
    return ' on '.join(' × '.join(f'{extent:g}' for extent in size) for size in pair)


def _shown(f: dict[str, float]) -> str:
    return f'{f["mean"]:.3f} / {f["p99"]:.2f} / {f["worst"]:.1f}'


def table(card: dict[str, Any]) -> str:
    """The card's metrics, for the terminal."""
    head = "point error against exact, % of the smaller box's longest edge: mean / p99 / worst"
    lines = [f'  {head}']
    width = max(map(len, card['metrics']))
    for name, entry in card['metrics'].items():
        if 'before' not in entry:
            lines.append(f'  {name:<{width}}  {_shown(entry)}')
            continue
        before, after = entry['before'], entry['after']
        saved = ' / '.join(f'{100.0 * (1.0 - after[key] / before[key]):.0f} %'
                           for key in ('mean', 'p99', 'worst'))
        lines.append(f'  {name:<{width}}  general {_shown(before)}, this {_shown(after)}: '
                     f'saved {saved}')
    return '\n'.join(lines)
