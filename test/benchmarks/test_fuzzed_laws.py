# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Laws of the core, asked of the pairs that the fuzz and the pose sets draw."""
from __future__ import annotations

import numpy as np
import pytest
from test_core import share_certain
from test_laws import assert_between_the_parts

from benchmarks import fuzz
from benchmarks.pose_sets import SETS


@pytest.mark.parametrize('name', fuzz.CLASSES)
def test_the_point_is_between_those_of_the_parts(name: str) -> None:
    """B is cut in two; 100,000 pairs of each class."""
    rng = np.random.default_rng(21)
    assert_between_the_parts(rng, *fuzz.draw(name, rng, 100_000))


@pytest.mark.parametrize('name', SETS)
def test_the_certificate_holds_of_usual_poses(name: str) -> None:
    """An exact point that had to be clipped costs several times as much."""
    assert share_certain(SETS[name](np.random.default_rng(51), 5000)) >= 0.999
