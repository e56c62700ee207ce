# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How much a scene may ask for: three lines of a file can stand for 10^9 boxes."""
from __future__ import annotations

from dataclasses import dataclass

MOST_STREAMS = 1000
"""Boxes with a topic or a frame of their own. Each subscription takes a millisecond and 100 kB, in
every program that listens; an array has all poses in one message."""


@dataclass(frozen=True)
class SceneLimits:
    """Counts that are refused before anything of that size is built."""

    events: int  # parts of a text: values and brackets
    boxes: int
    pairs: int
    comparisons: int  # of names with patterns


OWN = SceneLimits(events=1_200_000, boxes=100_000, pairs=2**19, comparisons=10_000_000)
"""A scene of one's own: a hundred thousand pairs written out, or 1,000 boxes each with each."""
FOREIGN = SceneLimits(events=50_000, boxes=10_000, pairs=20_000, comparisons=1_000_000)
"""A scene that a stranger may have named: its reader is deaf for a second at most."""
