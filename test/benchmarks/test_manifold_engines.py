# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Manifold's boolean, an independent oracle: its overlaps have the centroid and verdict of ours."""
from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('manifold3d')

from benchmarks import trials  # noqa: E402
from benchmarks.engines import manifold_engines  # noqa: E402
from benchmarks.pose_sets import SETS  # noqa: E402


@pytest.mark.parametrize('name', ['containers', 'random cubes', 'tilted stacks'])
def test_the_centroid_of_the_overlap(name: str) -> None:
    pairs = SETS[name](np.random.default_rng(4), 100)
    found = trials.ask(manifold_engines.boolean(), pairs, trials.FULL).judged(pairs)['its point']
    assert found.points['all'][3] < 1e-4  # worst [%]
    assert (found.missed, found.invented) == (0, 0)
