# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The streams of poses: seeded, of exact length, and what their names promise."""
from __future__ import annotations

import numpy as np
import pytest

from box_contact_ros import ContactSolver
from box_contact_ros.bench.pose_streams import STREAMS, by_sizes, make_stream


@pytest.mark.parametrize('name', STREAMS)
def test_streams_are_what_they_are_called(name):
    """Seeded, as many pairs as asked for, for the sizes that they name, in contact or not."""
    stream, again = make_stream(name, 60, seed=5), make_stream(name, 60, seed=5)
    other = make_stream(name, 60, seed=6)
    assert len(stream) == 60 and stream.pose_a.shape == stream.pose_b.shape == (60, 7)
    assert np.array_equal(stream.pose_a, again.pose_a)
    assert np.array_equal(stream.pose_b, again.pose_b)
    assert not np.array_equal(stream.pose_a, other.pose_a) or not np.array_equal(
        stream.pose_b, other.pose_b)
    found = ContactSolver(*stream.sizes, model='exact').batch(stream.pose_a, stream.pose_b)
    if name == 'crane':
        assert 10 < np.count_nonzero(found.colliding) < 50, 'lowered, and lifted again'
    else:
        assert np.all(found.colliding == (name != 'separated'))
    if name == 'coplanar':
        assert np.all(found.separation == 0.0)
        assert np.all(np.abs(found.normal[:, 2]) == 1.0)
    if name == 'touching':
        assert np.max(np.abs(found.separation)) < 1e-14
    if name == 'separated':
        assert found.separation.min() >= 1e-3 * (1.0 - 1e-9) and found.separation.max() <= 1.1
    if name == 'containers':
        assert stream.size_a == (12.192, 2.438, 2.591)
        assert -found.separation.max() >= 2.438e-3 * (1.0 - 1e-9)


def test_a_stream_does_not_depend_on_its_length_being_met_by_chance():
    """Some draws of a set miss; they are drawn again, so that the count is exact."""
    assert [len(make_stream('random', count)) for count in (1, 17, 500)] == [1, 17, 500]


@pytest.mark.parametrize('name, count, words', [('randon', 5, "'randon' is not one of"),
                                                ('random', 0, 'needs 1 pair')])
def test_streams_that_cannot_be_made(name, count, words):
    with pytest.raises(ValueError, match=words):
        make_stream(name, count)


def test_streams_of_the_same_sizes_are_played_together():
    groups = by_sizes([make_stream(name, 2) for name in ('random', 'containers', 'separated')])
    assert [[stream.name for stream in group] for group in groups] == [
        ['random', 'separated'], ['containers']]
