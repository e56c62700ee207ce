# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contestants on sets of poses: their answers against the exact ones, and their times in turn."""
from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from box_contact_ros.core import native

from .accuracy import Summary, by_part, classify
from .contestant import Contestant, chosen
from .errors import degrees_between, point_errors
from .output import percentiles
from .pose_sets import Generator, Pairs, drawn
from .timing import after_warm_up, each_call, take_turns

FEW_PAIRS = 17
"""Pairs that are prepared at once where more pairs of sizes than that are among them. Odd, so that
a median is the time of one pair, not between two that may differ tenfold."""
LONGEST_RUN = 3600.0  # of a subprocess with one instruction set [s]
VERDICT = 1e-9
"""Least gap or depth, of the size, at which verdicts and normals are judged. At exact touch both
verdicts are right, and a normal may be any that keeps the boxes apart."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How much is judged and timed."""

    batch_pairs: int  # pairs on which models with batches are judged and timed
    single_pairs: int  # pairs on which the others are judged
    timed_pairs: int
    """Pairs that every round times call by call, whatever they take. Some cost fifty times as much
    as others, so the median of a round that ends by the clock depends on how many it reached."""
    rounds: int
    round_seconds: float  # least time of a round's single calls; a round ends with its last pair


FULL = Plan(batch_pairs=20_000, single_pairs=1_000, timed_pairs=200, rounds=20,
            round_seconds=0.025)
QUICK = Plan(batch_pairs=1_000, single_pairs=40, timed_pairs=10, rounds=2, round_seconds=0.001)


@dataclass(frozen=True, kw_only=True)
class SetErrors:
    """Answers on a set against the exact ones, with one way to make a point."""

    points: Mapping[str, Summary]  # point errors by part; empty where no pair touches by both
    normal: tuple[float, float]  # p99 and worst of the normal's error [deg]; NaN: none was judged
    missed: int
    invented: int


@dataclass(frozen=True, kw_only=True)
class Answers:
    """What a contestant answers on the first n pairs of a set."""

    colliding: np.ndarray  # (n,)
    normals: np.ndarray  # (n, 3)
    points: dict[str, np.ndarray]  # (n, 3), by choice


@dataclass(frozen=True, kw_only=True)
class FrontierRow:
    """One contestant on one set with one instruction set. NaN: not measured."""

    name: str
    set: str
    instruction_set: str
    judged: int
    calls: int
    single: tuple[float, ...]  # p50, p99, max of a call [ns]
    batch: float  # p50 of a pair in a batch [ns]
    rounds: np.ndarray  # (rounds, 2): the median single call, and a pair in a batch [ns]
    choices: dict[str, SetErrors]  # by the way in which a point was made

    @property
    def best(self) -> str:
        """Return the choice with the least p99 of the point error."""
        return min(self.choices, key=lambda choice: self.choices[choice].points['all'].p99
                   if self.choices[choice].points else math.inf)

    @property
    def errors(self) -> SetErrors:
        """Return the errors of the best choice."""
        return self.choices[self.best]


def judge(pairs: Pairs, colliding: np.ndarray, normals: np.ndarray, points: np.ndarray,
          ) -> SetErrors:
    """Compare answers (n,), (n, 3), (n, 3) with the exact ones."""
    truth = pairs.contacts()
    both = colliding & truth.colliding
    touching = pairs.rows(both)
    errors = point_errors(points[both], truth.point[both], touching.edge)
    clear = np.abs(truth.separation) > VERDICT * pairs.size
    rows = np.flatnonzero(both & clear & np.isfinite(normals).all(axis=1))
    angles = degrees_between(normals[rows], truth.normal[rows])
    return SetErrors(points=by_part(errors, classify(touching)),
                     normal=percentiles(angles, 99, 100),
                     missed=int((truth.colliding & ~colliding & clear).sum()),
                     invented=int((colliding & ~truth.colliding & clear).sum()))


def ask(engine: Contestant, pairs: Pairs, plan: Plan) -> Answers:
    """Return answers to the plan's number of pairs."""
    if engine.solve and engine.prepare_batch:
        contacts = engine.solve(pairs)
        return Answers(colliding=contacts.colliding, normals=contacts.normal,
                       points={engine.choices[0]: contacts.point})
    pairs = pairs.rows(slice(plan.single_pairs))
    asked, step = [], _at_once(pairs)
    for first in range(0, len(pairs.size), step):
        for call in engine.prepare(pairs.rows(slice(first, first + step))):
            answer = engine.read(call())
            asked.append([chosen(answer, choice) for choice in engine.choices])
    return Answers(
        colliding=np.array([answers[0].touching for answers in asked]),
        normals=np.array([answers[0].normal for answers in asked]),
        points={choice: np.array([answers[k].point for answers in asked])
                for k, choice in enumerate(engine.choices)})


def _at_once(pairs: Pairs) -> int:
    """Return how many pairs are prepared together: all, or FEW_PAIRS if they have more sizes."""
    sizes = np.unique(np.hstack([pairs.size_a, pairs.size_b]), axis=0)
    return FEW_PAIRS if len(sizes) > FEW_PAIRS else len(pairs.size)


def answers_of(engine: Contestant, sets: Mapping[str, Pairs], plan: Plan) -> dict[str, Answers]:
    """Return answers by set; sets with boxes not for the contestant are left out."""
    answers = {}
    for name, pairs in sets.items():
        try:
            answers[name] = ask(engine, pairs, plan)
        except ValueError:
            if engine.any_boxes:
                raise
    return answers


class Trial:
    """A contestant on a set: its answers, and its times, gathered in rounds."""

    def __init__(self, engine: Contestant, name: str, pairs: Pairs, answers: Answers,
                 plan: Plan) -> None:
        """Prepare the calls."""
        self.name, self.set = engine.name, name
        self._pairs, self._answers = pairs, answers
        self._seconds = plan.round_seconds
        timed = pairs.rows(slice(plan.timed_pairs))
        self._calls = engine.prepare(timed.rows(slice(_at_once(timed))))
        self._batch = engine.prepare_batch(pairs) if engine.prepare_batch else None
        for call in self._calls:  # what is made at a pair's first call is not timed
            call()
        self._singles: list[np.ndarray] = []
        self._batches: list[float] = []

    def time(self) -> None:
        """Time one round, after a warm-up: all single calls, again and again, then a batch."""
        self._singles.append(np.array(each_call(self._calls, self._seconds), np.int64))
        # Neighbours may interrupt a batch: the processor's clock stands meanwhile.
        self._batches.append(math.nan if self._batch is None else after_warm_up(
            self._batch, len(self._pairs.size), time.process_time_ns))

    def row(self) -> FrontierRow:
        """Return the errors and times."""
        answers, singles = self._answers, np.concatenate(self._singles)
        first = self._pairs.rows(slice(len(answers.colliding)))
        return FrontierRow(
            name=self.name, set=self.set, instruction_set=native.instruction_set,
            judged=len(answers.colliding), calls=len(singles),
            single=percentiles(singles, 50, 99, 100),
            batch=float(np.median(self._batches)), rounds=np.column_stack([
                [percentiles(times, 50)[0] for times in self._singles], self._batches]),
            choices={choice: judge(first, answers.colliding, answers.normals, points)
                     for choice, points in answers.points.items()})


def measure_all(engines: Sequence[Contestant], generators: Mapping[str, Generator], *, seed: int,
                plan: Plan) -> list[FrontierRow]:
    """Return all rows, set by set. All contestants on all sets take turns.

    A neighbour that slows the machine for seconds then slows few rounds of a set, not all of them.
    """
    from tqdm import tqdm

    sets = {name: drawn(make, np.random.default_rng([seed, place]), plan.batch_pairs)
            for place, (name, make) in enumerate(generators.items())}
    answers = [answers_of(engine, sets, plan)
               for engine in tqdm(engines, desc='answers', unit='contestant')]
    trials = [Trial(engine, name, pairs, given[name], plan) for name, pairs in sets.items()
              for engine, given in zip(engines, answers) if name in given]
    with tqdm(total=len(trials) * plan.rounds, desc='times', unit='round') as bar:
        take_turns([trial.time for trial in trials], plan.rounds, bar.update)
    return [trial.row() for trial in trials]
