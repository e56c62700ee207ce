# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A real ship: slots and size types of 1,936 containers, without names, numbers and weights.

Facts of the BAPLIE plan in msayyes-app/Baplie-Dual-Viewer (8537654). The grid is the example's.
"""
from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from box_contact_ros import contacts_of, support

EXAMPLES = Path(__file__).parents[2] / 'docs' / 'examples'


@pytest.fixture(scope='module')
def stow():
    """Return the function of the example."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXAMPLES)
        from from_baplie import stow
    return stow


@pytest.fixture(scope='module')
def ship(stow):
    """Return slots, full extents, poses and the lowest containers, as the example stows them."""
    with Path(__file__).with_name('stowage_plan.csv').open() as file:
        # ISO 6346 has no length 5: five boxes `5EGB` are stowed as those of 40 ft.
        slots = [(int(row['bay']), int(row['row']), int(row['tier']),
                  row['iso_type'].replace('5EGB', '4EGB')) for row in csv.DictReader(file)]
    slots.sort(key=lambda slot: slot[2])
    return slots, *stow(slots)


def test_contacts_are_those_in_half_millimetres(ship):
    """An oracle in integers: 1,590 pairs touch, and none overlaps by 1 mm."""
    _, size, pose, _ = ship
    middle, extent = np.rint(2000 * pose[:, :3]).astype(int), np.rint(1000 * size).astype(int)
    wanted = []
    for n in range(len(size) - 1):
        shared = (np.minimum(middle[n] + extent[n], (middle + extent)[n + 1:])
                  - np.maximum(middle[n] - extent[n], (middle - extent)[n + 1:])).min(axis=1)
        assert shared.max() < 2
        wanted += [(n, n + 1 + m) for m in np.flatnonzero(shared >= 0)]
    pairs, contacts = contacts_of(size, pose)
    assert len(size) == 1936 and len(pairs) == 1590 and np.array_equal(pairs, wanted)
    assert np.abs(contacts.separation).max() < 1e-13


def test_rows_are_beside_a_centre_row(stow):
    """If their bay has one: 04, 02, 00, 01, 03 on deck of bay 10; 04, 02, 01, 03 elsewhere."""
    rows = [4, 2, 0, 1, 3]
    places = [(10, row, 82) for row in rows], *(
        [(bay, row, tier) for row in rows if row] for bay, tier in ((10, 2), (14, 82)))
    slots = [(*place, '42G1') for bay in places for place in bay]
    y = stow(slots)[1][:, 1] / 2.5
    assert y.tolist() == [-2, -1, 0, 1, 2] + 2 * [-1.5, -0.5, 0.5, 1.5]


def test_what_rests_on_one_twenty_footer_does_not_stand(ship):
    """18 forty-footers, whose centre is 38 mm outside, and what is above them."""
    slots, size, pose, lowest = ship
    found = support(size, pose, *contacts_of(size, pose), ground=lowest)
    carriers = np.bincount(found.carried_by[:, 1], minlength=len(slots))
    outside = found.margin < 0.0
    on_half = (size[:, 0] > 12.0) & (carriers == 1)
    on_half[found.carried_by[size[found.carried_by[:, 0], 0] > 12.0, 1]] = False
    assert np.array_equal(outside, on_half) and outside.sum() == 18
    assert found.margin[outside] == pytest.approx(-0.038, abs=1e-8)
    assert found.share[outside] == pytest.approx(6.058 / 12.192, abs=1e-6)
    above = {tuple(slots[n][:2]): slots[n][2] for n in np.flatnonzero(outside)}
    falls = [above.get((bay, row), 99) <= tier < 80 for bay, row, tier, _ in slots]  # below deck
    assert np.array_equal(~found.stands, falls) and sum(falls) == 83
