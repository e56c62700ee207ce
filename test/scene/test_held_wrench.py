# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The wrench that is held."""
from __future__ import annotations

import numpy as np
import pytest

from box_contact_ros.scene.force.held_wrench import HeldWrench


def test_a_wrench_is_held_until_the_next_is_due():
    """Zero before the first; the newest that is due; a tick without an answer changes nothing."""
    held, one, two = HeldWrench(), np.full(6, 1.0), np.full(6, 2.0)
    assert not held.at(0.0).any()
    held.answer(one, asked=0.0, due=0.002)
    assert not held.at(0.0015).any()
    assert np.array_equal(held.at(0.002), one)
    held.answer(two, asked=0.005, due=0.005 + 0.002)
    assert np.array_equal(held.at(0.0065), one)
    assert np.array_equal(held.at(0.007), two) and np.array_equal(held.at(5.0), two)


def test_overtaken_answers_are_dropped():
    """The answer to an older question does not replace that to a newer one, however they come."""
    held, old, new = HeldWrench(), np.full(6, 1.0), np.full(6, 2.0)
    held.answer(new, asked=0.005, due=0.006)
    held.answer(old, asked=0.0, due=0.0065)
    assert np.array_equal(held.at(1.0), new)
    held = HeldWrench()
    held.answer(old, asked=0.0, due=0.02)  # very late, when the next one is already there
    held.answer(new, asked=0.005, due=0.006)
    assert np.array_equal(held.at(0.01), new) and np.array_equal(held.at(0.03), new)


def test_the_callers_array_stays_the_callers():
    """What it becomes later does not act, and what is done to the result neither."""
    held, wrench = HeldWrench(), np.ones(6)
    held.answer(wrench, asked=0.0, due=0.0)
    wrench *= 5.0
    first = held.at(0.0)
    first += 3.0
    assert np.array_equal(held.at(0.0), np.ones(6))
    with pytest.raises(ValueError, match='wrench must be a wrench'):
        held.answer([1.0, 2.0], asked=1.0, due=1.0)
