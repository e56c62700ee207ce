# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an answer of a scene tells beside its contacts, by name."""
from __future__ import annotations

from box_contact_ros import Nearest, Pair
from box_contact_ros.scene.scene_solver import Answer


def near_pairs(answer: Answer) -> list[tuple[Pair, Nearest]]:
    """Return each pair that is near with its nearest points."""
    return [(answer.scene.pair_of(a, b), nearest)
            for (a, b), nearest in zip(answer.near_pairs.tolist(), answer.near)]


def stale_pairs(answer: Answer) -> list[Pair]:
    """Return the stale pairs; a box whose pairs all are is paired with itself."""
    return [answer.scene.pair_of(a, b) for a, b in answer.stale.tolist()]
