# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which poses are answered together."""
from __future__ import annotations

import random

import numpy as np
import pytest

from box_contact_ros.scene.boxes import Box
from box_contact_ros.scene.scene import Pair, Scene, two_boxes
from box_contact_ros.stream.pairing import (
    NO_PARTNER,
    OLD,
    PAIRINGS,
    PATIENCE,
    REMEMBERED_STAMPS,
    REPEATED,
    RESET,
    RESETS,
    TOO_LATE,
    WAITING_TICKS,
    LatestPairing,
    RejectedPose,
    StampedPose,
    StampPairing,
)
from box_contact_ros.stream.streams import ALL_BOXES

TWO = two_boxes((2, 2, 2), (2, 2, 2))
MS = 1_000_000  # ns
HOUR = 3600 * 10**9
START = 10**17  # ns: a stamp of the host's clock


def scene(moving='abc', pairs=('ab', 'bc')):
    """Boxes that move, and pairs of them; `F` is a fixed one."""
    boxes = {name: Box((1.0, 1.0, 1.0)) for name in moving}
    boxes['F'] = Box((1.0, 1.0, 1.0), (0, 0, 0, 0, 0, 0, 1))
    return Scene(boxes, tuple(Pair(pair, *pair) for pair in pairs))


def pose(stamp):
    return StampedPose(np.zeros(7), 'map', stamp)


def stamps(ticks):
    """Stamps of the only tick, or None for no tick."""
    assert len(ticks) < 2
    return [entry and entry.stamp for entry in ticks[0]] if ticks else None


def play(pairing, events):
    """Give poses (box, stamp); return (number of the event, stamps of a tick) of all ticks."""
    return [(number, [entry and entry.stamp for entry in tick])
            for number, (box, stamp) in enumerate(events) for tick in pairing.add(box, pose(stamp))]


def stream(boxes, count, period=10 * MS, offsets=()):
    """Return the events of boxes that stamp each tick, by clocks that are off by `offsets` [ns]."""
    return [(box, START + number * period + dict(zip(boxes, offsets)).get(box, 0))
            for number in range(count) for box in boxes]


# --- each stamp once ------------------------------------------------------------------------------


def test_stamps_pair_in_any_order():
    """Two streams, each in any order within the ring: every stamp is answered exactly once."""
    rng = random.Random(1)
    pairing = StampPairing(TWO)
    events = [(box, stamp) for stamp in range(1000) for box in ('box_a', 'box_b')]
    events.sort(key=lambda event: event[1] + rng.uniform(0, 50))
    answered = [tick for _, tick in play(pairing, events)]
    assert sorted(answered) == [[stamp, stamp] for stamp in range(1000)]
    assert not pairing.counts


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize('policy', PAIRINGS)
def test_no_stamp_of_an_undisturbed_stream_is_answered_twice(policy, seed):
    """Three boxes at 1 kHz, late by up to 100 ms, one pose in a hundred lost."""
    rng = random.Random(seed)
    pairing = PAIRINGS[policy](scene(), max_age=1000 * MS)
    events = [(stamp + rng.choice((0, rng.uniform(0, 100))), box, stamp * MS)
              for stamp in range(2000) for box in 'abc' if rng.random() > 0.01]
    ticks = [tuple(tick) for _, tick in play(pairing, [event[1:] for event in sorted(events)])]
    assert len(ticks) == len(set(ticks))
    if policy == 'stamp':
        newest = [max(filter(None, tick), default=0) for tick in ticks]
        assert len(newest) == len(set(newest)) and len(newest) > 1900
    assert pairing.counts[RESETS] == pairing.counts[REPEATED] == 0


def test_no_pose_is_lost_that_comes_within_a_few_periods():
    """Five boxes, each late by a time of its own that varies, in the order of its stamps."""
    rng = random.Random(2)
    pairing = StampPairing(scene('abcde', ('ab', 'bc', 'de')), max_age=1000 * MS)
    events = sorted((number + lag * (PATIENCE - 1) + rng.uniform(0, 1), box, START + number * MS)
                    for box, lag in zip('abcde', (0.0, 0.3, 1.0, 0.6, 0.1))
                    for number in range(1000))
    ticks = [tick for _, tick in play(pairing, [event[1:] for event in events])]
    assert len(ticks) == 1000 and all(None not in tick for tick in ticks)
    assert not pairing.counts


def test_copies_are_refused_and_counted():
    """Each message comes several times, at once or up to 100 ticks later."""
    pairing = StampPairing(TWO)
    events = [(box, copy) for stamp in range(3 * REMEMBERED_STAMPS) for box in TWO.moving
              for copy in (stamp, stamp, stamp - 100) if copy >= 0]
    assert len(play(pairing, events)) == 3 * REMEMBERED_STAMPS
    assert pairing.counts == {REPEATED: 2 * (6 * REMEMBERED_STAMPS - 100)}


def test_stamps_that_stand_still_are_refused_and_noted():
    pairing = StampPairing(TWO)
    assert len(play(pairing, [(box, 0) for _ in range(1000) for box in TWO.moving])) == 1
    assert pairing.counts == {REPEATED: 1998}
    assert pairing.rejections == {REPEATED: RejectedPose('box_b', 0, 0, stamps=1)}


def test_a_stamp_older_than_all_that_are_remembered_is_refused():
    pairing = StampPairing(TWO)
    play(pairing, [('box_a', stamp) for stamp in range(1, REMEMBERED_STAMPS + 2)])
    assert not pairing.add('box_a', pose(1)) and pairing.counts[OLD] == 1


def test_poses_without_partner_are_dropped_and_counted():
    """Memory is bounded: the oldest waiting pose goes, the newest WAITING_TICKS still pair."""
    pairing = StampPairing(TWO)
    assert not play(pairing, [('box_a', stamp) for stamp in range(WAITING_TICKS + 10)])
    assert pairing.counts == {NO_PARTNER: 10}
    assert pairing.add('box_b', pose(10))
    assert not pairing.add('box_b', pose(9))


# --- a box that is late, silent, or stamped by another clock --------------------------------------


@pytest.mark.parametrize('offset', [-HOUR, -10 * RESET, -RESET, -RESET // 2, -77 * MS, -1, 1,
                                    77 * MS, RESET // 2, RESET, HOUR])
def test_a_box_whose_clock_is_off_holds_up_nobody(offset):
    """Box c never agrees. After some ticks, a and b are answered within one period."""
    pairing = StampPairing(scene(), max_age=RESET)
    events = stream('abc', 300, offsets=(0, 0, offset))
    answered = {tick[0]: number // 3 for number, tick in play(pairing, events) if tick[0]}
    delays = [answered[START + number * 10 * MS] - number for number in range(290)]
    assert max(delays) <= PATIENCE and max(delays[2 * PATIENCE:]) <= 1
    assert pairing.counts[RESETS] == 0


@pytest.mark.parametrize('ahead', [2 * RESET, HOUR, 10**18])
def test_one_pose_far_ahead_costs_nothing(ahead):
    """Box c gives one stamp an hour ahead, then good ones: it misses one tick, a and b none."""
    pairing = StampPairing(scene(), max_age=RESET)
    events = stream('abc', 100)
    events.insert(150, ('c', START + ahead))
    ticks = [tick for _, tick in play(pairing, events)]
    assert [tick[0] for tick in ticks] == [START + number * 10 * MS for number in range(100)]
    assert sum(tick[2] is None for tick in ticks) == 1 and pairing.counts == {TOO_LATE: 1}


@pytest.mark.parametrize('policy', PAIRINGS.values())
@pytest.mark.parametrize('pair', ['cF', 'cd'])
@pytest.mark.parametrize('ahead, behind', [(2, -2), (0, -2), (HOUR // RESET, -HOUR // RESET)])
def test_a_box_with_two_clocks_costs_an_unrelated_pair_no_tick(policy, pair, ahead, behind):
    """Box c is stamped by one and the other in turn; a and b are answered within one period."""
    pairing = policy(scene('abcd', ('ab', pair)), max_age=RESET)
    events = [(box, stamp + RESET * (ahead, behind)[number // 3 % 2] * (box == 'c'))
              for number, (box, stamp) in enumerate(stream('abc', 1500))]
    answered = {tick[0]: number // 3 for number, tick in play(pairing, events)
                if tick[0] and tick[0] == tick[1]}
    delays = [answered[START + number * 10 * MS] - number for number in range(1500 - PATIENCE)]
    assert max(delays) <= PATIENCE and max(delays[2 * PATIENCE:]) <= 1
    assert pairing.counts[RESETS] == 0


@pytest.mark.parametrize('every', [2, 10, 100])
@pytest.mark.parametrize('order', ['abc', 'cab'])
def test_a_slower_box_is_awaited_when_its_pose_is_due(every, order):
    """Box c gives each tenth pose: after one that it misses, all; a and b wait a period at most."""
    pairing = StampPairing(scene(), max_age=RESET)
    events = [(box, stamp) for box, stamp in stream(order, 10 * every)
              if box != 'c' or (stamp - START) // (10 * MS) % every == 0]
    places = {event: number for number, event in enumerate(events)}
    answered = play(pairing, events)
    assert [tick[2] is not None for _, tick in answered].count(True) >= 9
    delays = [(number - places['b', tick[1]]) // 2 for number, tick in answered]
    assert max(delays) <= PATIENCE and max(delays[2 * every:]) <= 1


def test_a_silent_box_costs_the_others_no_tick():
    """Box c ends; a and b go on: each tick of theirs is answered once, soon at once."""
    pairing = StampPairing(scene(), max_age=500 * MS)
    events = [event for event in stream('abc', 1000) if event[0] != 'c' or event[1] == START]
    answered = play(pairing, events)
    assert [tick[0] for _, tick in answered] == sorted({stamp for _, stamp in events})
    assert answered[0][1] == [START] * 3 and all(tick[2] is None for _, tick in answered[1:])
    assert [number for number, _ in answered[20:]] == list(range(42, len(events), 2))
    assert pairing.stale() == ['c'] and not pairing.counts


def test_a_box_that_is_back_is_awaited_again():
    """Box c pauses for 50 ticks: the first pose of its return is late, those behind it are not."""
    pairing = StampPairing(scene(), max_age=RESET)
    events = [event for event in stream('abc', 150)
              if event[0] != 'c' or not 50 <= (event[1] - START) // (10 * MS) < 100]
    ticks = [tick for _, tick in play(pairing, events)]
    assert [tick[2] is None for tick in ticks] == 50 * [False] + 51 * [True] + 49 * [False]
    assert pairing.counts == {TOO_LATE: 1}


def test_the_first_tick_waits_for_all_boxes_and_later_ones_not_for_one_that_never_came():
    pairing = StampPairing(scene(), max_age=RESET)
    events = [event for event in stream('abc', 20) if event[0] != 'c']
    answered = play(pairing, events)
    assert answered[0][0] == 2 * PATIENCE + 1  # the pose that makes the fifth later tick whole
    assert len(answered) == 20 and pairing.unseen() == ['c'] and pairing.stale() == []


def test_a_tick_that_was_answered_is_not_answered_again():
    """Box b falls silent, and its poses come after all: their ticks were answered without it."""
    for tolerance in (0, MS // 4):
        pairing = StampPairing(scene('ab', ['aF', 'bF']), max_age=3 * MS, tolerance=tolerance)
        answered = []
        for stamp in range(MS, 30 * MS, MS):
            for box in 'ba' if stamp < 5 * MS or stamp >= 20 * MS else 'a':
                answered += [tick[0].stamp // MS for tick in pairing.add(box, pose(stamp))]
            if stamp == 12 * MS:
                for late in (5, 6, 7):
                    assert not pairing.add('b', pose(late * MS + tolerance))
        assert answered == list(range(1, 30))
        assert pairing.counts == {TOO_LATE: 3}


def test_after_a_pause_nobody_is_stale():
    """All boxes stop and go on later, a simulation that is paused: each tick is whole."""
    pairing = StampPairing(TWO, max_age=50 * MS)
    for stamp in (0, MS, 1000 * MS, 5000 * MS):
        assert not pairing.add('box_a', pose(stamp))
        assert stamps(pairing.add('box_b', pose(stamp))) == [stamp, stamp]
        assert pairing.stale() == []


# --- time that is set back ------------------------------------------------------------------------


@pytest.mark.parametrize('policy', PAIRINGS.values())
def test_time_set_back_begins_anew(policy):
    """A simulation starts again: its first tick is answered, and no pose of the old time is."""
    pairing = policy(scene(), max_age=100 * MS)
    play(pairing, [(box, 5 * RESET + number * MS) for number in range(10) for box in 'abc'])
    assert not any(None not in tick for tick in pairing.add('a', pose(0)))
    pairing.add('b', pose(0))
    assert stamps(pairing.add('c', pose(0))) == [0, 0, 0]
    assert pairing.counts[RESETS] == 1
    assert pairing.rejections[RESETS][:3] == ('b', 0, 5 * RESET + 9 * MS)


@pytest.mark.parametrize('step', [13 * MS, 153 * MS, 797 * MS, 999 * MS])
@pytest.mark.parametrize('order', ['abc', 'cab'])
def test_time_set_back_by_less_than_a_second_costs_no_pose(step, order):
    """All poses of a tick come together, and each tick is answered at once with all of them."""
    pairing = StampPairing(scene(), max_age=RESET)
    events = [(box, stamp - step * ((stamp - START) // RESET)) for box, stamp in stream(order, 400)]
    ticks = play(pairing, events)
    assert [number for number, _ in ticks] == list(range(2, 1200, 3))
    assert all(None not in tick for _, tick in ticks) and not pairing.counts


def test_after_a_restart_the_first_box_waits_for_the_second():
    """Although it has a pair with a fixed box, and the second one has a later stamp."""
    pairing = StampPairing(scene('ab', ('ab', 'aF')), max_age=RESET)
    play(pairing, stream('ab', 20))
    assert not play(pairing, [('a', 0), ('a', MS)])
    assert play(pairing, [('b', 0), ('b', MS)]) == [(0, [0, 0]), (1, [MS, MS])]
    assert pairing.counts == {RESETS: 1}


def test_what_waited_when_time_was_set_back_is_counted():
    pairing = StampPairing(TWO)
    play(pairing, [('box_a', 5 * RESET), ('box_b', 5 * RESET), ('box_a', 6 * RESET)])
    assert play(pairing, [('box_a', 0), ('box_b', 0)]) == [(1, [0, 0])]
    assert pairing.counts == {RESETS: 1, NO_PARTNER: 1}


def test_boxes_that_never_came_are_told_from_those_that_did():
    for policy in PAIRINGS.values():
        pairing = policy(TWO)
        assert pairing.unseen() == ['box_a', 'box_b']
        pairing.add('box_a', pose(MS))
        pairing.reset()
        assert pairing.unseen() == ['box_b']


# --- tolerance, all in one message, latest --------------------------------------------------------


def test_tolerance_joins_the_nearest_stamps():
    """Streams of different clocks: each pose is used once, with the nearest within tolerance."""
    pairing = StampPairing(TWO, tolerance=3 * MS)
    for stamp in (0, 10 * MS, 20 * MS):
        assert not pairing.add('box_a', pose(stamp))
    assert stamps(pairing.add('box_b', pose(9 * MS))) == [10 * MS, 9 * MS]
    assert stamps(pairing.add('box_b', pose(22 * MS))) == [20 * MS, 22 * MS]
    assert not pairing.add('box_b', pose(14 * MS))


def test_a_pose_that_gives_way_to_a_nearer_one_is_counted():
    """Two poses of a box within tolerance of one tick: that of its very stamp is answered."""
    pairing = StampPairing(scene(), tolerance=10)
    assert not pairing.add('b', pose(100))
    assert not pairing.add('a', pose(95))
    assert not pairing.add('a', pose(100))
    assert stamps(pairing.add('c', pose(100))) == [100, 100, 100]
    assert pairing.counts == {NO_PARTNER: 1}


@pytest.mark.parametrize('policy', PAIRINGS.values())
def test_one_message_has_all_poses_of_its_tick(policy):
    boxes = {name: Box((1.0, 1.0, 1.0)) for name in 'ab'}
    pairing = policy(Scene(boxes, (Pair('', 'a', 'b'),), poses='named'))
    assert [stamps(pairing.add(ALL_BOXES, pose(stamp))) for stamp in (1, 2)] == [[1], [2]]


def test_latest_answers_every_arrival():
    pairing = LatestPairing(TWO)
    assert not pairing.add('box_a', pose(1))
    assert not pairing.add('box_a', pose(2))
    assert stamps(pairing.add('box_b', pose(7))) == [2, 7]
    assert stamps(pairing.add('box_a', pose(3))) == [3, 7]
    assert stamps(pairing.add('box_a', pose(3))) == [3, 7]  # a publisher that does not stamp
    assert not pairing.add('box_a', pose(2))
    assert pairing.counts == {OLD: 1}


@pytest.mark.parametrize('late', ['box_a', 'box_b'])
def test_latest_never_answers_with_an_old_pose(late):
    """Beyond max_age a box's last pose is None in the tick, whichever box is behind."""
    other = {'box_a': 'box_b', 'box_b': 'box_a'}[late]
    pairing = LatestPairing(TWO, max_age=100 * MS)
    pairing.add(late, pose(0))
    assert None not in stamps(pairing.add(other, pose(100 * MS)))
    tick = stamps(pairing.add(other, pose(101 * MS)))
    assert tick[late == 'box_b'] is None and pairing.stale() == [late]
