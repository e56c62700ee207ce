# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Real pallets by `PatchForces`: what stays in its place."""
from __future__ import annotations

import pytest

from benchmarks.loops import TIMINGS
from benchmarks.stacks import ORDERS, sideways, stays


@pytest.mark.parametrize('order', ORDERS)
def test_real_pallets_stand(order: str) -> None:
    """Every box of a stable set stays within 5 mm and 0.5°, with answers at each step of 1 ms."""
    assert stays(lambda: sideways(order, 0.0), TIMINGS[0]).all()


def test_a_push_topples_boxes() -> None:
    """Boxes that are pushed by 0.3 of their weight do not all stay."""
    assert not stays(lambda: sideways(ORDERS[0], 0.3), TIMINGS[0]).all()
