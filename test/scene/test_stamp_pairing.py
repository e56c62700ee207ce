# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which poses are answered together."""
from __future__ import annotations

import random
from collections import Counter

import numpy as np
import pytest

from box_contact_ros.scene.scene_solver import Box, Pair, Scene, two_boxes
from box_contact_ros.scene.stamp_pairing import (
    AGAIN,
    AHEAD,
    NEVER,
    NO_PARTNER,
    OLD,
    PAIRINGS,
    REMEMBERED_STAMPS,
    REPEATED,
    RESET,
    RESETS,
    TOO_LATE,
    WAITING_TICKS,
    LatestPairing,
    Note,
    StampedPose,
    StampPairing,
)

TWO = two_boxes((2, 2, 2), (2, 2, 2))
MS = 1_000_000  # ns


def scene(moving='abc', pairs=('ab', 'bc')):
    """Boxes that move, and pairs of them; `F` is a fixed one."""
    boxes = {name: Box(name, (1.0, 1.0, 1.0), pose_topic=f'{name}/pose') for name in moving}
    boxes['F'] = Box('F', (1.0, 1.0, 1.0), (0, 0, 0, 0, 0, 0, 1))
    return Scene(boxes, tuple(Pair(n, pair, *pair) for n, pair in enumerate(pairs)))


def pose(stamp):
    return StampedPose(np.zeros(7), 'map', stamp)


def stamps(ticks):
    """Stamps of the only tick, or None for no tick."""
    assert len(ticks) < 2
    return [entry and entry.stamp for entry in ticks[0]] if ticks else None


def test_stamps_pair_in_any_order():
    """Two streams, each in any order within the ring: every stamp is answered exactly once."""
    rng = random.Random(1)
    pairing = StampPairing(TWO)
    events = [(box, stamp) for stamp in range(1000) for box in ('box_a', 'box_b')]
    events.sort(key=lambda event: event[1] + rng.uniform(0, 50))
    answered = []
    for box, stamp in events:
        ticks = pairing.add(box, pose(stamp))
        if ticks:
            assert stamps(ticks) == [stamp, stamp]
            answered.append(stamp)
    assert sorted(answered) == list(range(1000))
    assert not pairing.counts


def test_poses_without_partner_are_dropped_and_counted():
    """Memory is bounded: the oldest waiting pose goes, the newest WAITING_TICKS still pair."""
    pairing = StampPairing(TWO)
    for stamp in range(WAITING_TICKS + 10):
        assert not pairing.add('box_a', pose(stamp))
    assert pairing.counts == {NO_PARTNER: 10}
    assert pairing.add('box_b', pose(10))
    assert not pairing.add('box_b', pose(9))


def test_no_stamp_is_answered_twice():
    """Each message comes several times, at once or up to 100 ticks later: one answer, and a count.

    The copies come between newer poses, so they are no loop.
    """
    pairing = StampPairing(TWO)
    answers = 0
    for stamp in range(3 * REMEMBERED_STAMPS):
        for box in ('box_a', 'box_b'):
            for copy in (stamp, stamp, stamp - 100):
                if copy >= 0:
                    answers += len(pairing.add(box, pose(copy)))
    assert answers == 3 * REMEMBERED_STAMPS
    assert pairing.counts == {REPEATED: 2 * (6 * REMEMBERED_STAMPS - 100)}


def undisturbed(rng, boxes):
    """Ticks at 1 kHz, late by up to 128, some poses lost; each stamp of a box comes once.

    Executors deliver a box's poses in a row, so all poses of a tick share some of the lateness.
    """
    events = []
    for stamp in range(2000):
        late = rng.choice((0, rng.uniform(0, 64)))
        events += [(stamp + late + rng.choice((0, rng.uniform(0, 63))), box, stamp * MS)
                   for box in boxes if rng.random() > 0.01]
    return [event[1:] for event in sorted(events)]


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize('policy', PAIRINGS)
def test_no_stamp_of_an_undisturbed_stream_is_answered_twice(policy, seed):
    """Whatever the order in which its poses arrive: time is never taken for set back."""
    rng = random.Random(seed)
    pairing = PAIRINGS[policy](scene(), max_age=1000 * MS)
    answered = []
    for box, stamp in undisturbed(rng, 'abc'):
        for tick in pairing.add(box, pose(stamp)):
            answered.append(tuple(entry and entry.stamp for entry in tick))
    assert len(answered) == len(set(answered))
    if policy == 'stamp':
        newest = [max(filter(None, tick), default=0) for tick in answered]
        assert len(newest) == len(set(newest)) and len(newest) > 1900
    assert pairing.counts[RESETS] == pairing.counts[REPEATED] == 0


@pytest.mark.parametrize('policy, ticks', [
    ('stamp', AGAIN + 1), ('stamp', 10), ('stamp', 900), ('stamp', 2 * REMEMBERED_STAMPS),
    ('latest', AGAIN + 1), ('latest', 10), ('latest', 900)])
def test_a_loop_shorter_than_a_second_is_answered_each_time(policy, ticks):
    """A recording played in a loop: all its ticks, from the first loop to the last."""
    pairing = PAIRINGS[policy](TWO)
    step = 999 * MS // ticks
    for number in range(4):
        answered = {max(stamps([tick])) for stamp in range(ticks) for box in TWO.moving
                    for tick in pairing.add(box, pose(stamp * step)) if None not in tick}
        assert answered == {stamp * step for stamp in range(ticks)}
        assert pairing.counts[RESETS] == number
    assert pairing.counts[REPEATED] == pairing.counts[OLD] == 0


def test_a_loop_begins_before_the_last_poses_of_the_old_one_are_in():
    """Box b is behind by three poses at each turn: a few ticks of a loop are lost, no more."""
    pairing = StampPairing(TWO)
    a, b = ([(box, stamp) for _ in range(10) for stamp in range(100)] for box in TWO.moving)
    answered = 0
    for one, other in zip([*a, *[None] * 3], [*[None] * 3, *b]):
        for event in filter(None, (one, other)):
            answered += len(pairing.add(event[0], pose(event[1] * MS)))
    assert pairing.counts[RESETS] == 9 and answered >= 10 * 95


@pytest.mark.parametrize('policy', PAIRINGS)
@pytest.mark.parametrize('first', [1, 4])
def test_a_simulator_that_is_started_anew_is_answered(policy, first):
    """It waits for the answer of its first tick, which has a stamp of the run before.

    The pose that came before its publishers were known to have gone may be refused.
    """
    counts = Counter()
    pairing = PAIRINGS[policy](TWO, counts=counts)

    def tick(number):
        return [ticks for box in ('box_a', 'box_b')
                for ticks in pairing.add(box, pose(number * 5 * MS))]

    assert all(tick(number) for number in (1, 2, 3))
    pairing.desert()
    assert tick(4) and counts[RESETS] == 0  # it goes on where it was
    takes_it = policy == 'latest' and first == 4  # it answers its newest stamp again
    assert bool(tick(first)) == takes_it
    pairing.desert()
    for number in range(first, 7):
        assert [one.stamp for one in tick(number)[-1]] == 2 * [number * 5 * MS]
    assert counts[RESETS] == (not takes_it)


def test_stamps_that_stand_still_are_no_loop():
    """Zero for ever, or the same few stamps: refused and noted, with what the log needs."""
    pairing = StampPairing(TWO)
    for number in range(1000):
        for box in TWO.moving:
            assert len(pairing.add(box, pose(0))) == (number == 0 and box == 'box_b')
    assert pairing.counts == {REPEATED: 1998}
    assert pairing.notes == {REPEATED: Note('box_b', 0, 0)}
    for number in range(1000):
        for box in TWO.moving:
            pairing.add(box, pose(number % AGAIN * MS))
    assert RESETS not in pairing.counts


@pytest.mark.parametrize('periods, offset', [
    ((100, 100), 31), ((100, 100), 50), ((100, 10), 4), ((10, 100), 47), ((100, 100), 1e-6)])
def test_the_proposed_tolerance_joins_stamps_that_never_agree(periods, offset):
    """Publishers that know nothing of each other; with that tolerance the slower one is answered.

    Each period varies by a per cent, as those of timers do.
    """
    rng = random.Random(1)
    events = sorted((round((n * period + offset * k + rng.uniform(-0.01, 0.01) * period) * MS), box)
                    for k, (box, period) in enumerate(zip(TWO.moving, periods))
                    for n in range(4000 // period))
    pairing = StampPairing(TWO)
    assert not any(pairing.add(box, pose(stamp)) for stamp, box in events)
    found = pairing.mismatch([TWO.moving])
    assert {found.one, found.other} == set(TWO.moving)
    assert 0 < found.difference <= found.tolerance <= 0.7 * min(periods) * MS
    pairing = StampPairing(TWO, tolerance=found.tolerance)
    answered = sum(len(pairing.add(box, pose(stamp))) for stamp, box in events)
    assert answered >= 4000 / max(periods) - 2
    assert pairing.mismatch([TWO.moving]) is None


def test_no_tolerance_joins_two_clocks():
    """One box in simulated time, one in the host's."""
    pairing = StampPairing(TWO)
    for n in range(20):
        pairing.add('box_a', pose(n * 100 * MS))
        pairing.add('box_b', pose(n * 100 * MS + 10**18))
    assert pairing.mismatch([TWO.moving])[2:] == (pytest.approx(10**18, rel=1e-8), 0)


def test_boxes_that_never_came_are_told_from_those_that_did():
    for policy in PAIRINGS.values():
        pairing = policy(TWO)
        assert pairing.unseen() == ['box_a', 'box_b']
        pairing.add('box_a', pose(MS))
        pairing.reset()
        assert pairing.unseen() == ['box_b']


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


def test_a_box_that_fell_silent_is_waited_for_until_it_is_stale():
    """Box b ends: a's ticks wait for max_age, then are answered at once without b.

    Then b is said to be stale; when it is back, it is waited for again.
    """
    pairing = StampPairing(TWO, max_age=50 * MS)
    pairing.add('box_a', pose(0))
    assert stamps(pairing.add('box_b', pose(0))) == [0, 0]
    answers = {stamp: pairing.add('box_a', pose(stamp * MS)) for stamp in range(1, 100)}
    # The first tick that lacks b is that of 1 ms.
    assert not any(answers[stamp] for stamp in range(1, 52))
    assert all(stamps(answers[stamp]) == [stamp * MS, None] for stamp in range(53, 100))
    # Those that waited cannot be evaluated, now that b is stale.
    assert stamps(answers[52]) == [52 * MS, None] and pairing.counts == {NO_PARTNER: 51}
    assert pairing.stale() == ['box_b']
    pairing.add('box_b', pose(100 * MS))
    assert stamps(pairing.add('box_a', pose(100 * MS))) == [100 * MS, 100 * MS]
    assert pairing.stale() == []
    assert not pairing.add('box_a', pose(101 * MS))


def test_after_a_pause_nobody_is_stale():
    """All boxes stop and go on later, a simulation that is paused: the first tick is whole."""
    pairing = StampPairing(TWO, max_age=50 * MS)
    for stamp in (0, MS, 1000 * MS, 5000 * MS):
        assert not pairing.add('box_a', pose(stamp))
        assert stamps(pairing.add('box_b', pose(stamp))) == [stamp, stamp]
        assert pairing.stale() == []
    # Also where the last tick before it lacked one.
    pairing.add('box_a', pose(5001 * MS))
    assert not pairing.add('box_a', pose(9000 * MS))
    assert stamps(pairing.add('box_b', pose(9000 * MS))) == [9000 * MS, 9000 * MS]


def test_a_silent_box_costs_the_others_no_tick():
    """Box c ends; a and b go on at 1 kHz: each tick of theirs is answered once.

    It is answered with the pair of c stale, late where c was waited for, then at once.
    """
    pairing = StampPairing(scene(), max_age=500 * MS)
    for box in 'abc':
        ticks = pairing.add(box, pose(0))
    assert stamps(ticks) == [0, 0, 0]
    answered = []
    for stamp in range(MS, 1000 * MS, MS):
        for box in 'ab':
            for tick in pairing.add(box, pose(stamp)):
                assert tick[0].stamp == tick[1].stamp and tick[2] is None
                answered.append(tick[0].stamp)
    assert answered == list(range(MS, 1000 * MS, MS)) and not pairing.counts


def test_no_tick_is_answered_further_behind_than_the_newest_that_wait():
    """Both boxes have pairs with a fixed one. Of b one pose in 1000 is lost: it delays one tick."""
    pairing = StampPairing(scene('ab', ['aF', 'bF']), max_age=1000 * MS)
    answered = []
    for stamp in range(5000):
        for box in 'ab':
            if (box, stamp % 1000) != ('b', 500):
                for tick in pairing.add(box, pose(stamp * MS)):
                    answered.append(tick[0].stamp // MS)
                    assert stamp - answered[-1] <= WAITING_TICKS
    assert sorted(answered) == list(range(5000))
    assert not pairing.counts


@pytest.mark.parametrize('lost', ['a', 'b'])
def test_a_lost_pose_does_not_hold_up_ticks_that_wait_for_a_stale_box(lost):
    """Both boxes have pairs with a fixed one. A tick lacks a pose of one box; later b falls silent.

    That tick may still be completed, by a pose that comes late. The others are not kept by it.
    """
    pairing = StampPairing(scene('ab', ['aF', 'bF']), max_age=10 * MS)
    answered = []
    for stamp in range(MS, 60 * MS, MS):
        for box in 'ab' if stamp < 30 * MS else 'a':
            if (box, stamp) != (lost, 20 * MS):
                answered += [{entry.stamp // MS for entry in tick if entry}
                             for tick in pairing.add(box, pose(stamp))]
    assert all(len(stamps) == 1 for stamps in answered)
    assert [stamp for tick in answered for stamp in tick if stamp != 20] == [
        stamp for stamp in range(1, 60) if stamp != 20]


@pytest.mark.parametrize('tolerance', [0, MS // 4])
def test_a_tick_that_was_answered_is_not_answered_again(tolerance):
    """Box b is stale, and its poses come after all: their ticks have been answered without it."""
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


def test_scene_changes_cost_the_others_no_tick():
    """A box comes and goes while a and b stream: each of their stamps is answered once."""
    pairing = StampPairing(scene('ab', ['ab']), max_age=1000 * MS)
    answered = []
    for stamp in range(300):
        for box in 'ab':
            ticks = pairing.add(box, pose(stamp * MS))
            if box == 'a' and stamp == 100:  # between the poses of a tick
                pairing.set_scene(scene('abc', ['ab', 'bc']))
            if box == 'a' and stamp == 200:
                pairing.set_scene(scene('ab', ['ab']))
            answered += [tick[0].stamp // MS for tick in ticks]
    assert answered == list(range(300))


@pytest.mark.parametrize('tolerance', [0, MS // 4])
def test_a_box_that_joins_has_no_stamp_answered_again(tolerance):
    """Its first poses are of ticks that were answered before it was there; the next are in time."""
    pairing = StampPairing(scene('ab', ['ab']), max_age=1000 * MS, tolerance=tolerance)
    answered = []
    for stamp in range(100):
        if stamp == 50:
            pairing.set_scene(scene('abc', ['ab', 'cF']))
            for early in (40, 49):
                assert not pairing.add('c', pose(early * MS + tolerance))
        for box in 'abc' if stamp >= 50 else 'ab':
            answered += pairing.add(box, pose(stamp * MS))
    assert [tick[0].stamp // MS for tick in answered] == list(range(100))
    assert all(len(tick) == 2 for tick in answered[:50])
    assert all(None not in tick for tick in answered[50:])
    assert pairing.counts == {TOO_LATE: 2}


def test_a_box_that_went_counts_for_no_tick():
    """Its pose waits with b's when it goes and c comes: the tick waits for c all the same."""
    pairing = StampPairing(scene('ax', ['ax']))
    assert pairing.add('x', pose(MS)) == []
    pairing.set_scene(scene('abc', ['ab', 'bc']))
    assert pairing.add('a', pose(MS)) == []
    assert pairing.add('b', pose(MS)) == []
    assert stamps(pairing.add('c', pose(MS))) == [MS, MS, MS]


def test_time_set_back_begins_anew():
    """A simulation that starts again: what waited is dropped and counted.

    The first tick of the new time is answered, and no pose of the old time is.
    """
    for pairing in (StampPairing(TWO, max_age=100 * MS), LatestPairing(TWO, max_age=100 * MS)):
        for stamp in range(5 * RESET, 5 * RESET + 10 * MS, MS):
            pairing.add('box_a', pose(stamp))
            pairing.add('box_b', pose(stamp))
        pairing.add('box_a', pose(6 * RESET))
        assert not pairing.add('box_a', pose(0))  # not with the old pose of b
        assert stamps(pairing.add('box_b', pose(0))) == [0, 0]
        assert pairing.counts[RESETS] == 1
    assert StampPairing(TWO).counts[NO_PARTNER] == 0


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


@pytest.mark.parametrize('policy', [StampPairing, LatestPairing])
def test_a_fixed_box_is_in_every_tick(policy):
    """LAW: the ticks are those of a scene without it, with its pose added, at any stamps."""
    three, two = scene(), scene('ac', ['ac'])
    rng = random.Random(5)
    pairing, plain = policy(three, max_age=20, tolerance=1), policy(two, max_age=20, tolerance=1)
    always = pose(NEVER)
    assert pairing.fix('b', always) == []
    events = [(box, stamp) for stamp in range(200) for box in 'ac' if rng.random() < 0.8]
    events.sort(key=lambda event: event[1] + rng.uniform(0, 3))
    answered = 0
    for box, stamp in events:
        one = pose(stamp)
        wanted = plain.add(box, one)
        found = pairing.add(box, one)
        assert all(tick[1] is always for tick in found)
        # With a fixed partner a box alone is worth a tick: b takes part in both pairs.
        whole = [[a, c] for a, _, c in found if policy is StampPairing or (a and c)]
        assert [tick for tick in whole if None not in tick] == [
            tick for tick in wanted if None not in tick]
        answered += len(wanted)
    assert answered > 100 and 'b' not in pairing.stale() + pairing.unseen()


HOUR = 3600 * 10**9


def play(pairing, boxes, stamps_of_ticks):
    """Give a pose of each box at each stamp; return the stamps that are answered, as they come."""
    return [(stamp, [next(entry.stamp for entry in tick if entry) for tick in pairing.add(
        box, pose(stamp))]) for stamp in stamps_of_ticks for box in boxes]


def answered_at_once(played):
    """Return the stamps whose tick is answered at the last of their poses, and no other is."""
    return [stamp for stamp, ticks in played if ticks == [stamp]]


@pytest.mark.parametrize('begins', [0, 50])
@pytest.mark.parametrize('ahead', [HOUR, 10**18, 4 * RESET])
def test_a_silent_box_that_is_ahead_once_costs_the_others_nothing(begins, ahead):
    """Box c gives one pose an hour ahead: a and b are answered as where it gives none.

    All their contacts were late by max_age from then on.
    """
    attacked, plain = (StampPairing(scene(), max_age=RESET) for _ in range(2))
    ticks = [10**17 + n * MS for n in range(2000)]
    for pairing in (attacked, plain):
        play(pairing, 'abc', ticks[:1])
        play(pairing, 'ab', ticks[1:begins])
    assert attacked.add('c', pose(ticks[begins] + ahead)) == []
    assert attacked.counts[AHEAD] == 1 and attacked.ahead() == ['c']
    assert attacked.notes[AHEAD] == Note('c', ticks[begins] + ahead, ticks[max(begins - 1, 0)])
    rest = ticks[max(begins, 1):]
    assert play(attacked, 'ab', rest) == play(plain, 'ab', rest)
    assert attacked.stale() == plain.stale() == ['c']


@pytest.mark.parametrize('policy', PAIRINGS)
def test_a_stream_ahead_is_refused_and_counted(policy):
    """Box c stamps by another clock: each of its poses is refused, a and b are answered as ever."""
    with_c, without = (PAIRINGS[policy](scene(), max_age=RESET) for _ in range(2))
    for pairing in (with_c, without):
        play(pairing, 'abc', [10**17])
    for n in range(1, 3000):
        stamp = 10**17 + n * MS
        assert with_c.add('c', pose(stamp + HOUR)) == []
        for box in 'ab':
            assert [stamps([tick]) for tick in with_c.add(box, pose(stamp))] == [
                stamps([tick]) for tick in without.add(box, pose(stamp))]
    assert with_c.counts[AHEAD] == 2999


def test_poses_that_are_early_are_taken_when_the_others_come_as_far():
    """Of c nearly 2 max_age come before a and b: executors serve one subscription first."""
    pairing = StampPairing(scene(), max_age=20 * MS)
    play(pairing, 'abc', [0])
    ticks = [n * MS for n in range(1, 40)]
    early = play(pairing, 'c', ticks)
    assert not any(found for _, found in early) and pairing.counts[AHEAD] == 19
    played = play(pairing, 'ab', ticks)
    assert sum((found for _, found in played), []) == ticks
    assert +pairing.counts == {} and pairing.ahead() == [] and AHEAD not in pairing.notes


def test_a_box_alone_goes_on():
    """Boxes b and c end, a goes on; its first poses beyond max_age wait, then all are answered."""
    pairing = StampPairing(scene('abc', ['aF', 'bF', 'cF']), max_age=50 * MS)
    play(pairing, 'abc', [0])
    ticks = [n * MS for n in range(1, 300)]
    played = play(pairing, 'a', ticks)
    assert sum((found for _, found in played), []) == ticks
    assert answered_at_once(played[110:]) == ticks[110:] and +pairing.counts == {}
    # Another one comes back, at a time of its own: both are answered.
    for stamp in ticks[:50]:
        assert play(pairing, 'a', [stamp + HOUR])[0][1] in ([], [stamp + HOUR])
        pairing.add('b', pose(stamp + RESET // 2))


def test_a_box_that_joins_after_one_was_ahead_is_answered():
    """The tick of a box ahead closes no time to others."""
    pairing = StampPairing(scene('abc', ['ab', 'cF']), max_age=50 * MS)
    pairing.add('c', pose(HOUR))
    play(pairing, 'ab', [n * MS for n in range(100)])
    pairing.set_scene(scene('abcd', ['ab', 'cF', 'da']))
    play(pairing, 'dab', [200 * MS])
    assert play(pairing, 'abd', [201 * MS])[-1][1] == [201 * MS]
