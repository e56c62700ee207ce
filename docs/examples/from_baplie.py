# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Does every container of a stowage plan stand? `python docs/examples/from_baplie.py [PLAN]`.

A plan in SMDG BAPLIE has a slot (bay, row, tier) and an ISO 6346 size type for each container. The
slots say nothing of metres: adapt the grid below to your ship. A container is on what is below it,
or on the ship. Slots that are taken twice or above an empty one are refused, and other size types.
It prints:

    8 containers, 5 contacts, deepest 0.0 mm
    0100304 42G1 does not stand: its centre is 38 mm outside, 0.50 of its base is on others
    0100306 42G1 does not stand: its centre is 1219 mm inside, 1.00 of its base is on others
"""
import re
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

from box_contact_ros import contacts_of, support

PLAN = Path(__file__).with_name('files') / 'ship.edi'
Slot = tuple[int, int, int, str]  # bay, row, tier, size type
SLOT = re.compile(r'LOC\+147\+(\d{3})(\d\d)(\d\d)((?:(?!LOC\+147).)*)', re.DOTALL)
TYPE = re.compile(r'EQD\+\w+\+[^+]*\+(\w{4})')
LENGTHS = {'2': 6.058, '4': 12.192, 'L': 13.716}
"""[m], by the first character of the size type; see ISO 6346."""
HEIGHTS = {'0': 2.438, '2': 2.591, '3': 2.591, '5': 2.896, 'C': 2.591, 'D': 2.743, 'E': 2.896}
"""[m], by the second; 3 is of the standard's year 1985. A letter means that the width is 2.5 m."""
BAY, ROW, TIER, DECK = 14.6, 2.5, 2.591, 30.0  # pitches, and height of tier 80 [m]


def read_slots(text: str) -> list[Slot]:
    """Return the slots and size types of the containers of a plan, from below to above."""
    slots: dict[str, Slot] = {}
    for bay, row, tier, rest in SLOT.findall(text):
        slot, kind = bay + row + tier, TYPE.search(rest)
        if kind is None:
            print(f'not read: {slot} has no EQD with a size type', file=sys.stderr)
        elif slot in slots:
            raise ValueError(f'two containers are in {slot}')
        elif kind[1][0] not in LENGTHS or kind[1][1] not in HEIGHTS:
            raise ValueError(f'{slot} has the size type {kind[1]}, of which no size is known here')
        else:
            slots[slot] = int(bay), int(row), int(tier), kind[1]
    if not slots:
        raise ValueError('there is no container (LOC+147 and EQD)')
    return sorted(slots.values(), key=lambda slot: slot[2])


def stow(slots: list[Slot]) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Return full extents (n, 3), poses (n, 7), and the containers that have none below them.

    Rows 01 and 02 are beside row 00 if a bay has one, else beside each other.
    """
    size, pose = np.zeros((len(slots), 3)), np.zeros((len(slots), 7))
    stacks: dict[tuple[int, bool], list[int]] = defaultdict(list)
    lowest = []
    centred = {(bay // 4, tier < 80) for bay, row, tier, _ in slots if row == 0}
    for n, (bay, row, tier, kind) in enumerate(slots):
        size[n] = LENGTHS[kind[0]], 2.5 if kind[1].isalpha() else 2.438, HEIGHTS[kind[1]]
        x = BAY * (bay // 4) + (bay % 4 - 2) * 3.067  # odd bays hold 20 ft at an end of the 40 ft
        y = (row + 1) // 2 - (0.0 if (bay // 4, tier < 80) in centred else 0.5)
        stack = stacks[row, tier < 80]
        below = [m for m in stack if abs(pose[m, 0] - x) < (size[m, 0] + size[n, 0]) / 2]
        stack.append(n)
        if not below:
            lowest.append(n)
            floor = TIER * (tier - 2) / 2 if tier < 80 else DECK + TIER * (tier - 80) / 2
        elif tier - 2 > max(slots[m][2] for m in below):
            raise ValueError(f'{bay:03}{row:02}{tier:02} is above an empty slot')
        else:
            floor = max(pose[m, 2] + size[m, 2] / 2 for m in below)
        pose[n] = x, ROW * (y if row % 2 else -y), floor + size[n, 2] / 2, 0.0, 0.0, 0.0, 1.0
    return size, pose, lowest


def main() -> None:
    """Read a plan, and tell what does not stand."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else PLAN)
    try:
        slots = read_slots(path.read_text('latin-1'))
        size, pose, lowest = stow(slots)
    except (OSError, ValueError) as error:
        sys.exit(f'{path}: {error}')
    pairs, contacts = contacts_of(size, pose)
    found = support(size, pose, pairs, contacts, ground=lowest)
    deepest = 1e3 * max(0.0, -contacts.separation.min(initial=0.0))
    print(f'{len(slots)} containers, {len(pairs)} contacts, deepest {deepest:.1f} mm')
    for n in np.flatnonzero(~found.stands):
        bay, row, tier, kind = slots[n]
        side = 'inside' if found.margin[n] > 0.0 else 'outside'
        print(f'{bay:03}{row:02}{tier:02} {kind} does not stand: its centre is '
              f'{1e3 * abs(found.margin[n]):.0f} mm {side}, {found.share[n]:.2f} of its base is on '
              'others')


if __name__ == '__main__':
    main()
