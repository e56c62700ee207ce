# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contestants on sets of poses: their answers against the exact ones, and their times."""
from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from box_contact_ros.core import native
from box_contact_ros.scene.pose import degrees_between

from .accuracy import CLASSES, classify
from .contestant import APART, Contestant, chosen, part_by_part
from .errors import point_errors
from .output import percentiles
from .pose_sets import (
    CONTAINER,
    SETS,
    Generator,
    Pairs,
    any_pose,
    at_depth,
    drawn,
    log_uniform,
    stacked,
)
from .timing import Timing, by_round, each_call, take_turns


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How much is judged and timed."""

    batch_pairs: int  # pairs on which models with batches are judged and timed
    single_pairs: int  # pairs on which the others are judged
    timed_pairs: int
    """Pairs that every round times call by call, whatever they take. Some cost fifty times as much
    as others, so the median of a round that ends by the clock depends on how many it reached."""
    seconds: float  # that a contestant has on a set to be judged
    rounds: int
    round_seconds: float
    """Least time of a round's single calls; a round ends with its last pair."""
    members: int  # models of a family, at most
    subprocesses: bool
    """Whether other engines are judged in subprocesses, so that an abort is a finding."""


FULL = Plan(batch_pairs=20_000, single_pairs=1_000, timed_pairs=200, seconds=1.0, rounds=20,
            round_seconds=0.025, members=99, subprocesses=True)
QUICK = Plan(batch_pairs=1_000, single_pairs=40, timed_pairs=10, seconds=0.05, rounds=2,
             round_seconds=0.025, members=1, subprocesses=False)
FEW_PAIRS = 17
"""Pairs that are prepared at once where more pairs of sizes than that are among them. Odd, so that
a median is the time of one pair, not between two that may differ tenfold."""
LEAST_PAIRS = 10  # pairs judged, whatever they take
PATIENCE = 120.0  # for an engine's answers in a subprocess [s]
VERDICT = 1e-9
"""Least gap or depth, of the size, at which verdicts and normals are judged. At exact touch both
verdicts are right, and a normal may be any that keeps the boxes apart."""


def apart(rng: np.random.Generator, n: int) -> Pairs:
    """Draw boxes 1e-6 to 0.1 m apart: half containers almost stacked, half cubes in any pose."""
    half = n // 2
    size = np.tile((2.0, 2.0, 2.0), (half, 1))
    cubes = any_pose(rng, size, size, np.full(half, 0.01))
    yard = stacked(rng, CONTAINER, log_uniform(rng, 1e-6, 0.05, n - half),
                   rng.uniform(-0.1, 0.1, n - half), np.full(n - half, 0.01))
    parts = []
    for pairs in (cubes, yard):
        parts.append(at_depth(pairs, -log_uniform(rng, 1e-6, 0.1, len(pairs.pose_a))))
    both = Pairs(*(np.concatenate(columns) for columns in zip(*parts)))
    return both.rows(rng.permutation(len(both.size)))  # the first ones are of both kinds


ALL_SETS: dict[str, Generator] = {**SETS, 'just apart': apart}


@dataclass(frozen=True, kw_only=True)
class SetErrors:
    """Answers on a set against the exact ones."""

    points: dict[str, tuple[int, float, float, float]]
    """By class, or 'all': contacts, and the point error's median, p99, worst [%]."""
    normal: tuple[float, float]  # p99 and worst of the normal's error [deg]; NaN: none was judged
    missed: int
    invented: int
    odd: Mapping[str, int] = field(default_factory=dict)
    """The pair of the first missed, the first invented contact, the worst normal."""


@dataclass(frozen=True, kw_only=True)
class Answers:
    """What an engine answers on the first n pairs of a set."""

    colliding: np.ndarray  # (n,)
    normals: np.ndarray  # (n, 3)
    points: dict[str, np.ndarray]  # (n, 3), by choice
    exceptions: int = 0  # pairs at which the engine raised one; they count as apart

    def judged(self, pairs: Pairs) -> dict[str, SetErrors]:
        """Return the errors by choice."""
        first = pairs.rows(slice(len(self.colliding)))
        return {choice: judge(first, self.colliding, self.normals, points)
                for choice, points in self.points.items()}


@dataclass(frozen=True, kw_only=True)
class FrontierRow:
    """One contestant on one set. NaN: not measured."""

    name: str
    set: str
    instruction_set: str
    judged: int
    calls: int
    single: tuple[float, ...]  # p50, p99, max of a call [ns]
    batch: float  # p50 of a pair in a batch [ns]
    by_exact: list[float]
    """Single call and batch by those of `exact`: medians over the rounds of their own ratios."""
    choices: dict[str, SetErrors]  # by the way in which a point was made
    exceptions: int = 0
    failure: str = ''  # what ended the engine before its answers, if anything
    poses: Mapping[str, tuple[list[float], ...]] = field(default_factory=dict)
    """Poses and sizes of the odd pairs of `SetErrors`."""

    @property
    def best(self) -> str:
        """Return the choice with the least p99 of the point error."""
        return min(self.choices, key=lambda one: self.choices[one].points.get(
            'all', (0, math.nan, math.inf, math.nan))[2])

    @property
    def errors(self) -> SetErrors:
        """Return the errors of the best choice."""
        return self.choices[self.best]


def judge(pairs: Pairs, colliding: np.ndarray, normals: np.ndarray, points: np.ndarray,
          ) -> SetErrors:
    """Compare answers (n,), (n, 3), (n, 3) with the exact ones."""
    truth = pairs.contacts()
    both = colliding & truth.colliding
    found: dict[str, tuple[int, float, float, float]] = {}
    if both.any():
        touching = pairs.rows(both)
        errors = point_errors(points[both], truth.point[both], touching.edge)
        classes = classify(touching)[0]
        parts = {'all': errors, **{c: errors[classes == k] for k, c in enumerate(CLASSES)}}
        found = {label: (len(part), *percentiles(part, 50, 99, 100))
                 for label, part in parts.items() if len(part)}
    clear = np.abs(truth.separation) > VERDICT * pairs.size
    rows = np.flatnonzero(both & clear & np.isfinite(normals).all(axis=1))
    angles = degrees_between(normals[rows], truth.normal[rows])
    wrong = {'missed': np.flatnonzero(truth.colliding & ~colliding & clear),
             'invented': np.flatnonzero(colliding & ~truth.colliding & clear)}
    odd = {kind: int(rows[0]) for kind, rows in wrong.items() if len(rows)}
    if len(rows):
        odd['normal'] = int(rows[np.argmax(angles)])
    return SetErrors(points=found, normal=percentiles(angles, 99, 100), odd=odd,
                     missed=len(wrong['missed']), invented=len(wrong['invented']))


def ask(engine: Contestant, pairs: Pairs, plan: Plan) -> Answers:
    """Return answers to as many pairs as there is time to ask."""
    if engine.solve and engine.prepare_batch:
        found, _ = engine.solve(pairs)
        return Answers(colliding=found.colliding, normals=found.normal,
                       points={engine.choices[0]: found.point})
    pairs = pairs.rows(slice(plan.single_pairs))
    asked, exceptions, began = [], 0, time.monotonic()
    step = _at_once(pairs)
    for first in range(0, len(pairs.size), step):
        for call in engine.prepare(pairs.rows(slice(first, first + step))):
            try:
                found = engine.read(call())
                asked.append([chosen(found, choice) for choice in engine.choices])
            except Exception:
                exceptions += 1
                asked.append([chosen(APART, choice) for choice in engine.choices])
        if time.monotonic() - began > plan.seconds and len(asked) >= LEAST_PAIRS:
            break
    return Answers(
        colliding=np.array([answers[0].touching for answers in asked]),
        normals=np.array([answers[0].normal for answers in asked]),
        points={choice: np.array([answers[k].point for answers in asked])
                for k, choice in enumerate(engine.choices)}, exceptions=exceptions)


def _at_once(pairs: Pairs) -> int:
    """Return how many pairs are prepared together: all, or FEW_PAIRS if they have more sizes."""
    sizes = np.unique(np.hstack([pairs.size_a, pairs.size_b]), axis=0)
    return FEW_PAIRS if len(sizes) > FEW_PAIRS else len(pairs.size)


def answers_of(engine: Contestant, sets: Mapping[str, Pairs], plan: Plan,
               ) -> dict[str, Answers | str]:
    """Return answers by set, or what ended the engine; sets with boxes not for it are left out."""
    if engine.make is None or not plan.subprocesses:
        return _ask_all(engine, sets, plan)
    few = {name: pairs.rows(slice(plan.single_pairs)) for name, pairs in sets.items()}
    return part_by_part(_ask_all, engine.make, few, plan, patience=PATIENCE)


def _ask_all(engine: Contestant, sets: Mapping[str, Pairs], plan: Plan) -> dict[str, Answers | str]:
    found: dict[str, Answers | str] = {}
    for name, pairs in sets.items():
        try:
            found[name] = ask(engine, pairs, plan)
        except ValueError:
            if engine.any_boxes:
                raise
    return found


class Trial:
    """A contestant on a set: its answers, judged, and its times, gathered in rounds."""

    def __init__(self, engine: Contestant, name: str, pairs: Pairs, answers: Answers | str,
                 plan: Plan) -> None:
        """Judge, and prepare the calls; an engine that failed is not timed."""
        self.name, self.set = engine.name, name
        self._engine, self._pairs, self._answers = engine, pairs, answers
        self._seconds = plan.round_seconds
        self._calls: Sequence[Callable[[], object]] = ()
        self._batch: Timing | None = None
        if isinstance(answers, Answers) and not answers.exceptions:
            timed = pairs.rows(slice(plan.timed_pairs))
            self._calls = engine.prepare(timed.rows(slice(_at_once(timed))))
            if engine.prepare_batch:
                self._batch = Timing(name=engine.name, kind='batch', count=len(pairs.size),
                                     run=engine.prepare_batch(pairs))
        for call in self._calls:  # what is made at a pair's first call is not timed
            call()
        self._singles: list[np.ndarray] = []
        self.rounds: list[tuple[float, float]] = []
        """Of each round: the median single call, and a pair in a batch [ns]."""

    def time(self) -> None:
        """Time one round, after a warm-up: all single calls, again and again, then a batch."""
        times = each_call(self._calls, self._seconds)
        self._singles.append(np.array(times, np.int64))
        if self._batch:
            self._batch.time()
        self.rounds.append((percentiles(times, 50)[0],
                            self._batch.rounds[-1] if self._batch else math.nan))

    def row(self, exact: Trial) -> FrontierRow:
        """Return what was found; times also by those of `exact` in the same rounds."""
        answers, failure = self._answers, ''
        if isinstance(answers, str):
            answers, failure = Answers(
                colliding=np.zeros(0, bool), normals=np.zeros((0, 3)),
                points={choice: np.zeros((0, 3)) for choice in self._engine.choices}), answers
        singles = np.concatenate(self._singles)
        choices = answers.judged(self._pairs)
        odd = {kind: row for errors in choices.values() for kind, row in errors.odd.items()}
        return FrontierRow(
            name=self.name, set=self.set, instruction_set=native.instruction_set,
            judged=len(answers.colliding), calls=len(singles),
            single=percentiles(singles, 50, 99, 100),
            batch=float(np.median([batch for _, batch in self.rounds])), choices=choices,
            by_exact=by_round(self.rounds, exact.rounds).tolist(),
            exceptions=answers.exceptions, failure=failure,
            poses={kind: tuple(part[row].tolist() for part in self._pairs)
                   for kind, row in odd.items()})


def measure_all(found: Sequence[Contestant], *, seed: int = 3, plan: Plan = FULL,
                ) -> list[FrontierRow]:
    """Return all rows, set by set. All contestants on all sets take turns.

    A neighbour that slows the machine for seconds then slows few rounds of a set, not all of them.
    """
    from tqdm import tqdm

    sets = {name: drawn(make, np.random.default_rng([seed, place]), plan.batch_pairs)
            for place, (name, make) in enumerate(ALL_SETS.items())}
    with tqdm(total=len(found) * (1 + len(sets) * plan.rounds), desc='frontier',
              unit='step') as bar:
        answers = []
        for engine in found:
            bar.set_postfix_str(engine.name)
            answers.append(answers_of(engine, sets, plan))
            bar.update()
        trials = [Trial(engine, name, pairs, given[name], plan) for name, pairs in sets.items()
                  for engine, given in zip(found, answers) if name in given]
        bar.total = len(found) + len(trials) * plan.rounds
        take_turns([trial.time for trial in trials], plan.rounds, bar.update)
    exact = {trial.set: trial for trial in trials if trial.name == 'exact'}
    return [trial.row(exact[trial.set]) for trial in trials]
