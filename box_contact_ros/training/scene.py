"""The pairs of sizes of a scene file, which is all of it that a training needs."""
from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from ..checks import as_size, shown
from ..scene_file import scene_path
from .contacts import SizePair


class SceneError(ValueError):
    """A scene file that cannot be used; the message names the file and the field."""


class _Loader(yaml.SafeLoader):
    """Of two boxes of one name YAML would take the last, without a word."""

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        seen = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if (key.tag, key.value) in seen:
                    raise yaml.MarkedYAMLError(problem=f'{shown(key.value)} is there twice',
                                               problem_mark=key.start_mark)
                seen.add((key.tag, key.value))
        return node


def size_pairs(path: Path) -> list[SizePair]:
    """The distinct pairs of sizes [m] of the pairs listed, in the order of their first mention.

    A pair and the same with its boxes swapped count once, and so do boxes that differ only in
    which of their axes is called x, y, z: extents are sorted, longest first.
    """
    try:
        scene = yaml.load(scene_path(str(path)).read_text('utf-8'), _Loader)
    except OSError as error:
        raise SceneError(f'{path} cannot be read: {error.strerror}') from error
    except Exception as error:  # PyYAML raises anything: ValueError for a 30th of February
        raise SceneError(f'{path} is no YAML: {" ".join(str(error).split())}') from error
    boxes = _entry(path, scene, '', 'boxes', Mapping, 'a map of names to boxes')
    sizes = {name: _size(path, name, box) for name, box in boxes.items()}
    found: dict[SizePair, None] = {}
    for number, pair in enumerate(_entry(path, scene, '', 'pairs', list, 'a list of pairs')):
        ends = []
        for end in ('a', 'b'):
            where = f'pairs[{number}]'
            name = _entry(path, pair, where, end, (str, int), 'the name of a box')
            if name not in sizes:
                raise SceneError(f'{path}: {where}.{end}: there is no box {shown(name)} in boxes')
            ends.append(sizes[name])
        found[tuple(sorted(ends, reverse=True))] = None
    if not found:
        raise SceneError(f'{path}: pairs: lists none')
    return list(found)


def _entry(path: Path, parent: Any, where: str, key: str, kind: Any, words: str) -> Any:
    field = f'{where}.{key}' if where else key
    if not isinstance(parent, Mapping) or key not in parent:
        raise SceneError(f'{path}: {field}: is missing')
    if not isinstance(parent[key], kind):
        raise SceneError(f'{path}: {field}: must be {words}, not {shown(parent[key])}')
    return parent[key]


def _size(path: Path, name: Any, box: Any) -> tuple[float, float, float]:
    where = f'boxes.{name}'
    size = _entry(path, box, where, 'size', list, 'three full extents [m]')
    numbers = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in size)
    if len(size) != 3 or not numbers:
        raise SceneError(f'{path}: {where}.size: must be three full extents [m], not {shown(size)}')
    try:
        extents = as_size(size, f'{where}.size:')
    except ValueError as error:
        raise SceneError(f'{path}: {error}') from error
    x, y, z = sorted(extents[0].tolist(), reverse=True)
    return x, y, z
