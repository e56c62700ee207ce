# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ContactSolver: what it returns, where touch begins, and which batches there are.

test_bad_input.py has what is refused.
"""
from __future__ import annotations

import pickle

import numpy as np
import poses
import pytest

from box_contact_ros import Contact, Contacts, ContactSolver

SOLVER = ContactSolver(poses.CUBE, poses.CUBE, model='exact')
ABOVE = [0.5, 0.25, 1.875, 0, 0, 0, 1]


def some_contacts(n=6):
    """Every second pair touches, each at a place and a depth of its own."""
    b = np.tile(ABOVE, (n, 1))
    b[:, 0], b[::2, 2] = np.linspace(-1.0, 1.0, n), np.linspace(1.5, 2.0, len(b[::2]))
    b[1::2, 2] = 3.0
    return SOLVER.batch(np.tile(poses.IDENTITY, (n, 1)), b), b


@pytest.mark.parametrize('rows', [
    slice(1, None, 2), slice(3, 3), [4, 0, -1], np.array([], int), [True, False] * 3,
    lambda many: many.colliding, lambda many: np.argsort(many.separation)])
def test_contacts_are_a_sequence(rows):
    """A list of contacts of single calls: its length, order, slices, and each field as an array."""
    many, b = some_contacts()
    singles = [SOLVER(poses.IDENTITY, pose) for pose in b]
    assert len(many) == len(list(many)) == len(singles) == 6
    for row in (0, 3, -1, np.int32(2)):
        assert isinstance(many[row], Contact)
        for mine, theirs in zip(poses.fields(many[row]), poses.fields(singles[row])):
            assert np.array_equal(mine, theirs, equal_nan=True) and type(mine) is type(theirs)
    for row in (6, -7):
        with pytest.raises(IndexError):
            many[row]
    rows = rows(many) if callable(rows) else rows
    chosen = many[rows]
    assert type(chosen) is Contacts
    for mine, theirs, every in zip(*map(poses.fields, (
            chosen, Contacts.of(np.array(singles, object)[rows]), many))):
        assert np.array_equal(mine, theirs, equal_nan=True) and mine.dtype == theirs.dtype
        assert np.array_equal(mine, every[rows], equal_nan=True)


def test_contacts_go_to_other_processes_and_keep_their_fields():
    many, _ = some_contacts()
    poses.assert_same_bits(many, pickle.loads(pickle.dumps(many)))
    with pytest.raises(AttributeError):
        many.point = many.normal


@pytest.mark.parametrize('gap, colliding', [
    (0.0, True), (1e-15, True), (1e-14, False), (1e-12, False), (-1e-15, True)])
def test_exact_touch_is_contact(gap, colliding):
    """Contact up to 8 ulp of the largest coordinate or size: 8 · 4.4e-16 = 3.6e-15 m here."""
    assert SOLVER(poses.IDENTITY, [0, 0, 2.0 + gap, 0, 0, 0, 1]).colliding is colliding


def test_touch_tolerance_follows_the_coordinates():
    """In UTM coordinates, where one ulp is 9.3e-10 m, a gap of 8 of them is still touch."""
    origin = np.array([5e5, 5.8e6, 20.0])
    a = np.r_[origin, 0, 0, 0, 1]
    for gap, colliding in ((8 * 2.0**-30, True), (9 * 2.0**-30, False)):
        b = np.r_[origin + (0, 2 + gap, 0), 0, 0, 0, 1]
        assert SOLVER(a, b).colliding is colliding


def test_an_empty_batch():
    """No rows, and no pairs, as a search gives them that found nothing."""
    for found in (SOLVER.batch(np.zeros((0, 7)), np.zeros((0, 7))), SOLVER.batch([], []),
                  SOLVER.batch([], sizes=[], pairs=[]),
                  SOLVER.batch([poses.IDENTITY, ABOVE], pairs=[])):
        assert found.colliding.shape == found.separation.shape == (0,)
        assert found.normal.shape == found.point.shape == (0, 3)


@pytest.mark.parametrize('mask', [False, True])
def test_a_masked_array_is_refused(mask):
    """A mask would be dropped, and what it hides would count."""
    pose = np.ma.array(np.array(poses.IDENTITY, dtype=float), mask=mask)
    with pytest.raises(ValueError, match='^pose_a must be a pose .* of numbers, not masked'):
        SOLVER(pose, ABOVE)
    with pytest.raises(ValueError, match='^poses_a must be poses .* of numbers, not masked'):
        SOLVER.batch(pose[None], [ABOVE])
    with pytest.raises(ValueError, match='^pairs must be whole numbers'):
        SOLVER.batch([poses.IDENTITY, ABOVE], pairs=np.ma.array([[0, 1]], mask=mask))
