# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane's book-keeping, without ROS: every planted fault shows up in the summary."""

from __future__ import annotations

import io
import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from box_contact_ros.demo.crane_log import CraneLog, Screen, table

MS = 1_000_000  # ns
START = 1_700_000_000_000_000_000  # ns: stamps as large as real ones
EDGE = 12.192
TICKS = 150
STACK = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class FloorSolver:
    """A reference that can be worked out by hand: contact where the load's z is not positive.

    The point is the load's position, the normal is straight down, the depth is -z.
    """

    def batch(self, poses_a: np.ndarray, poses_b: np.ndarray) -> SimpleNamespace:
        """Answer poses (n, 7)."""
        assert poses_a.shape == poses_b.shape == (len(poses_a), 7)
        colliding = poses_a[:, 2] <= 0.0
        nothing = np.where(colliding, 0.0, np.nan)[:, None]
        return SimpleNamespace(
            colliding=colliding, separation=poses_a[:, 2], point=poses_a[:, :3] + nothing,
            normal=np.array([0.0, 0.0, -1.0]) + nothing,
        )


def pose(tick: int) -> np.ndarray:
    """Place the load at `tick`: above the floor for 50 ticks, then 1 mm deeper with every tick."""
    return np.array([0.01 * tick, 2.0, 1e-3 * (50 - tick), 0.0, 0.0, 0.0, 1.0])


def play(log: CraneLog, ticks: int = TICKS, *, lost: tuple = (), late: tuple = (), delay: int = MS,
         shift=(0.0, 0.0, 0.0), normal=(0.0, 0.0, -1.0)) -> None:
    """Send `ticks` pairs and answer them rightly, but for what is planted.

    lost  -- (tick, message) that do not arrive; a message is 'cloud', 'point' or 'normal'
    late  -- ticks whose normal arrives after 20 ms instead of `delay` ns
    shift -- added to every point, m
    """
    for tick in range(ticks):
        stamp, load = START + 5 * MS * tick, pose(tick)
        log.sent_poses(stamp, load, STACK)
        touching, point = load[2] <= 0.0, load[:3] + shift
        if touching and (tick, 'point') not in lost:
            log.answer('point', stamp, stamp + delay // 2, point)
        if touching and (tick, 'normal') not in lost:
            log.answer('normal', stamp, stamp + (20 * MS if tick in late else delay), normal)
        if (tick, 'cloud') not in lost:
            log.answer('cloud', stamp, stamp + delay,
                       [*point, *normal, -load[2]] if touching else [])


def test_a_faultless_run_passes():
    """150 pairs, 100 of them in contact, all answered after 1 ms, the later of the two counts."""
    log = CraneLog(TICKS)
    play(log)
    assert log.outstanding == 0
    summary = log.summary(FloorSolver(), EDGE)
    assert summary.passed
    assert (summary.result.sent, summary.result.contacts, summary.lost) == (150, 100, 0)
    assert summary.wrong_verdicts == 0
    assert '150 answers' in str(summary)
    assert summary.latencies == pytest.approx(np.full(100, 1e-3), abs=1e-12)
    assert summary.result.point_error['p99'] == summary.result.normal_error['p99'] == 0.0


@pytest.mark.parametrize('lost, evaluations, contacts', [
    ([(10, 'cloud')], 1, 0),
    ([(100, 'point')], 0, 1),
    ([(100, 'normal')], 0, 1),
    ([(100, 'point'), (100, 'normal')], 0, 1),
    ([(10, 'cloud'), (60, 'cloud'), (100, 'normal')], 2, 1),
])
def test_planted_loss_is_counted(lost, evaluations, contacts):
    """A pair without its cloud is a lost evaluation, a row without its messages a lost contact."""
    log = CraneLog(TICKS)
    play(log, lost=tuple(lost))
    assert log.outstanding == evaluations + contacts
    summary = log.summary(FloorSolver(), EDGE)
    result = summary.result
    assert (result.lost_evaluations, result.lost_contacts) == (evaluations, contacts)
    assert summary.lost == evaluations + contacts
    assert not summary.passed
    assert f'{summary.lost} ({evaluations} evaluations, {contacts} contacts)' in str(summary)


def test_planted_late_answers_move_p99_and_not_p50():
    """3 of 100 normals come 20 ms after the stamp: p99 is 20 ms, p50 stays 1 ms."""
    log = CraneLog(TICKS)
    play(log, late=(80, 90, 100))
    summary = log.summary(FloorSolver(), EDGE)
    assert np.percentile(summary.latencies, (50, 99)) == pytest.approx((1e-3, 20e-3), abs=1e-12)
    assert 'p50 1.000 ms, p99 20.000 ms' in str(summary)
    assert summary.passed, 'late is not lost'


def test_planted_point_shift_shows_in_metres_and_in_percent():
    """A shift of (3, 0, 4) cm is an error of 5 cm, 0.41 % of an edge of 12.192 m."""
    log = CraneLog(TICKS)
    play(log, shift=np.array([0.03, 0.0, 0.04]))
    summary = log.summary(FloorSolver(), EDGE)
    assert summary.result.point_error['median'] == pytest.approx(0.05, abs=1e-12)
    assert summary.result.point_error['p99'] == pytest.approx(0.05, abs=1e-12)
    assert 'median 50 mm = 0.41 %' in str(summary)


@pytest.mark.parametrize('degrees', [1e-6, 2.0, 180.0])
def test_planted_normal_rotation_shows_in_degrees(degrees):
    """Normals turned about y by an angle err by that angle, a tiny one and a flip included."""
    turn = math.radians(degrees)
    log = CraneLog(TICKS)
    play(log, normal=(math.sin(turn), 0.0, -math.cos(turn)))
    summary = log.summary(FloorSolver(), EDGE)
    assert summary.result.normal_error['median'] == pytest.approx(degrees, rel=1e-6)


@pytest.mark.parametrize('tick, depths', [(10, [0.01]), (100, [])])
def test_a_wrong_verdict_is_counted(tick, depths):
    """Contact claimed in the air, or none inside the floor: one wrong verdict each."""
    log = CraneLog(TICKS)
    play(log, lost=((tick, 'cloud'), (tick, 'point'), (tick, 'normal')))
    stamp = START + 5 * MS * tick
    row = [*pose(tick)[:3], 0.0, 0.0, -1.0, *depths] if depths else []
    log.answer('cloud', stamp, stamp + MS, row)
    summary = log.summary(FloorSolver(), EDGE)
    assert summary.wrong_verdicts == 1
    assert not summary.passed


def test_a_point_in_the_air_is_a_wrong_verdict_without_an_error():
    """A point and a normal where there is no contact count as wrong and spoil no percentile."""
    log = CraneLog(TICKS)
    play(log)
    for kind, values in (('point', (1.0, 2.0, 3.0)), ('normal', (1.0, 0.0, 0.0))):
        log.answer(kind, START + 5 * MS * 10, START + 51 * MS, values)
    summary = log.summary(FloorSolver(), EDGE)
    assert summary.wrong_verdicts == 1
    assert summary.result.point_error['p99'] == 0.0
    assert not summary.passed


def test_a_row_of_nan_is_no_answer():
    """A cloud that says "could not be evaluated" fails the run, and is no verdict nor a loss."""
    log = CraneLog(TICKS)
    play(log, lost=((100, 'cloud'), (100, 'point'), (100, 'normal')))
    log.answer('cloud', START + 5 * MS * 100, START + 501 * MS, [math.nan] * 7)
    summary = log.summary(FloorSolver(), EDGE)
    assert (summary.result.not_evaluated, summary.lost) == (1, 0) and '149 answers' in str(summary)
    assert summary.wrong_verdicts == 0
    assert log.outstanding == 0
    assert not summary.passed


def test_answers_to_no_pose_are_counted_but_not_those_to_offers():
    """An unknown stamp is a stranger; a pair offered before the run asks for an answer only."""
    log = CraneLog(TICKS)
    log.offers.add(START - MS)
    assert not log.offers_answered
    log.answer('cloud', START - MS, START)
    assert log.offers_answered
    play(log)
    assert log.summary(FloorSolver(), EDGE).passed
    log.answer('point', START + 1, START + MS, (0.0, 0.0, 0.0))
    summary = log.summary(FloorSolver(), EDGE)
    assert (summary.result.strangers, summary.result.sent) == (1, 150)
    assert not summary.passed


def test_without_contacts_a_run_fails():
    """Nothing sent has no summary; where nothing touched it still prints, and is no success."""
    log = CraneLog(TICKS)
    assert log.summary(FloorSolver(), EDGE) is None
    play(log, ticks=20)
    summary = log.summary(FloorSolver(), EDGE)
    assert (summary.result.sent, summary.result.contacts, summary.lost) == (20, 0, 0)
    assert len(summary.latencies) == 0
    assert not summary.passed
    assert 'nan' not in str(summary)


# --- what people see ------------------------------------------------------------------------------


def test_a_pipe_gets_plain_lines(capsys: pytest.CaptureFixture[str]) -> None:
    """No colours, no progress line, and the lines as they are."""
    screen = Screen('the crane moves', 25.0)
    with screen:
        screen.progress(7.0)
        screen.line('7.00 s  first touch')
    screen.tables('crane: done', table([('depth', '0.4 % (limit 1)')]))
    assert capsys.readouterr().out == (
        '7.00 s  first touch\ncrane: done\n  depth .................. 0.4 % (limit 1)\n')


def test_a_terminal_gets_a_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """With every figure, and those in red that do not meet their limit."""
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr(sys, 'stdout', Terminal())
    monkeypatch.setenv('TERM', 'xterm-256color')
    for name in ('NO_COLOR', 'TTY_COMPATIBLE', 'TTY_INTERACTIVE', 'COLUMNS'):
        monkeypatch.delenv(name, raising=False)
    screen = Screen('the crane moves', 25.0)
    with screen:
        screen.progress(7.0)
        screen.line('7.00 s  first touch')
    screen.tables('crane: done', table([('depth', '0.4 %'), ('gap', '30 mm  <-- not met')]))
    shown = sys.stdout.getvalue()
    assert '7 of 25 s' in shown and 'first touch' in shown and '│ depth │' in shown
    assert '\x1b[31m30 mm  <-- not met' in shown and '\x1b[31m0.4' not in shown
