# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clock: what it switches off is given back, all take turns, ratios are those of rounds."""
from __future__ import annotations

import gc
import os
import time

import pytest

from benchmarks import timing

pytestmark = pytest.mark.reports


def test_what_was_pinned_and_switched_off_is_given_back() -> None:
    cores = os.sched_getaffinity(0)
    with pytest.raises(RuntimeError, match='planted'):
        with timing.pinned({timing.usable_cores()[-1]}), timing.no_garbage_collection():
            assert len(os.sched_getaffinity(0)) == 1 and not gc.isenabled()
            raise RuntimeError('planted')
    assert os.sched_getaffinity(0) == cores and gc.isenabled()


def test_all_take_their_turn() -> None:
    seen: list[str] = []
    timing.take_turns([lambda: seen.append('a'), lambda: seen.append('b')], 2,
                      lambda: seen.append('.'))
    assert ''.join(seen) == 'a.b.a.b.' and gc.isenabled()


def test_ratios_are_those_of_rounds() -> None:
    """Of two quantities; the second round is slow for both contestants."""
    assert timing.by_round([(2.0, 9.0), (20.0, 80.0), (3.0, 7.0)],
                           [(1.0, 9.0), (10.0, 40.0), (1.0, 1.0)]).tolist() == [2.0, 2.0]


def test_the_clock_measures_a_known_sleep() -> None:
    """A run is timed right after an untimed one, per call; a sleeping thread takes no CPU time."""
    took, answer = timing.nanoseconds(lambda: time.sleep(5e-3) or 'awake')
    assert took >= 5e6 and answer == 'awake'
    assert timing.cpu_milliseconds(time.sleep, 2e-2)[0] < 10.0
    runs: list[None] = []
    assert timing.after_warm_up(lambda: (runs.append(None), time.sleep(5e-3)), 5) >= 1e6
    assert len(runs) == 2


def test_each_call_is_timed_in_whole_rounds() -> None:
    calls = [lambda: None, lambda: time.sleep(2e-3)]
    times = timing.each_call(calls, 1e-2)
    assert len(times) % 2 == 0 and min(times[1::2]) >= 2e6
    assert timing.each_call([], 1.0) == []
