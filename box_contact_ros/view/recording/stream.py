# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pairs of poses in the order in which they are sent, or were recorded."""
from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from ...solver.contact import Contacts
from ...solver.contact_solver import ContactSolver

Size = tuple[float, float, float]


@dataclass(frozen=True)
class Stream:
    """n pairs of poses `x y z qx qy qz qw` in a common frame, in the order they are sent."""

    name: str
    size_a: Size  # full extents of box A [m]
    size_b: Size  # full extents of box B [m]
    pose_a: np.ndarray  # (n, 7)
    pose_b: np.ndarray  # (n, 7)

    def __len__(self) -> int:
        return len(self.pose_a)

    @property
    def sizes(self) -> tuple[Size, Size]:
        """Full extents of both boxes [m]: what the nodes have to be started with."""
        return self.size_a, self.size_b

    def contacts(self, model: str) -> Contacts:
        """Return what a model answers to each pair."""
        return ContactSolver(*self.sizes, model=model).batch(self.pose_a, self.pose_b)


@dataclass(frozen=True)
class Replay(Stream):
    """The pairs of poses of equal stamp of a recording, in the order of their stamps."""

    stamps: np.ndarray  # (n,) as recorded [ns]

    @property
    def described(self) -> str:
        """How much it is, and over what time it was recorded, in words."""
        seconds = (int(self.stamps[-1]) - int(self.stamps[0])) * 1e-9
        return f'{len(self)} pairs of poses, recorded in {seconds:.2f} s'

    def thinned(self, count: int | None) -> Replay:
        """Return `count` pairs spread over the whole; all if there are fewer, or for None."""
        if count is None or count >= len(self):
            return self
        rows = np.linspace(0, len(self) - 1, count).round().astype(int)
        return dataclasses.replace(self, pose_a=self.pose_a[rows], pose_b=self.pose_b[rows],
                                   stamps=self.stamps[rows])
