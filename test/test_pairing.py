"""Which poses are answered together."""
from __future__ import annotations

import random

from box_contact_ros.pairing import WAITING_POSES, LatestPairing, StampPairing


def test_stamps_pair_in_any_order():
    """Two streams, each in any order within the ring: every stamp is answered exactly once."""
    rng = random.Random(1)
    pairing: StampPairing[str] = StampPairing()
    events = [(box, stamp) for stamp in range(1000) for box in (0, 1)]
    events.sort(key=lambda event: event[1] + rng.uniform(0, 50))
    answered = []
    for box, stamp in events:
        pair = pairing.add(box, stamp, f'{"ab"[box]}{stamp}')
        if pair is not None:
            assert pair == (f'a{stamp}', f'b{stamp}')
            answered.append(stamp)
    assert sorted(answered) == list(range(1000))
    assert pairing.dropped == 0


def test_poses_without_partner_are_dropped_and_counted():
    """Memory is bounded: the oldest waiting pose goes, the newest WAITING_POSES still pair."""
    pairing: StampPairing[int] = StampPairing()
    for stamp in range(WAITING_POSES + 10):
        assert pairing.add(0, stamp, stamp) is None
    assert pairing.dropped == 10
    assert pairing.add(1, 9, -1) is None
    assert pairing.add(1, 10, -2) == (10, -2)


def test_latest_answers_every_arrival():
    pairing: LatestPairing[str] = LatestPairing()
    assert pairing.add(0, 1, 'a1') is None
    assert pairing.add(0, 2, 'a2') is None
    assert pairing.add(1, 7, 'b7') == ('a2', 'b7')
    assert pairing.add(0, 3, 'a3') == ('a3', 'b7')
