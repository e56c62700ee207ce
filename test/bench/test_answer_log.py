# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench's book-keeping, without ROS: every planted fault shows up in the results."""
from __future__ import annotations

import numpy as np
import pytest

from box_contact_ros.bench.answer_log import AnswerLog
from box_contact_ros.solver.contact import Contacts, without_patch

MS = 1_000_000  # ns
START = 1_700_000_000_000_000_000  # ns: stamps as large as real ones
PAIRS = 100
DOWN = np.array([0.0, 0.0, -1.0])


def exact(rows: int = PAIRS) -> Contacts:
    """Return the truth: even rows touch at a point of their own, 2 mm deep; odd rows are apart."""
    touching = np.arange(rows) % 2 == 0
    nothing = np.where(touching, 0.0, np.nan)[:, None]
    points = np.stack([0.01 * np.arange(rows), np.ones(rows), np.zeros(rows)], axis=1)
    return without_patch(touching, np.where(touching, -2e-3, 0.5), DOWN + nothing,
                         points + nothing)


def stamp_of(row: int) -> int:
    """Stamp [ns] of a row sent at 200 Hz."""
    return START + 5 * MS * row


def played(node: str = 'contact', plant=lambda row: {}, delay: int = MS, stream: str = 'stream',
           ) -> AnswerLog:
    """Return the log of a node that answers every row; `plant` gives what is wrong in a row.

    The point comes after half the delay, the normal after all of it, then the contacts.
    """
    log = AnswerLog(node, stream, exact())
    for row in range(PAIRS):
        log.sent(row, stamp_of(row), 1e-4)
        answer(log, row, delay=delay, **plant(row))
    return log


def answer(log: AnswerLog, row: int, *, lost: tuple[str, ...] = (), delay: int = MS,
           shift: float = 0.0, depth: float = 2e-3, touching: bool | None = None) -> None:
    """Answer a row rightly but for what is planted.

    lost: kinds that do not come; shift: added to the point [m]; touching: the verdict.
    """
    truth, stamp = exact(), stamp_of(row)
    numbers = []
    if truth.colliding[row] if touching is None else touching:
        point = np.nan_to_num(truth.point[row])
        numbers = [*point, *DOWN, depth]
        if 'point' not in lost:
            log.answer('point', stamp, stamp + delay // 2, point + shift)
        if 'normal' not in lost:
            log.answer('normal', stamp, stamp + delay, DOWN)
    if 'contacts' not in lost:
        log.answer('contacts', stamp, stamp + delay + MS, numbers)


def counts(log: AnswerLog) -> tuple[int, int]:
    """Return how many answers were lost, and how many are wrong."""
    return int(log.lost.sum()), int(log.wrong.sum())


def test_a_faultless_run():
    """Half of the pairs touch, and have a latency: up to the normal, not to the contacts."""
    log = played()
    assert counts(log) == (0, 0)
    assert np.isnan(log.latencies[1::2]).all()
    assert log.latencies[::2] == pytest.approx(1e-3, abs=1e-12)
    assert np.array_equal(np.isnan(log.point_errors), ~exact().colliding)
    assert np.nanmax(log.point_errors) == 0.0


@pytest.mark.parametrize('plant, expected', [
    ({10: {'lost': ('contacts', 'point', 'normal')}}, (1, 0)),
    ({11: {'lost': ('contacts',)}}, (1, 0)),
    ({10: {'lost': ('point',)}, 20: {'lost': ('normal',)}}, (2, 0)),
    ({10: {'touching': False}}, (0, 1)),
    ({11: {'touching': True}}, (0, 1)),
    ({10: {'shift': 1e-12}}, (0, 1)),
    ({10: {'depth': 2e-3 + 1e-8}}, (0, 1)),
    ({10: {'depth': 2e-3 + 1e-12}}, (0, 0)),
])
def test_planted_faults(plant, expected):
    """A message that does not come, a wrong verdict, a contradiction, the depth of another tick."""
    assert counts(played(plant=lambda row: plant.get(row, {}))) == expected


@pytest.mark.parametrize('message', ['point', 'normal', 'contacts'])
def test_an_answer_that_comes_twice_is_wrong(message):
    """The first message counts, with its latency and its numbers."""
    log = played()
    log.answer(message, stamp_of(20), stamp_of(20) + 50 * MS, [9.0] * (7 if message == 'contacts'
                                                                       else 3))
    assert counts(log) == (0, 1)
    assert log.latencies[20] == pytest.approx(1e-3, abs=1e-12) and log.point_errors[20] == 0.0


def test_a_point_where_contacts_tell_none_is_wrong():
    log = played()
    log.answer('point', stamp_of(21), stamp_of(21) + MS, (0.0, 0.0, 0.0))
    assert counts(log) == (0, 1)


def test_what_was_not_sent_is_not_lost():
    """Nor does an answer to a stamp that nobody sent count."""
    log = AnswerLog('contact', 'stream', exact())
    answer(log, 0)
    log.sent(0, stamp_of(0), 0.0)
    assert counts(log) == (1, 0)
    answer(log, 0)
    assert counts(log) == (0, 0)


def test_an_echo_answers_every_pair_and_is_never_wrong():
    log = AnswerLog('echo', 'stream', exact())
    for row in range(PAIRS):
        log.sent(row, stamp_of(row), 0.0)
        for kind in ('point', 'normal'):
            if row != 7:
                log.answer(kind, stamp_of(row), stamp_of(row) + MS, (0.0, 0.0, 0.0))
    assert counts(log) == (1, 0)
    assert np.count_nonzero(np.isnan(log.latencies)) == 1


def test_processor_and_memory_over_blocks():
    """100 pairs at 200 Hz take half a second; the memory of the second half counts."""
    log = played()
    log.note_usage(np.array([[1.0, 10e6], [1.1, 14e6], [1.2, 15e6]]), 200.0)
    assert log.cpu == pytest.approx(0.4) and log.growth == 1e6
