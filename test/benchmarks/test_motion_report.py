# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `motion`: its judge proves and refutes, and finds what is late, early and too high."""
from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from benchmarks import motion, motions, native_calls

pytestmark = [pytest.mark.reports,
              pytest.mark.skipif(shutil.which('g++') is None, reason='no compiler')]

JUDGED = """
#include <cstdio>
#include "judge.hpp"

int main() {
  // A cube of .04 flies through a plate of .04, turning about the way; they touch from .496 on.
  bc_sweep plate{{{0, 0, 0}, {0, 0, 0, 1}}, {{0, 0, 0}, {0, 0, 0, 1}}, {{4, 4, 0.04}}, {0, 0, 0}};
  bc_sweep bullet{{{2, 0, 5}, {0, 0, 0, 1}}, {{2, 0, -5}, {0, 0, 0.6, 0.8}}, {{.04, .04, .04}}, {}};
  judge::Judge judge(plate, bullet);
  auto show = [&](double target, double end) {
    std::printf("%d ", int(judge.stays_above(target, end, 0)));
  };
  show(0.0, 0.496 - 1e-15), show(0.0, 0.496 + 1e-9), show(0.0, 1.0);
  show(1.0, 0.396 - 1e-12), show(1.0, 0.396 + 1e-9), show(0.0, 0.0);
  std::printf("%.3Lf\\n", judge::distance(judge.at(0.25L)));
}
"""


def test_the_judge_proves_and_refutes(tmp_path: Path) -> None:
    """0: proved, 1: refuted; to a nanosecond of a second's way."""
    (tmp_path / 'judged.cpp').write_text(JUDGED)
    native_calls.run_compiler(f'-I{motion.CALLS_FOLDER}', tmp_path / 'judged.cpp', '-o',
                              tmp_path / 'judged', *native_calls.library_beside(tmp_path))
    assert subprocess.run([tmp_path / 'judged'], capture_output=True, text=True,
                          check=True).stdout == '0 1 1 0 1 0 2.460\n'


def test_a_report_of_a_few_motions_is_right(tmp_path: Path) -> None:
    """All kinds, timed; and a kind whose box A stands beside what is sampled."""
    program = motion.compiled(tmp_path)
    found = {kind: motion.judged(program, motions.draw(kind, 2, 30), 5, 0)
             for kind in motions.KINDS}
    assert all(motion.faults(one) == (0, 0, 0, 0) for one in found.values())
    assert sum(np.isfinite(one['time']).sum() for one in found.values()) > 100
    assert '| no motion | 30 |' in motion.verdicts_table(found)
    assert '**all**' in motion.costs_table(found)
    assert (found['both turning']['distance_ns'] > 0.0).sum() == 5
    for kind in motion.STANDING:
        drawn = motions.draw(kind, 2, 30)
        assert np.array_equal(drawn.start_a, drawn.end_a) and not drawn.clearance.any()
        one = motion.judged(program, drawn, 1, 30)
        row = motion.compared(kind, '1 mm', one['sampled'], one['time'], 1.0)
        assert row['invented'] == row['early'] == 0


def test_wrong_times_are_counted() -> None:
    true = np.array([0.5, 0.5, 0.5, 0.5, np.nan, np.nan])
    times = np.array([0.5005, 0.6, 0.4, np.nan, 0.3, np.nan])
    row = motion.compared('kind', 'engine', times, true, 1.0)
    assert [row[name] for name in ('late', 'early', 'missed', 'invented')] == [1, 1, 1, 1]


def test_goals_that_are_missed_are_named() -> None:
    names = dict.fromkeys(motion.COLUMNS, np.zeros(10))
    good = {kind: {**names, 'distance_ns': np.ones(10), 'time_ns': np.ones(10)}
            for kind in motions.KINDS}
    assert motion.missed_goals(good) == []
    late = {**good['no motion'], 'late': np.array([1.0] + [0.0] * 9)}
    slow = {**good['both turning'], 'time_ns': np.full(10, 11.0),
            'time_distances': np.full(10, 99.0)}
    assert [line.split(':')[0] for line in motion.missed_goals(
        {**good, 'no motion': late, 'both turning': slow})] == [
            'no motion', 'distances of time', 'both turning']


@pytest.mark.parametrize('kind', [kind for kind in motions.KINDS if 'graz' in kind])
def test_motions_graze(kind: str) -> None:
    """Their least distance is a micron to a millimetre beside the clearance."""
    drawn = motions.draw(kind, 3, 200)
    off = np.abs(drawn.least(1e-7 if 'UTM' in kind else 1e-8).nearest.distance - drawn.clearance)
    assert (off < 1.2e-3).mean() > 0.8  # some turn so that no way aside leads there


def test_engines_answer_a_motion() -> None:
    """A cube that falls onto another at half of the way."""
    asked, missing = motion.engines([])
    assert missing or len(asked) == 1
    start, end = (np.array([[0, 0, z, 0, 0, 0, 1.0]]) for z in (3.0, -1.0))
    cube, none = np.ones((1, 3)), np.zeros((1, 3))
    one = motions.Motions(0 * start + [0, 0, 0, 0, 0, 0, 1], 0 * start + [0, 0, 0, 0, 0, 0, 1],
                          start, end, cube, cube, none, none, np.zeros(1))
    for name, ask in asked.items():
        assert 0.498 <= ask(one, 0)[0] <= 0.502, name
