# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one clock of all reports: contestants take turns, and times are compared round by round.

Neighbours on a machine may slow it by half for minutes. Contestants that take turns all suffer from
that, so the median of the rounds' own ratios says more than the ratio of two medians. A report runs
on cores of its own (`pinned`), and without garbage collection.
"""
from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

WARM_UP = 3  # calls before those that are timed one by one


def usable_cores() -> list[int]:
    """Return the cores that this process may use; reports measure on the last one."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else [0]


@contextmanager
def pinned(cores: Collection[int]) -> Iterator[None]:
    """Run on these cores only, where the system can do so."""
    if not hasattr(os, 'sched_setaffinity'):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Collect the garbage now, and none until the end: it takes milliseconds."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()


def take_turns(runs: Sequence[Callable[[], object]], rounds: int,
               after_each: Callable[[], object] = lambda: None) -> None:
    """Call all in turn, `rounds` times, so that a slow moment hits all of them."""
    with no_garbage_collection():
        for _ in range(rounds):
            for run in runs:
                run()
                after_each()


def by_round(times: ArrayLike, others: ArrayLike) -> Any:
    """Return the median over rounds (first axis) of the ratios of times to others' times."""
    return np.median(np.divide(times, others), axis=0)


def nanoseconds(work: Callable[..., Any], *arguments: Any,
                clock: Callable[[], int] = time.perf_counter_ns) -> tuple[int, Any]:
    """Return the time of one call [ns], and what it returns."""
    began = clock()
    found = work(*arguments)
    return clock() - began, found


def cpu_milliseconds(work: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    """Return the time that this thread's processor takes for one call [ms], and its result."""
    took, found = nanoseconds(work, *arguments, clock=time.thread_time_ns)
    return 1e-6 * took, found


def after_warm_up(run: Callable[[], object], count: int,
                  clock: Callable[[], int] = time.perf_counter_ns) -> float:
    """Return the time of a run right after an untimed one, for each of its `count` items [ns]."""
    run()
    return nanoseconds(run, clock=clock)[0] / count


def each_call(calls: Sequence[Callable[[], object]], seconds: float) -> list[int]:
    """Return the time of each call [ns], after a warm-up: all of them, again and again."""
    clock, times = time.perf_counter_ns, list[int]()
    for call in calls[:WARM_UP]:
        call()
    until = clock() + int(1e9 * seconds)
    while calls and clock() < until:
        for call in calls:
            began = clock()
            call()
            times.append(clock() - began)
    return times
