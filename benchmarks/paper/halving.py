# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Successive halving: train thousands of networks a little, keep the best, train those longer.

All candidates are in the first rung. After every rung the better part goes on to a rung of more
effort (Jamieson and Talwalkar 2016). In each rung a network starts anew and its learning rate falls
to zero, so finished trainings are compared. Candidates of like cost are trained as a group.

The checkpoint is a JSON file with the scores so far. It holds no random numbers: every group has a
stream of its own, given by seed, rung and group. So a search that was stopped ends as if it had
not been.
"""
from __future__ import annotations

import json
import math
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

SAVE_EVERY = 10.0  # least time between two checkpoints [s]

Scores = dict[str, float]
"""What is known of a network after a rung; 'error' is what candidates are ranked by."""
Rungs = list[dict[int, Scores]]  # for each rung, the scores by the candidates' numbers


@dataclass(frozen=True)
class Candidate:
    """Settings of one training."""

    number: int
    hidden: tuple[int, ...]
    rate: float
    momentum: float = 0.0
    initial: float = 1.0
    shipped: bool = False  # the settings in use: they go on to the end, to be compared with


@dataclass(frozen=True)
class Rung:
    """A stage: how many candidates are in it, and how long each is trained."""

    candidates: int
    effort: int  # steps, or epochs
    batch: int
    group: int  # candidates that are trained at once


class CheckpointError(ValueError):
    """A checkpoint that belongs to another search, or cannot be read."""


class Search(ABC):
    """What is searched for."""

    name: str
    seed: int
    rungs: Sequence[Rung]

    @abstractmethod
    def candidates(self) -> list[Candidate]:
        """Return all of the first rung."""

    @abstractmethod
    def cost(self, candidate: Candidate) -> int:
        """Return the multiply-adds of a candidate's network."""

    @abstractmethod
    def train(self, rung: Rung, group: Sequence[Candidate], seed: int) -> list[Scores]:
        """Train a group."""

    def groups(self, candidates: Sequence[Candidate], size: int) -> list[list[Candidate]]:
        """Return groups of like cost, so that little is padded."""
        ordered = sorted(candidates, key=lambda one: (self.cost(one), one.number))
        return [ordered[k:k + size] for k in range(0, len(ordered), size)]

    def run(self, checkpoint: Path) -> Rungs:
        """Go through all rungs, from where the checkpoint stands; the caller removes it."""
        done = self._read(checkpoint)
        alive = self.candidates()
        saved = time.monotonic()
        for number, rung in enumerate(self.rungs):
            if number:
                shipped = [one for one in alive if one.shipped]
                others = ranking([one for one in alive if not one.shipped], done[number - 1])
                alive = shipped + others[:rung.candidates - len(shipped)]
            if number == len(done):
                done.append({})
            for place, group in enumerate(tqdm(
                    self.groups(alive, rung.group), mininterval=1.0, unit='group',
                    desc=f'{self.name}, rung {number + 1} of {len(self.rungs)}')):
                if group[0].number in done[number]:
                    continue
                seed = np.random.SeedSequence([self.seed, number, place]).generate_state(1)[0]
                scores = self.train(rung, group, int(seed))
                done[number] |= {one.number: score for one, score in zip(group, scores)}
                if time.monotonic() - saved > SAVE_EVERY:
                    self._write(checkpoint, done)
                    saved = time.monotonic()
        self._write(checkpoint, done)
        return done

    def _key(self) -> dict[str, Any]:
        return {'search': self.name, 'seed': self.seed,
                'rungs': [asdict(rung) for rung in self.rungs]}

    def _write(self, path: Path, done: Rungs) -> None:
        # Not over the old one: whoever is killed while writing keeps that.
        beside = path.with_name(path.name + '.new')
        beside.write_text(json.dumps({'key': self._key(), 'scores': done}), 'utf-8')
        os.replace(beside, path)

    def _read(self, path: Path) -> Rungs:
        if not path.exists():
            return []
        try:
            state = json.loads(path.read_text('utf-8'))
            key, scores = state['key'], [{int(number): score for number, score in rung.items()}
                                         for rung in state['scores']]
        except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
            raise CheckpointError(f'{path} cannot be read, remove it: {error}') from error
        if key != self._key():
            raise CheckpointError(f'{path} is of a search with other options: remove it, or give '
                                  f'the same ones')
        return scores


def ranking(candidates: Sequence[Candidate], scores: Mapping[int, Scores]) -> list[Candidate]:
    """Return candidates in the order of their errors; networks that diverged come last."""
    def order(one: Candidate) -> tuple[bool, float, int]:
        error = scores[one.number]['error']
        return not math.isfinite(error), error, one.number

    return sorted(candidates, key=order)
