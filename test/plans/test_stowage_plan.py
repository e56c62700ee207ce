# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A real ship: slots and size types of 1,936 containers, without names, numbers and weights.

Facts of the BAPLIE plan in msayyes-app/Baplie-Dual-Viewer (8537654). The grid is the reader's.
"""
from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from test_read_plan import baplie

from box_contact_ros import contacts_of, inspect_plan
from box_contact_ros.plans.baplie import Placed, grid, read_baplie


@pytest.fixture(scope='module')
def ship():
    """Return the plan as the reader has it, without what stands for the ship."""
    with Path(__file__).with_name('stowage_plan.csv').open() as file:
        # ISO 6346 has no length 5: five boxes `5EGB` are stowed as those of 40 ft.
        return read_baplie(baplie(*(
            f'{int(row["bay"]):03}{int(row["row"]):02}{int(row["tier"]):02} '
            f'{row["iso_type"].replace("5EGB", "4EGB")}' for row in csv.DictReader(file))))


def test_contacts_are_those_in_half_millimetres(ship):
    """An oracle in integers: 1,590 pairs touch, and none overlaps by 1 mm."""
    free = np.setdiff1d(np.arange(len(ship)), ship.ground)
    size, pose = ship.sizes[free], ship.poses[free]
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


def test_rows_are_beside_a_centre_row():
    """If their bay has one: 04, 02, 00, 01, 03 on deck of bay 10; 04, 02, 01, 03 elsewhere."""
    rows = [4, 2, 0, 1, 3]
    places = [(10, row, 82) for row in rows], *(
        [(bay, row, tier) for row in rows if row] for bay, tier in ((10, 2), (14, 82)))
    boxes = [Placed('', '', *place, (1.0, 1.0, 1.0), 0.0) for bay in places for place in bay]
    assert (grid(boxes)[1] / 2.5).tolist() == [-2, -1, 0, 1, 2] + 2 * [-1.5, -0.5, 0.5, 1.5]


@pytest.mark.parametrize('bears', ['faces', 'corners'])
def test_what_rests_on_one_twenty_footer_does_not_stand(ship, bears):
    """18 forty-footers, whose centre is outside by 38 mm of the base, and what is above them."""
    pytest.importorskip('clarabel')
    found = inspect_plan(ship, bears=bears)
    names = np.array(ship.names)
    outside = found.cause == 'unsupported'
    assert outside.sum() == 18 and (~found.stands).sum() == 83 and not len(found.overlaps)
    assert found.share[outside] == pytest.approx(6.058 / 12.192, abs=1e-6)
    assert bears == 'corners' or found.margin[outside] == pytest.approx(-0.038, abs=1e-8)
    above = {name[:5]: name[5:] for name in names[outside]}
    falls = [above.get(name[:5], '99') <= name[5:] < '80' for name in names]  # below deck
    assert np.array_equal(~found.stands, falls)
