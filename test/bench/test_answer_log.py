# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench's book-keeping, without ROS: every planted fault shows up in the results."""
from __future__ import annotations

import csv
import math

import numpy as np
import pytest

from box_contact_ros.bench.answer_log import ECHO_MESSAGES, AnswerLog
from box_contact_ros.bench.bench_report import (
    columns,
    draw,
    error_table,
    latency_table,
    write_results,
)
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


def stamp_of(row: int, first: int = START) -> int:
    """Stamp [ns] of a row sent at 200 Hz."""
    return first + 5 * MS * row


def send(log: AnswerLog, name: str = 'random', rows: int = PAIRS, first: int = START) -> None:
    log.open(name, PAIRS, exact())
    for row in range(rows):
        log.sent(stamp_of(row, first), 1e-4)


def answer(log: AnswerLog, row: int, *, lost: tuple[str, ...] = (), delay: int = MS, shift=0.0,
           normal=DOWN, touching: bool | None = None, first: int = START) -> None:
    """Answer a row rightly but for what is planted.

    The point comes after half the delay, the normal after all of it, then the cloud.

    lost -- kinds that do not come; shift -- added to the point [m]; touching -- the verdict
    """
    truth, stamp = exact(), stamp_of(row, first)
    values = []
    if truth.colliding[row] if touching is None else touching:
        point = np.nan_to_num(truth.point[row]) + shift
        values = [*point, *normal, 2e-3]
        if 'point' not in lost:
            log.answer('point', stamp, stamp + delay // 2, point)
        if 'normal' not in lost:
            log.answer('normal', stamp, stamp + delay, normal)
    if 'cloud' not in lost:
        log.answer('cloud', stamp, stamp + delay + (0 if not values else MS), values)


def played(plant=lambda row: {}, rows: int = PAIRS) -> AnswerLog:
    """Return the log of a node that answers every row; `plant` gives what is wrong in a row."""
    log = AnswerLog('contact', 'exact')
    send(log, rows=rows)
    for row in range(rows):
        answer(log, row, **plant(row))
    return log


def only(log: AnswerLog):
    """Return the one result of a log, whose counts add up."""
    result, = log.results()
    assert log.adds_up and result.adds_up
    assert result.sent == result.answered + result.lost
    return result


def test_a_faultless_run():
    """100 pairs at 200 Hz, half in contact, each answered after 1 ms.

    The cloud, which comes 1 ms after point and normal, does not count as the answer to a contact.
    """
    result = only(played())
    assert (result.sent, result.answered, result.lost, result.contacts) == (100, 100, 0, 50)
    assert result.faults == []
    for name in ('mean', 'min', 'max', 'p50', 'p99', 'p999'):
        assert result.latency[name] == pytest.approx(1e-3, abs=1e-12), name
    assert result.latency['std'] == pytest.approx(0.0, abs=1e-12)
    assert result.point_error['max'] == result.normal_error['max'] == 0.0
    assert result.rate == pytest.approx(200.0)
    assert result.lateness.max() == 1e-4


@pytest.mark.parametrize('lost, counts', [
    ({10: ('cloud', 'point', 'normal')}, (1, 0)),
    ({11: ('cloud',)}, (1, 0)),
    ({10: ('cloud',)}, (1, 0)),
    ({10: ('point',)}, (0, 1)),
    ({10: ('normal',)}, (0, 1)),
    ({10: ('point', 'normal'), 11: ('cloud',), 30: ('cloud',), 40: ('point',)}, (2, 2)),
])
def test_planted_loss(lost, counts):
    """A pair without its cloud is a lost evaluation; a cloud without its point, a lost contact."""
    result = only(played(lambda row: {'lost': lost.get(row, ())}))
    assert (result.lost_evaluations, result.lost_contacts) == counts
    assert (result.lost, result.answered) == (sum(counts), 100 - sum(counts))
    assert result.faults == [f'{sum(counts)} lost']
    assert len(result.latencies) == result.answered


def test_planted_flip_of_a_normal():
    """One normal of 50 the other way round: 180° at most, the median stays 0."""
    result = only(played(lambda row: {'normal': -DOWN} if row == 20 else {}))
    assert result.normal_error['max'] == pytest.approx(180.0, abs=1e-9)
    assert result.normal_error['median'] == 0.0
    assert '180' in error_table([result])


def test_a_shift_of_the_cloud_alone_is_a_contradiction():
    """Point and normal are right, the cloud's row is 1 cm off."""
    log = AnswerLog('contact', 'exact')
    send(log)
    for row in range(PAIRS):
        if row != 20:
            answer(log, row)
    truth, stamp = exact(), stamp_of(20)
    log.answer('point', stamp, stamp + MS, truth.point[20])
    log.answer('normal', stamp, stamp + MS, DOWN)
    log.answer('cloud', stamp, stamp + MS, [*(truth.point[20] + 0.01), *DOWN, 2e-3])
    result = only(log)
    assert result.faults == ['1 contradictions']
    assert result.lost == 0


def test_an_answer_that_comes_during_the_next_stream():
    """It belongs to the stream that its stamp was sent in."""
    log = played(lambda row: {'lost': ('cloud',) if row == 99 else ()})
    first = START + 1000 * MS
    send(log, 'touching', first=first)
    assert log.outstanding == 100
    answer(log, 99, delay=900 * MS)
    for row in range(PAIRS):
        answer(log, row, first=first)
    assert log.outstanding == 0
    earlier, later = log.results()
    assert log.adds_up
    assert (earlier.stream, earlier.lost, earlier.duplicates) == ('random', 0, 0)
    assert earlier.latency['max'] == pytest.approx(0.9, abs=1e-9)
    assert (later.stream, later.lost, later.strangers) == ('touching', 0, 0)


@pytest.mark.parametrize('kind', ['cloud', 'point', 'normal'])
def test_a_planted_duplicate(kind):
    """The first message counts, with its latency and its numbers; the second is counted."""
    log = played()
    log.answer(kind, stamp_of(20), stamp_of(20) + 50 * MS, [9.0] * (7 if kind == 'cloud' else 3))
    result = only(log)
    assert result.faults == ['1 duplicates']
    assert result.latency['max'] == pytest.approx(1e-3, abs=1e-12)
    assert result.point_error['max'] == 0.0


@pytest.mark.parametrize('row, contacts', [(20, 49), (21, 51)])
def test_a_wrong_verdict(row, contacts):
    """A contact that is missed, one that is not there: wrong, not lost, and without an error."""
    result = only(played(lambda at: {'touching': at % 2 == 1} if at == row else {}))
    assert (result.wrong_verdicts, result.lost, result.contacts) == (1, 0, contacts)
    assert result.faults == ['1 wrong verdicts']
    assert result.point_error['max'] == 0.0


def test_a_point_where_the_cloud_says_no_contact():
    """It is a contradiction, and does not move the latency."""
    log = played()
    log.answer('point', stamp_of(21), stamp_of(21) + 30 * MS, (0.0, 0.0, 0.0))
    result = only(log)
    assert result.faults == ['1 contradictions']
    assert result.latency['max'] == pytest.approx(1e-3, abs=1e-12)


def test_a_pair_that_could_not_be_evaluated_is_lost():
    """A row of NaN says so: neither answered nor a wrong verdict."""
    log = played(lambda row: {'lost': ('cloud', 'point', 'normal') if row == 20 else ()})
    log.answer('cloud', stamp_of(20), stamp_of(20) + MS, [math.nan] * 7)
    result = only(log)
    assert (result.not_evaluated, result.lost_evaluations, result.lost) == (1, 0, 1)
    assert result.wrong_verdicts == 0


def test_answers_to_no_pose_and_to_offers():
    """A stamp that nobody sent is counted; the answer to an offer is not a figure."""
    log = AnswerLog('contact', 'exact')
    log.offers.add(START - MS)
    answer(log, 0, first=START - MS)
    assert log.offers_answered == {START - MS}
    send(log)
    for row in range(PAIRS):
        answer(log, row)
    answer(log, 1, first=START + 3)
    result = only(log)
    assert result.faults == ['1 answers to no pose']
    assert (result.sent, result.answered) == (100, 100)


def test_a_stamp_is_sent_once():
    """Stamps are names: two pairs of one stamp could not be told apart."""
    log = AnswerLog('contact', 'exact')
    log.open('random', PAIRS, exact())
    log.sent(START)
    with pytest.raises(ValueError, match='sent twice'):
        log.sent(START)


def test_nothing_answered(tmp_path):
    """A dead node: all lost, no latency, and tables and picture still come."""
    log = AnswerLog('contact', 'exact')
    send(log)
    result = only(log)
    assert (result.answered, result.lost) == (0, 100)
    assert math.isnan(result.latency['p50']) and math.isnan(result.point_error['max'])
    assert 'nan' not in latency_table([result]) + error_table([result])
    draw(tmp_path / 'dead.png', [result], 'nothing to draw')
    draw(tmp_path / 'echo.png', [result, echo()], 'no errors to draw')


def echo(delay: int = MS // 2):
    log = AnswerLog('echo', '', ECHO_MESSAGES)
    send(log)
    for row in range(PAIRS):
        if row != 7:
            log.answer('echo', stamp_of(row), stamp_of(row) + delay)
    return only(log)


def test_tables_and_files(tmp_path):
    """The words of `ros2 topic delay`, and percentiles, the last of which is p99.9 [ms].

    The CSV has every figure, units in its head, and empty cells where there is none.
    """
    results = [only(played()), echo()]
    table = latency_table(results)
    for word in ('mean', 'min', 'max', 'std dev', 'window'):
        assert f' {word} ' in table
    assert table.splitlines()[2].split('|')[-2].strip() == '1.000'
    assert len(error_table(results).splitlines()) == 3, 'the echo has no errors'

    write_results(tmp_path / 'bench.csv', results, {'machine': 'one, two'})
    with (tmp_path / 'bench.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [row['node'] for row in rows] == ['contact', 'echo']
    assert list(rows[0]) == [*columns(results[0]), 'machine']
    assert float(rows[0]['latency_p999 [s]']) == pytest.approx(1e-3)
    assert float(rows[0]['point_error_max [m]']) == 0.0
    assert rows[1]['normal_error_p99 [deg]'] == ''
    assert rows[1]['machine'] == 'one, two'

    draw(tmp_path / 'bench.png', results, 'title')
    assert (tmp_path / 'bench.png').read_bytes().startswith(b'\x89PNG')
