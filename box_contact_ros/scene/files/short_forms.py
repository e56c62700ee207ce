# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Short forms of a scene file: types, counts, stacks and patterns become boxes and pairs.

What a file asks for is counted before it is built: three lines may ask for 10^9 boxes. Raises
Fault, with the place in the file.
"""
from __future__ import annotations

import fnmatch
import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Any

from ...solver.checks import shown
from ..scene_solver import LARGEST_ID, Box, Fault, Pair, Place, Scene, id_of
from .limits import MOST_STREAMS, SceneLimits

_WILDCARDS = frozenset('*?[')


def expand_boxes(data: Mapping[str, Any], limits: SceneLimits,
                 ) -> tuple[dict[str, Box], dict[str, str]]:
    """Return the boxes of a file by name, and by name the key that they stand under there."""
    entries = data['boxes']
    total = sum(_count(entry) for entry in entries.values())
    if total > limits.boxes:
        raise Fault(('boxes',), f'{total} boxes are more than {limits.boxes}')
    boxes: dict[str, Box] = {}
    key_of: dict[str, str] = {}
    for key, entry in entries.items():
        try:
            for box in _boxes(key, entry, data):
                if box.name in boxes:
                    raise Fault(('boxes', key), f'a box called {shown(box.name)} is there twice')
                boxes[box.name], key_of[box.name] = box, key
        except OverflowError:
            raise Fault(('boxes', key), 'a number is too large') from None
    return boxes, key_of


def _count(entry: Mapping[str, Any]) -> int:
    """Return how many boxes an entry stands for."""
    if 'stack' not in entry:
        return int(entry.get('count', 1))
    stack = entry['stack']
    tiers = stack.get('tiers', 1)
    in_columns = sum(tiers) if isinstance(tiers, list) else stack.get('rows', 1) * tiers
    return int(stack.get('columns', 1) * in_columns)


def _boxes(key: str, entry: Mapping[str, Any], data: Mapping[str, Any]) -> Iterator[Box]:
    """Yield the boxes of an entry."""
    types = data.get('types', {})
    if 'stack' in entry:
        stack = entry['stack']
        yield from _stacked(key, stack, _size(('boxes', key, 'stack'), stack, types))
        return
    size = _size(('boxes', key), entry, types)
    if 'pose' in entry:
        yield Box(key, size, tuple(map(float, entry['pose'])))
        return
    in_array = data.get('poses') == 'array'
    if in_array and 'pose_topic' in entry:
        raise Fault(('boxes', key, 'pose_topic'), 'with poses: array, all poses come on one topic')
    mass = float(entry.get('mass', 0.0))
    if 'frame' in entry:
        yield Box(key, size, frame=entry['frame'], mass=mass)
        return
    numbers = range(1, int(entry['count']) + 1) if 'count' in entry else ()
    for name in [f'{key}{number:02}' for number in numbers] or [key]:
        yield Box(name, size, None,
                  '' if in_array else entry.get('pose_topic', f'{name}/pose'), mass=mass)


def _size(place: Place, entry: Mapping[str, Any], types: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the full extents [m] that an entry gives, or that its type has."""
    if 'type' in entry and entry['type'] not in types:
        raise Fault((*place, 'type'), f'{shown(entry["type"])} is none of the types')
    return tuple(map(float, types[entry['type']]['size'] if 'type' in entry else entry['size']))


def _stacked(key: str, stack: Mapping[str, Any], size: tuple[float, ...]) -> Iterator[Box]:
    """Yield the boxes of a stack: row by row along y, column by column along x, from the ground.

    A name has a part for each of rows, columns and tiers that the file gives: r01_c02_t3.
    """
    place = ('boxes', key, 'stack')
    rows, columns = (int(stack.get(name, 1)) for name in ('rows', 'columns'))
    tiers = stack.get('tiers', 1)
    heights = [int(height) for height in tiers] if isinstance(tiers, list) else [int(tiers)] * rows
    if len(heights) != rows:
        raise Fault((*place, 'tiers'), f'{len(heights)} numbers, but {rows} rows')
    given = (*map(float, stack.get('origin', (0, 0, 0))), float(stack.get('gap', 0)), *size)
    if not all(map(math.isfinite, given)):
        raise Fault(place, 'a number is not finite')
    # Decimals: the poses are to the bit what one would write by hand.
    x, y, z, gap, length, width, height = (Decimal(repr(number)) for number in given)
    xs = [float(x + number * (length + gap)) for number in range(columns)]
    zs = [float(z + (2 * number + 1) * height / 2) for number in range(max(heights))]
    for row in range(rows):
        at_y = float(y + row * (width + gap))
        for column, tier in itertools.product(range(columns), range(heights[row])):
            name = ''.join((key, f'{row + 1:02}' if 'rows' in stack else '',
                            f'_c{column + 1:02}' if 'columns' in stack else '',
                            f'_t{tier + 1}' if 'tiers' in stack else ''))
            yield Box(name, size, (xs[column], at_y, zs[tier], 0.0, 0.0, 0.0, 1.0))


def expand_pairs(entries: Sequence[Mapping[str, Any]], boxes: Mapping[str, Box],
                 limits: SceneLimits) -> tuple[tuple[Pair, ...], list[int]]:
    """Return the pairs of a file in its order, and of each the number of its entry.

    A pattern leaves out two fixed boxes, a pair that is listed by its names, and what an earlier
    pattern has.
    """
    sides = _sides(entries, boxes, limits.comparisons)
    most = sum(len(a) * len(b) for a, b in filter(None, sides))
    if most > 2 * limits.pairs:  # moving boxes among themselves: each pair is met twice
        raise Fault(('pairs',), f'patterns of {most} pairs of boxes: more than {2 * limits.pairs}')
    known = {_both(entry['a'], entry['b'])
             for entry, side in zip(entries, sides) if side is None}
    found: list[tuple[str, str, str, int | None]] = []
    entry_of: list[int] = []
    for number, (entry, side) in enumerate(zip(entries, sides)):
        if side is None:
            a, b = entry['a'], entry['b']
            found.append((a, b, entry.get('name', f'{a}_{b}'), entry.get('id')))
        else:
            found += _new_pairs(number, *side, boxes, known)
        entry_of += [number] * (len(found) - len(entry_of))
    if len(found) > limits.pairs:
        raise Fault(('pairs',), f'{len(found)} pairs are more than {limits.pairs}')
    taken = {key for *_, key in found if key is not None}
    pairs = []
    for a, b, name, key in found:
        if key is None:
            key = id_of(name)
            while key in taken:  # two names with one checksum; see docs/contributing/decisions
                key = (key + 1) % (LARGEST_ID + 1)
            taken.add(key)
        pairs.append(Pair(int(key), name, a, b))
    return tuple(pairs), entry_of


def check_streams(scene: Scene) -> None:
    """Raise Fault for a scene that nobody could listen to."""
    streams = len(scene.sources) + len(scene.frames)
    if streams > MOST_STREAMS:
        raise Fault(('boxes',), f'{streams} boxes have a topic or a frame of their own, and at '
                                f'most {MOST_STREAMS} may: set poses: array')


def _both(a: str, b: str) -> tuple[str, str]:
    """Return two names, the same for both orders."""
    return (a, b) if a < b else (b, a)


def _new_pairs(number: int, side_a: Sequence[str], side_b: Sequence[str],
               boxes: Mapping[str, Box], known: set[tuple[str, str]],
               ) -> Iterator[tuple[str, str, str, None]]:
    """Yield the pairs that a pattern adds to those known; raise Fault if it stands for none."""
    is_empty = True
    for a, b in itertools.product(side_a, side_b):
        if a == b or boxes[a].pose and boxes[b].pose:
            continue
        is_empty, both = False, _both(a, b)
        if both not in known:
            known.add(both)
            yield a, b, f'{a}_{b}', None
    if is_empty:
        raise Fault(('pairs', number), 'no two boxes of this pattern are a pair of which one moves')


def _sides(entries: Sequence[Mapping[str, Any]], boxes: Mapping[str, Box], comparisons: int,
           ) -> list[tuple[Sequence[str], Sequence[str]] | None]:
    """Return the boxes on both sides of each pattern; None for a pair listed by its names."""
    matches: dict[tuple[str, str], Sequence[str]] = {}

    def matching(number: int, side: str, text: str) -> Sequence[str]:
        place = ('pairs', number, side)
        pattern = '*' if text == 'all' and side in ('moving', 'fixed') else text
        if not _WILDCARDS & set(pattern) and pattern not in boxes:
            raise Fault(place, f'{shown(pattern)} is none of the boxes')
        if (side, pattern) not in matches:
            if (len(matches) + 1) * len(boxes) > comparisons:
                raise Fault(place, f'more than {comparisons} names to compare with patterns')
            names: Iterable[str] = boxes if _WILDCARDS & set(pattern) else [pattern]
            # fnmatch's expressions take time in proportion to the name, whatever the pattern.
            is_alike = re.compile(fnmatch.translate(pattern)).match
            matches[side, pattern] = [name for name in names if is_alike(name) and (
                side not in ('moving', 'fixed') or (side == 'fixed') == bool(boxes[name].pose))]
        if not matches[side, pattern]:
            raise Fault(place, f'{shown(text)} is the name of no {"" if side in "ab" else side} '
                               'box'.replace('  ', ' '))
        return matches[side, pattern]

    sides: list[tuple[Sequence[str], Sequence[str]] | None] = []
    for number, entry in enumerate(entries):
        one, other = ('moving', 'fixed') if 'moving' in entry else ('a', 'b')
        if one == 'a' and not _WILDCARDS & {*entry['a'], *entry['b']}:
            sides.append(None)
            continue
        for field in ('id', 'name'):
            if field in entry:
                raise Fault(('pairs', number, field), f'a pattern of pairs has no {field}')
        sides.append((matching(number, one, entry[one]), matching(number, other, entry[other])))
    return sides
