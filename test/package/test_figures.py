# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the moving picture shows, read from its pixels."""
from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest

from box_contact_ros.view.style import CONTACT

TILT = Path(__file__).resolve().parents[2] / 'docs' / 'figures' / 'tilt.gif'
RADIUS = 5  # of the contact's disc, and more than half the width of what else has its colour [px]


def discs() -> list[tuple[float, float] | None]:
    """Return where the disc is in each picture [px], as the middle of what is as round as it."""
    with pytest.importorskip('PIL.Image').open(TILT) as image:
        pictures = []
        for number in range(image.n_frames):
            image.seek(number)
            pictures.append(np.asarray(image.convert('RGB'))[:320].astype(int))  # the side view
    found: list[tuple[float, float] | None] = []
    for scene in pictures:
        alike = np.abs(scene - CONTACT).max(axis=2) < 20
        # A pixel stays if all those up to RADIUS beside, above and below it are alike.
        inside = alike.copy()
        for shift, axis in product(range(1, RADIUS + 1), (0, 1)):
            inside &= np.roll(alike, shift, axis) & np.roll(alike, -shift, axis)
        rows, columns = np.nonzero(inside)
        found.append((columns.mean(), rows.mean()) if len(rows) else None)
    return found


def test_an_eye_can_follow_the_point() -> None:
    """From picture to picture the disc moves less than 40 px, and it crosses the stack."""
    seen = [disc for disc in discs() if disc]
    places = np.array(seen)
    assert len(seen) > 30 and np.ptp(places[:, 0]) > 250
    assert np.abs(np.diff(places[:, 0])).max() < 40
    assert np.ptp(places[:, 1]) < 3  # all are discs on the stack
