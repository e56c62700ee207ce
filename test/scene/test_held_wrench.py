# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The wrench that is held."""
from __future__ import annotations

import numpy as np

from box_contact_ros.scene.force.held_wrench import HeldWrench


def test_a_wrench_is_held_until_the_next_is_due():
    """Zero before the first; the newest that is due; a tick without an answer changes nothing."""
    held, one, two = HeldWrench(), np.full(6, 1.0), np.full(6, 2.0)
    assert not held.at(0.0).any()
    held.answer(one, asked=0.0, due=0.002)
    assert not held.at(0.0015).any()
    assert held.at(0.002) is one
    held.answer(two, asked=0.005, due=0.005 + 0.002)
    assert held.at(0.0065) is one
    assert held.at(0.007) is two and held.at(5.0) is two


def test_overtaken_answers_are_dropped():
    """The answer to an older question does not replace that to a newer one, however they come."""
    held, old, new = HeldWrench(), np.full(6, 1.0), np.full(6, 2.0)
    held.answer(new, asked=0.005, due=0.006)
    held.answer(old, asked=0.0, due=0.0065)
    assert held.at(1.0) is new
    held = HeldWrench()
    held.answer(old, asked=0.0, due=0.02)  # very late, when the next one is already there
    held.answer(new, asked=0.005, due=0.006)
    assert held.at(0.01) is new and held.at(0.03) is new
