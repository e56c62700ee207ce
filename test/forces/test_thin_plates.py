# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thin plates lie on each other, not in each other; what is deeper is said."""
from __future__ import annotations

import numpy as np
import pytest
from worlds import FLOOR, World

from box_contact_ros.forces.patch_forces import GRAVITY

FRAME = 1.0 / 60.0  # [s]


def stack(count: int, thick: float, **options: object) -> World:
    return World(FLOOR, *(((1.2, 0.8, thick), 37.0, (0, 0, thick * (k + 0.5)))
                          for k in range(count)),
                 pairs=[(k, k + 1) for k in range(count)], **options)


@pytest.mark.parametrize(('count', 'thick'), [(60, 0.005), (10, 0.001)])
def test_thin_plates_lie_on_each_other(count: int, thick: float) -> None:
    """At 1/60 s none is deeper than a tenth of it: 60 of 5 mm sank by 152 of 300 mm."""
    world = stack(count, thick)
    world.run(1.5, FRAME)
    depth = thick - np.diff(world.poses[1:, 2])
    assert depth.max() < 0.1 * thick
    assert not world.awake.any()
    loads = world.forces.loads()
    assert not loads.too_deep.any()
    assert loads.pressing == pytest.approx(37.0 * GRAVITY * np.arange(count, 0, -1), rel=0.01)


def test_what_is_deeper_than_a_tenth_of_a_plate_is_said() -> None:
    """At 1/60 s no sub-step is short enough for plates of 1 µm, far below `most_depth`."""
    thick = 1e-6
    world = stack(10, thick).run(0.2, FRAME)
    depth = np.append(0.5 * thick - world.poses[1, 2], thick - np.diff(world.poses[1:, 2]))
    told = world.forces.loads().too_deep
    assert told.any() and told.tolist() == (depth > 0.1 * thick).tolist()
