"""Successive halving: train thousands of networks a little, keep the best, train those longer.

All candidates start in the first rung. After every rung the better part goes on, with the weights
that it has, to a rung of more effort (Jamieson and Talwalkar 2016); in each rung the learning rate
falls to zero, so that what is compared are finished trainings. Candidates are trained in groups of
like cost, each group one batch of matrices.

The state is in one checkpoint file (`safetensors`: networks, and a JSON text with the errors), and
holds no random numbers: candidates, weights to start from and the order of the data each have a
stream of their own, given by the seed, the rung and the candidate or group. So a search that was
stopped ends as if it had not been.
"""
from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from ..mlp_fit import Layers

SAVE_EVERY = 10.0
"""Least time between two checkpoints [s]."""

Scores = dict[str, float]
"""What is known of a network after a rung; 'error' is what candidates are ranked by."""


@dataclass(frozen=True)
class Candidate:
    """Settings of one training."""

    number: int
    hidden: tuple[int, ...]
    rate: float
    momentum: float = 0.0
    initial: float = 1.0
    shipped: bool = False
    """The settings in use: it goes on to the end, to be compared with."""


@dataclass(frozen=True)
class Rung:
    """A stage: how many candidates are in it, and how long each is trained."""

    candidates: int
    effort: int
    """Steps, or epochs."""
    batch: int
    group: int
    """Candidates that are trained at once."""


class Search(Protocol):
    """What is searched for."""

    name: str
    seed: int
    rungs: Sequence[Rung]

    def candidates(self) -> list[Candidate]:
        """All of the first rung."""

    def cost(self, candidate: Candidate) -> int:
        """Multiply-adds of its network."""

    def start(self, candidate: Candidate) -> Layers:
        """Its network before training."""

    def train(self, number: int, group: Sequence[Candidate], start: Sequence[Layers],
              seed: Sequence[int]) -> tuple[list[Layers], list[Scores]]:
        """Train a group in rung `number`."""

    def keep(self, ranked: Sequence[Candidate], count: int) -> list[Candidate]:
        """Those that go on, of candidates in the order of their errors."""


class CheckpointError(ValueError):
    """A checkpoint that belongs to another search, or cannot be read."""


@dataclass
class Progress:
    """What has been done so far."""

    scores: list[dict[int, Scores]]
    """Per rung, by candidate."""
    networks: list[dict[int, Layers]]
    """Per rung, by candidate; of the rungs before the last but one, none."""


def in_groups(candidates: Sequence[Candidate], search: Search, size: int) -> list[list[Candidate]]:
    """Candidates of like cost together, so that little is padded."""
    ordered = sorted(candidates, key=lambda one: (search.cost(one), one.number))
    return [list(ordered[k:k + size]) for k in range(0, len(ordered), size)]


def run(search: Search, checkpoint: Path, *, progress: bool = True) -> Progress:
    """Go through all rungs, from where the checkpoint stands; the caller is to remove it."""
    from tqdm import tqdm

    done = _read(checkpoint, search) or Progress([{}], [{}])
    saved = time.monotonic()
    alive = search.candidates()
    work = sum(rung.candidates * rung.effort * rung.batch for rung in search.rungs)
    with tqdm(total=work, desc=search.name, mininterval=1.0, disable=not progress,
              bar_format='{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}{postfix}') as bar:
        for number, rung in enumerate(search.rungs):
            if number == len(done.scores):
                done.scores.append({})
                done.networks.append({})
                done.networks[:-2] = [{}] * (number - 1)
            for place, group in enumerate(in_groups(alive, search, rung.group)):
                step = len(group) * rung.effort * rung.batch
                bar.set_postfix(rung=f'{number + 1}/{len(search.rungs)}', refresh=False)
                if group[0].number in done.scores[number]:
                    bar.update(step)
                    if progress:  # what was done before tells nothing of the speed
                        bar.initial += step
                    continue
                before = ([search.start(one) for one in group] if number == 0 else
                          [done.networks[number - 1][one.number] for one in group])
                networks, scores = search.train(number, group, before,
                                                [search.seed, number, place])
                for one, network, score in zip(group, networks, scores):
                    done.networks[number][one.number] = network
                    done.scores[number][one.number] = score
                bar.update(step)
                if time.monotonic() - saved > SAVE_EVERY:
                    _write(checkpoint, search, done)
                    saved = time.monotonic()
            ranked = ranking(alive, done.scores[number])
            if number + 1 < len(search.rungs):
                count = search.rungs[number + 1].candidates
                shipped = [one for one in ranked if one.shipped]
                others = [one for one in ranked if not one.shipped]
                alive = shipped + search.keep(others, count - len(shipped))
    _write(checkpoint, search, done)
    return done


def ranking(candidates: Sequence[Candidate], scores: Mapping[int, Scores]) -> list[Candidate]:
    """In the order of their errors; networks that diverged come last."""
    return sorted(candidates, key=lambda one: (not np.isfinite(scores[one.number]['error']),
                                               scores[one.number]['error'], one.number))


def _key(search: Search) -> dict[str, Any]:
    return json.loads(json.dumps({
        'search': search.name, 'seed': search.seed,
        'rungs': [asdict(rung) for rung in search.rungs]}))


def _write(path: Path, search: Search, done: Progress) -> None:
    tensors = {f'{rung}.{number}.{layer}.{what}': array
               for rung, networks in enumerate(done.networks)
               for number, network in networks.items()
               for layer, pair in enumerate(network)
               for what, array in zip(('weight', 'bias'), pair)}
    text = json.dumps({'key': _key(search), 'scores': done.scores})
    # Not over the old one: whoever is killed while writing keeps that.
    beside = path.with_name(path.name + '.new')
    beside.write_bytes(save(tensors, metadata={'search': text}))
    os.replace(beside, path)


def _read(path: Path, search: Search) -> Progress | None:
    if not path.exists():
        return None
    try:
        with safe_open(path, framework='numpy') as file:
            state = json.loads((file.metadata() or {})['search'])
            found = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if state['key'] != _key(search):
            raise CheckpointError(f'{path} is of a search with other options: remove it, or '
                                  f'give the same ones')
    except (SafetensorError, OSError, KeyError, TypeError, json.JSONDecodeError) as error:
        raise CheckpointError(f'{path} cannot be read, remove it: {error}') from error
    scores = [{int(number): score for number, score in rung.items()} for rung in state['scores']]
    networks: list[dict[int, Layers]] = [{} for _ in scores]
    for name, array in found.items():
        rung, number, layer, what = name.split('.')
        layers = networks[int(rung)].setdefault(int(number), [])
        while len(layers) <= int(layer):
            layers.append((np.empty(0), np.empty(0)))
        weight, bias = layers[int(layer)]
        layers[int(layer)] = (array, bias) if what == 'weight' else (weight, array)
    return Progress(scores, networks)
