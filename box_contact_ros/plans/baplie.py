# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A ship's stowage plan: SMDG BAPLIE 1.5, 2.x and 3.x.

A container has a slot (bay, row, tier; ISO 9711) and a size type (ISO 6346). Neither says where a
slot is in metres, so containers are placed on a grid of our own, each on what is below it. The
lowest of a stack is on the ship. What is there of the ship is a slab below each of these.
"""
from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from .plan import Fault, Plan

LENGTHS = {'1': 2.991, '2': 6.058, '3': 9.125, '4': 12.192, '9': 13.716, 'A': 7.15, 'B': 7.315,
           'C': 7.43, 'D': 7.45, 'E': 7.82, 'F': 8.1, 'G': 12.5, 'H': 13.106, 'K': 13.6,
           'L': 13.716, 'M': 14.63, 'N': 14.935, 'P': 16.154}
"""[m], by the first character of the size type; plans write 9 for 45 ft."""
HEIGHTS = {'0': 2.438, '2': 2.591, '4': 2.743, '5': 2.896, '6': 2.896, '8': 1.295, '9': 1.219,
           'C': 2.591, 'D': 2.743, 'E': 2.896, 'F': 2.896, 'L': 2.591, 'M': 2.743, 'N': 2.896,
           'P': 2.896}
"""[m], by the second, since 1995. 6, 9, F and P have no exact height."""
HEIGHTS_1984 = HEIGHTS | {'1': 2.438, '3': 2.591, '4': 2.896, '6': 2.438, '7': 2.438}
"""Of types of four digits, which are of the standard's edition of 1984."""
WIDTHS = dict.fromkeys('CDEF', 2.5) | dict.fromkeys('LMNP', 2.6)
"""[m], by the second character; else WIDTH."""
WIDTH = 2.438
BAY, HALF, ROW, TIER = 14.6, 3.067, 2.5, 2.591
"""Pitches [m]: of 40 ft bays, of a 20 ft bay from the middle of its 40 ft bay, of rows, and of
tiers without a container."""
DECK, ABOVE_HOLD = 30.0, 1.0
"""Height of tier 80, or as far above the hold's containers as no two touch [m]."""
FIRST_ON_DECK, LAST_BASE = 80, 84
"""Tiers: what is on deck, and the highest on which a stack may begin without one beside it."""
SLAB = 0.1  # thickness [m]
SHIP = 'ship'
UNITS = {'KGM': 1.0, 'KG': 1.0, 'T': 1000.0, 'LBR': 0.45359237, 'TNE': 1000.0}  # of masses [kg]
LIGHTEST, HEAVIEST = 1e3, 60e3
"""[kg] of a container with its goods. An empty 10 ft has 1.3 t, and the standard allows 36 t. What
is below may have been written with a mark of thousands, or in tonnes."""
MESSAGES = ('BAPLIE', 'MOVINS')
"""A stowage plan, and stowage instructions, which have the same segments."""
NOT_STOWED = '9999999'  # the slot of a container that has none yet
GROSS = ('WT', 'VGM', 'G', 'AET')
"""What MEA calls the mass of a container with its goods; VGM is that which was weighed."""
OVERS = {'5': 'in front', '6': 'behind', '7': 'on the right', '8': 'on the left', '9': 'in height'}
"""Sides to which goods reach beyond a container, by the qualifier of DIM."""
ESCAPED = 0xE000  # private characters from here on stand for those that `?` releases


@dataclass
class Stowed:
    """A container as the file has it."""

    slot: str = ''
    number: str = ''  # of the container
    kind: str = ''  # size type
    mass: str = ''
    is_weighed: bool = False
    over: list[str] = field(default_factory=list)
    is_container: bool = True  # else breakbulk

    @property
    def name(self) -> str:
        """Return what the file calls it: its slot, or else its number."""
        return self.slot or self.number or '?'


def segments(text: str) -> list[list[str]]:
    """Return the elements of each segment; lines may be wrapped anywhere.

    A released character is a private one, so that it separates nothing.
    """
    text = re.sub('[\r\n]', '', text).strip('\ufeff \t\x1a')
    component, element, decimal, release, end = tuple(":+.?'")
    if text.startswith('UNA') and len(text) > 8:
        component, element, decimal, release, _, end = tuple(text[3:9])
        text = text[9:]
    if release != ' ':
        text = re.sub(re.escape(release) + '(.)', lambda found: chr(ESCAPED + ord(found[1]) % 256),
                      text)
    own, usual = component + element + end, ":+'"
    if own != usual:
        text = text.translate({ord(mark): chr(ESCAPED + ord(mark)) for mark in usual} | {
            ord(mark): other for mark, other in zip(own, usual)})
    if decimal == ',':
        text = text.replace(',', '.')
    *whole, rest = text.split("'")
    return [segment.strip().split('+') for segment in whole if segment.strip()] + (
        [[rest.strip()]] if rest.strip() else [])


def read_baplie(text: str) -> Plan:
    """Return the plan of a file; its faults are rows. Raises ValueError where it is no BAPLIE."""
    parts = segments(text)
    kinds = {part(row, 2).split(':')[0] for row in parts if row[0] == 'UNH'}
    if kinds and not kinds & {*MESSAGES}:
        raise ValueError(f'its message is {" and ".join(sorted(kinds))}; a stowage plan is '
                         f'{" or ".join(MESSAGES)}')
    rows = list(containers(parts))
    if not rows:
        raise ValueError('it has no container: neither LOC+147 nor EQD+CN')
    faults = list(cuts(parts))
    boxes, left_out = checked(rows, faults)
    return stow(boxes, left_out, faults)


def part(segment: list[str], place: int) -> str:
    """Return an element of a segment, '' where it has none."""
    return segment[place] if place < len(segment) else ''


def cuts(parts: list[list[str]]) -> Iterator[Fault]:
    """Yield a fault for each UNT that counts other segments, and where UNH and UNT are no pairs."""
    start, tags = 0, [segment[0] for segment in parts]
    for place, segment in enumerate(parts):
        if segment[0] == 'UNH':
            start = place
        elif segment[0] == 'UNT' and part(segment, 1).lstrip('0') != str(place + 1 - start):
            yield Fault('cut', (), f'UNT counts {_shown(part(segment, 1)) or "no"} segments, and '
                                   f'there are {place + 1 - start}')
    if 'UNT' not in tags or tags.count('UNT') != tags.count('UNH'):
        yield Fault('cut', (), 'the file has no UNT for each UNH: a part may be missing')


def containers(parts: Iterable[list[str]]) -> Iterator[Stowed]:
    """Yield containers. Each begins by its slot, or by its number in other editions of BAPLIE."""
    first, row = '', None
    for segment in parts:
        tag = segment[0]
        is_slot = tag == 'LOC' and part(segment, 1) == '147'
        if not is_slot and tag not in ('EQD', 'MEA', 'DIM', 'UNT'):
            continue
        if tag == 'UNT':
            if row:
                yield row
            first, row = '', None
        elif is_slot or tag == 'EQD':
            first = first or tag
            if row is None or tag == first or (row.slot if is_slot else row.number or row.kind):
                if row:
                    yield row
                row = Stowed()
            if is_slot:
                row.slot = _shown(part(segment, 2).split(':')[0]).strip()
            else:
                row.is_container = part(segment, 1) != 'BB'
                row.number = _shown(part(segment, 2).split(':')[0])
                row.kind = _shown(part(segment, 3).split(':')[0])
        elif row and tag == 'MEA':
            _weigh(row, segment)
        elif row and tag == 'DIM':
            _measure(row, segment)
    if row:
        yield row


def _weigh(row: Stowed, segment: list[str]) -> None:
    """Take the mass of MEA+WT++KGM:1, MEA+VGM++KGM:1 or MEA+AAE+VGM+KGM:1."""
    what = part(segment, 2) if part(segment, 1) == 'AAE' else part(segment, 1)
    mass = _shown(part(segment, 3))
    is_weighed = what == 'VGM'
    if what in GROSS and (not row.mass or (_is_empty(row.mass) or is_weighed and not row.is_weighed)
                          and not _is_empty(mass)):
        row.mass, row.is_weighed = mass, is_weighed


def _is_empty(mass: str) -> bool:
    """Return whether the number of a mass is missing or 0, as in KGM, KGM: and KGM:0."""
    return not mass.partition(':')[2].strip('0. :')


def _measure(row: Stowed, segment: list[str]) -> None:
    """Take by how much goods reach beyond the container."""
    unit, *extents = next(filter(None, segment[2:]), '').split(':')
    for extent in extents:
        if extent.strip('0.') and part(segment, 1) in OVERS:
            row.over.append(f'{_shown(extent)} {"cm" if unit in ("CM", "CMT") else _shown(unit)} '
                            f'{OVERS[part(segment, 1)]}')


def _shown(text: str) -> str:
    """Return a text of the file with released characters as they are."""
    return text if text.isascii() else ''.join(
        chr(ord(mark) - ESCAPED) if ESCAPED <= ord(mark) < ESCAPED + 256 else mark for mark in text)


def extents_of(kind: str) -> tuple[float, float, float] | None:
    """Return full extents [m] of a size type, or None."""
    heights = HEIGHTS_1984 if kind[2:].isdigit() else HEIGHTS
    if len(kind) < 2 or kind[0] not in LENGTHS or kind[1] not in heights:
        return None
    return LENGTHS[kind[0]], WIDTHS.get(kind[1], WIDTH), heights[kind[1]]


@dataclass(frozen=True)
class Placed:
    """A container whose slot and size are known."""

    slot: str
    number: str
    bay: int
    row: int
    tier: int
    size: tuple[float, float, float]
    mass: float

    @property
    def on_deck(self) -> bool:
        """Whether it is on deck, by the number of its tier."""
        return self.tier >= FIRST_ON_DECK


Slot = tuple[int, int, int]  # bay, row, tier


def checked(rows: Iterable[Stowed], faults: list[Fault]) -> tuple[list[Placed], list[Slot]]:
    """Return the containers that can be placed, and the slots of others; add what is wrong."""
    rows = list(rows)
    placed: dict[str, Placed] = {}
    slot_of: dict[str, str] = {}
    gone: dict[tuple[str, str], list[str]] = defaultdict(list)  # names, by kind and reason
    left_out: list[str] = []
    if all(re.fullmatch(f'[0-9]{{6}}|{NOT_STOWED}|', row.slot) for row in rows):  # BBRRTT
        for row in rows:
            row.slot = row.slot.rjust(7, '0') if row.slot else ''
    for row in rows:
        size = extents_of(row.kind)
        if row.over:
            faults.append(Fault('goods', (row.name,), 'reaches beyond its container, which is not '
                                                      f'judged: {", ".join(row.over)}'))
        if row.slot == NOT_STOWED:
            gone['slot', f'not stowed ({NOT_STOWED})'].append(row.number or row.slot)
        elif not row.is_container:
            gone['slot', 'breakbulk (EQD+BB), of which no size is known'].append(row.name)
            left_out.append(row.slot)
        elif not re.fullmatch('(?!000)[0-9]{7}', row.slot):  # bays begin at 1
            why = (f'slots of {len(row.slot)} characters are not known, only 7 digits (bay from '
                   '001, row, tier)' if row.slot else 'without a slot (LOC+147)')
            gone['slot', why].append(row.name)
        elif row.slot in placed:
            faults.append(Fault('slot taken', (row.slot,), f'{row.number or "a container"} has the '
                                f'slot of {placed[row.slot].number or "another"}: left out'))
        elif size is None:
            why = (f'of the type {row.kind} no size is known' if row.kind else
                   'without a size type (EQD)')
            gone['size type', why].append(row.slot)
            left_out.append(row.slot)
        else:
            other = slot_of.setdefault(row.number, row.slot) if row.number else row.slot
            if other != row.slot:
                faults.append(Fault('twice', (row.slot,), f'{row.number} is at {other}, too'))
            mass = _mass(row, faults)
            placed[row.slot] = Placed(row.slot, row.number, *_numbers(row.slot), size, mass)
    faults += [Fault(kind, tuple(names), f'{why}: left out') for (kind, why), names in gone.items()]
    if not placed:
        fault = next(fault for fault in faults if fault.kind in ('slot', 'size type'))
        raise ValueError(f'no container can be placed; {fault.kind} {fault.names[0]}: {fault.text}')
    return sorted(placed.values(), key=lambda box: (box.tier, box.slot)), [
        _numbers(slot) for slot in left_out if re.fullmatch('[0-9]{7}', slot)]


def _numbers(slot: str) -> Slot:
    return int(slot[:3]), int(slot[3:5]), int(slot[5:])


def _mass(row: Stowed, faults: list[Fault]) -> float:
    """Return the mass [kg] of a container; 0 where the file has none. What is odd is a fault."""
    unit, _, number = row.mass.partition(':')
    unit = unit.strip()
    number = number.split(':')[0].strip()
    mass, fault = 0.0, ''
    if not row.mass:
        fault = 'has no weight: taken as 0'
    elif unit not in UNITS:
        fault = f'its weight has the unit {unit or "none"}, not KGM: taken as 0'
    elif not re.fullmatch(r'[0-9]+\.?[0-9]*', number):
        fault = f'its weight is {number or "missing"}: taken as 0'
    else:
        mass = UNITS[unit] * float(number)
        if mass == 0.0:
            fault = 'its weight is 0'
        elif mass < LIGHTEST:
            fault = (f'its weight is {number} {unit}, less than any container: thousands may be '
                     'meant')
        elif mass > HEAVIEST:
            fault = f'its weight is {number} {unit}, more than any container'
    if fault:
        faults.append(Fault('weight' if mass else 'mass', (row.slot,), fault))
    return mass


def stow(boxes: list[Placed], left_out: list[Slot], faults: list[Fault]) -> Plan:
    """Return the plan of containers, sorted from below to above, with what carries them.

    left_out: what is there too, and is not placed.
    """
    size = np.array([box.size for box in boxes])
    x, y = grid(boxes)
    pose = np.zeros((len(boxes), 7))
    pose[:, :2], pose[:, 6] = np.stack((x, y), axis=1), 1.0
    held: list[int] = []
    lowest = [n for on_deck in (False, True)
              for n in _stack(boxes, left_out, on_deck, size, pose, held, faults)]
    if held:
        faults.append(Fault('held', tuple(boxes[n].slot for n in held), 'stands on what is left '
                            'out: taken as fixed, and not judged'))
    slabs, below = size[lowest].copy(), pose[lowest].copy()
    slabs[:, 2] = SLAB
    below[:, 2] -= (size[lowest, 2] + SLAB) / 2.0
    masses = np.r_[[box.mass for box in boxes], np.zeros(len(lowest))]
    return Plan(np.vstack((size, slabs)), np.vstack((pose, below)), masses,
                ground=[*held, *range(len(boxes), len(boxes) + len(lowest))],
                names=[box.slot for box in boxes] + [SHIP] * len(lowest), faults=faults)


def grid(boxes: list[Placed]) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y (n,) [m]: 40 ft bays are 4k + 2, or 4k if more of them are even so.

    Rows 01 and 02 are beside row 00 if a bay has one, else beside each other.
    """
    bay, row = np.array([(box.bay, box.row) for box in boxes]).T
    on_deck = np.array([box.on_deck for box in boxes])
    even = bay[bay % 2 == 0]
    bay = bay + (0 if 2 * np.count_nonzero(even % 4 == 2) >= len(even) else 2)
    x = BAY * (bay // 4) + HALF * (bay % 4 - 2)
    part_of_ship = 2 * (bay // 4) + on_deck
    aside = (row + 1) // 2 - np.where(np.isin(part_of_ship, part_of_ship[row == 0]), 0.0, 0.5)
    return x, ROW * np.where(row % 2 == 1, aside, -aside)


def _stack(boxes: list[Placed], left_out: list[Slot], on_deck: bool, size: np.ndarray,
           pose: np.ndarray, held: list[int], faults: list[Fault]) -> list[int]:
    """Write heights, in the hold or on deck; return what is on the ship, and add the gaps.

    held: gets what is on something that is left out.
    """
    missing: dict[int, list[tuple[int, int]]] = defaultdict(list)  # bays and tiers, by row
    for bay, row, tier in left_out:
        if (tier >= FIRST_ON_DECK) == on_deck:
            missing[row].append((bay, tier))
    stacks: dict[tuple[int, int], list[int]] = defaultdict(list)
    bases: dict[int, set[int]] = defaultdict(set)  # tiers on which stacks of a bay begin
    lowest, left, right = [], pose[:, 0] - size[:, 0] / 2.0, pose[:, 0] + size[:, 0] / 2.0
    low, high, blocks = FIRST_ON_DECK, DECK, np.floor(pose[:, 0] / BAY + 0.5).astype(int)
    if on_deck:
        in_hold = [n for n, box in enumerate(boxes) if not box.on_deck]
        tops = pose[in_hold, 2] + size[in_hold, 2] / 2.0
        high = max(DECK, tops.max(initial=0.0) + ABOVE_HOLD)
    else:
        low, high = 2, 0.0
    for n, box in enumerate(boxes):
        if box.on_deck != on_deck:
            continue
        near = [m for block in (-1, 0, 1) for m in stacks[blocks[n] + block, box.row]]
        below = [m for m in near if left[m] < right[n] and left[n] < right[m]
                 and boxes[m].tier < box.tier]
        stacks[blocks[n], box.row].append(n)
        top = max((boxes[m].tier for m in below), default=0)
        if any(abs(bay - box.bay) <= 1 and top <= tier < box.tier
               for bay, tier in missing[box.row]):
            held.append(n)
            floor = max((pose[m, 2] + size[m, 2] / 2.0 for m in below), default=high + TIER * (
                box.tier - low) / 2.0) + TIER * (box.tier - 2 - top) / 2.0 * bool(below)
        elif below:
            floor = max(pose[m, 2] + size[m, 2] / 2.0 for m in below)
            if box.tier - 2 > top:
                floor += TIER * (box.tier - 2 - top) / 2.0
                faults.append(Fault('gap', (box.slot,), 'has no container below it down to tier '
                                                        f'{top:02}'))
        else:
            floor = high + TIER * (box.tier - low) / 2.0
            lowest.append(n)
            begun = bases[blocks[n]] if on_deck else set()
            if on_deck and box.tier > LAST_BASE and box.tier - 2 not in begun:
                faults.append(Fault('gap', (box.slot,), 'has no container below it down to the '
                                                        'deck'))
            elif box.tier > min(begun, default=box.tier):
                faults.append(Fault('base', (box.slot,), (
                    f'begins a stack, as others of its bay do at tier {min(begun)}: taken as on '
                    'the ship')))
            bases[blocks[n]].add(box.tier)
        pose[n, 2] = floor + size[n, 2] / 2.0
    return lowest
