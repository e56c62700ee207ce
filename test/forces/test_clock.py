# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clock of forces as a table: steps and answers in, sub-steps out."""
from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MS = 1e-3
FRAME = 1 / 60
OWN = (-1.0, 0.0)
TABLE = {  # steps, latency and period → count, window and rounds of the last step's sub-steps
    'the first step': ([MS], OWN, (4, MS / 4, 1)),
    'equal steps': ([MS] * 100, OWN, (4, MS / 4, 1)),
    'a frame': ([FRAME], OWN, (4, FRAME / 4, 1)),
    'a lag: no sub-step is longer than 5 ms': ([FRAME, 0.5], OWN, (100, 5 * MS, 1)),
    'a short remainder is one': ([3 * MS, 3 * MS, 0.5 * MS], OWN, (1, 3 * MS / 4, 1)),
    'a longer remainder': ([3 * MS] * 3 + [7.67 * MS] + [3 * MS], OWN, (2, 7.67 * MS / 4, 1)),
    'a longest step of a second ago is known': ([7.67 * MS] + [3 * MS] * 160, OWN,
                                                (2, 7.67 * MS / 4, 1)),
    'a longest step of two seconds ago is not': ([7.67 * MS] + [3 * MS] * 500, OWN,
                                                 (4, 3 * MS / 4, 1)),
    'steps shorter by a tenth change nothing': ([3 * MS] + [2.7 * MS] * 1000, OWN,
                                                (4, 3 * MS / 4, 1)),
    'few long steps count for as long as 32': ([0.4] + [0.1] * 20, OWN, (20, 5 * MS, 1)),
    'one sub-step a step, if asked for': ([MS] * 3, OWN, (1, MS, 1)),
    'late answers: all iterations in one': ([MS] * 3, (5 * MS, 20 * MS), (1, MS, 4)),
    'answers at each step are not late': ([MS] * 3, (0.0, MS), (4, MS / 4, 1)),
}
SAME_WINDOW = {'equal steps', 'a short remainder is one', 'a longest step of a second ago is known',
               'a longer remainder', 'steps shorter by a tenth change nothing'}
"""Rows whose last two windows are one."""


@pytest.fixture(scope='module')
def clock(tmp_path_factory) -> Path:
    program = tmp_path_factory.mktemp('clock') / 'clock'
    subprocess.run([*os.environ.get('CXX', 'c++').split(), '-std=c++17', '-O1', '-Wall', '-Werror',
                    '-Wno-psabi', '-I', ROOT / 'box_contact_ros' / 'core' / 'src',
                    Path(__file__).with_name('clock_table.cpp'), '-o', program], check=True)
    return program


def test_sub_steps_by_steps_and_answers(clock: Path) -> None:
    """Sub-steps are equal, none is longer than the window, and as few as that allows."""
    rows = [f'{1 if "one sub-step" in name else 4} {late} {period} {len(steps)} '
            + ' '.join(map(repr, steps)) for name, (steps, (late, period), _) in TABLE.items()]
    out = subprocess.run([clock], input='\n'.join(rows), capture_output=True, text=True, check=True)
    found = [line.split() for line in out.stdout.splitlines()]
    assert len(found) == len(TABLE)
    for (name, (steps, _, wanted)), row in zip(TABLE.items(), found):
        count, length, window, rounds, again, kept, overdue = map(float, row)
        assert (count, rounds) == wanted[::2], name
        assert window == pytest.approx(wanted[1], rel=1e-12), name
        assert length == pytest.approx(steps[-1] / count, rel=1e-12), name
        assert length <= window * (1 + 1e-9) and overdue >= 3 * steps[-1], name
        if name in SAME_WINDOW:  # impulses of it come again, or stay
            assert again == pytest.approx(length / window, rel=1e-9), name
            assert again + kept == pytest.approx(1.0, rel=1e-9), name
