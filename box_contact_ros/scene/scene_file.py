# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scene files: YAML (or JSON, which is YAML) to a `Scene`; every refusal names file and field.

msg_schemas/scene.json is the format. docs/reference/scenes.md explains it.
"""
from __future__ import annotations

import json
import os
import re
from collections.abc import KeysView, Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from ..resources import find_file, read_regular, resource_path
from ..solver.checks import SHOWN, short_repr
from .boxes import Box, Frame, KeyPath, SceneError
from .scene import Pair, Scene

MOST_STREAMS = 1000
"""Boxes with a topic of their own. Each subscription takes a millisecond and 100 kB; with
`poses: named`, one message has all poses."""
MOST_BYTES = 2**26
"""Of a file: 64 MiB, some million boxes. With all aliases written out, a file has at most so many
nodes: that binds no file without aliases."""
MOST_DEPTH = 16
"""Collections within each other; a scene has four. PyYAML's C code fails at some ten thousand."""
PLAIN_INT = re.compile(r'[-+]?(0|[1-9][0-9]{0,299})')  # float() takes 308 digits
PLAIN_FLOAT = re.compile(r'[-+]?[0-9]*(\.[0-9]*)?([eE][-+]?[0-9]+)?')
_WILDCARDS = re.compile(r'[*?[]')
_ALL = [{'a': '*', 'b': '*'}]  # what `pairs: all` stands for


class _Loader(getattr(yaml, 'CSafeLoader', yaml.SafeLoader)):  # type: ignore[misc]
    """PyYAML's safe loader, in C where there is libyaml, without numbers that hide another one."""


def _plain(pattern: re.Pattern[str], read: type) -> Any:
    def construct(loader: _Loader, node: yaml.ScalarNode) -> Any:
        if not pattern.fullmatch(node.value):
            raise yaml.constructor.ConstructorError(
                None, None, f'{short_repr(node.value)} is not a plain number', node.start_mark)
        return read(node.value)
    return construct


# YAML 1.1, which PyYAML knows, reads 010 as eight and 1:30 as ninety.
_Loader.add_constructor('tag:yaml.org,2002:int', _plain(PLAIN_INT, int))
_Loader.add_constructor('tag:yaml.org,2002:float', _plain(PLAIN_FLOAT, float))
# It takes 1e-05 and 1.5E0 for words, which are numbers in JSON.
_Loader.add_implicit_resolver('tag:yaml.org,2002:float',
                              re.compile(r'[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+$'),
                              list('-+0123456789'))
# A scene has no dates; PyYAML fails at 2026-02-31.
_Loader.add_constructor('tag:yaml.org,2002:timestamp', _Loader.construct_yaml_str)


def read_scene(path: str | os.PathLike[str]) -> Scene:
    """Return the scene of a file.

    A path that leads to no file from here may be one of the package's own, config/scenes/….
    Raises SceneError, a ValueError whose words name file and field.
    """
    if not isinstance(path, str | os.PathLike) or not _is_name(os.fspath(path)):
        raise SceneError(('path',), f'must be that of a file, not {short_repr(path)}')
    try:
        text = read_regular(find_file(path), MOST_BYTES).decode('utf-8')
        _check_yaml(text)
        return _scene_of(yaml.load(text, Loader=_Loader))
    except OSError as error:
        raise SceneError((), f'scene {short_repr(os.fspath(path))} cannot be read: '
                             f'{error.strerror or error}') from error
    except (ValueError, yaml.YAMLError) as error:
        fault = error if isinstance(error, SceneError) else SceneError((), str(error))
        reason = ' '.join(fault.reason.split())
        if len(reason) > 2 * SHOWN:  # it shows what is refused
            reason = f'{reason[:SHOWN]} ... {reason[-SHOWN:]}'
        raise SceneError(fault.path, reason, f'{path}') from error


@dataclass
class _Collection:
    """A list or mapping that is being read."""

    anchor: str | None = None
    keys: set[str] | None = None  # of a mapping
    entries: int = 0  # nodes in it so far: keys and values of a mapping in turn
    nodes: int = 1  # it, and all nodes below it with aliases written out


def _check_yaml(text: str) -> None:
    """Raise YAMLError for what PyYAML reads without a word, or does not survive.

    These are doubled keys, tags, and collections that are nested deeply or repeated by aliases.
    """
    open_ones = [_Collection()]
    nodes: dict[str | None, int] = {}  # below each anchor
    texts: dict[str | None, str | None] = {}  # of scalars, by anchor
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.CollectionEndEvent):
            closed = open_ones.pop()
            open_ones[-1].nodes += closed.nodes
            nodes[closed.anchor] = closed.nodes
        if not isinstance(event, yaml.NodeEvent):
            continue
        parent, anchor = open_ones[-1], event.anchor
        value, tag = getattr(event, 'value', None), getattr(event, 'tag', None)  # of a scalar
        if isinstance(event, yaml.AliasEvent):
            value = texts.get(anchor)
            parent.nodes += nodes.get(anchor, 1)
        elif isinstance(event, yaml.CollectionStartEvent):
            open_ones.append(_Collection(
                anchor, set() if isinstance(event, yaml.MappingStartEvent) else None))
        else:
            parent.nodes += 1
            nodes[anchor], texts[anchor] = 1, value
        parent.entries += 1
        if tag:
            raise _refusal(f'a tag, {short_repr(tag)}', event)
        if len(open_ones) > MOST_DEPTH + 1:
            raise _refusal(f'more than {MOST_DEPTH} collections are within each other', event)
        if parent.nodes > MOST_BYTES:
            raise _refusal(f'aliases stand for more than {MOST_BYTES} nodes', event)
        if parent.keys is not None and parent.entries % 2 and value is not None:
            if value in parent.keys:
                raise _refusal(f'{short_repr(value)} is defined twice', event)
            parent.keys.add(value)


def _refusal(problem: str, event: Any) -> yaml.YAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)


def _is_name(path: str | bytes) -> bool:
    return isinstance(path, str) and '\0' not in path


def _scene_of(data: Any) -> Scene:
    """Return the scene that data means, or raise SceneError."""
    _check_schema(data)
    boxes = {name: _box(entry, ('boxes', name), entry.get('body', ''))
             for name, entry in data.get('boxes', {}).items()}
    bodies = data.get('bodies', {})
    for body, parts in bodies.items():
        for part, entry in parts.get('boxes', {}).items():
            name, place = f'{body}_{part}', ('bodies', body, 'boxes', part)
            if name in boxes:
                raise SceneError(place, f'{short_repr(name)} is the name of another box')
            boxes[name] = _box(entry, place, body)
    entries = _ALL if data['pairs'] == 'all' else data['pairs']
    listed = {number: entry for number, entry in enumerate(entries)
              if not _is_pattern(entry, bodies.keys())}
    patterns = {number: entry for number, entry in enumerate(entries) if number not in listed}
    for number, entry in patterns.items():
        if 'name' in entry:
            raise SceneError(('pairs', number, 'name'), 'pairs by a pattern or a body have no name')
    try:
        scene = Scene(
            boxes, tuple(Pair(entry.get('name', f'{entry["a"]}_{entry["b"]}'), entry['a'],
                              entry['b']) for entry in listed.values()),
            data.get('frame_id', ''), data.get('poses', 'topics'),
            tuple((entry['a'], entry['b']) for entry in patterns.values()),
            {name: _frame(name, entry) for name, entry in bodies.items()})
    except SceneError as fault:  # the file has both in one list
        part, *path = fault.path
        if part in ('pairs', 'patterns') and path:
            path[0] = list(listed if part == 'pairs' else patterns)[int(path[0])]
        raise SceneError(('pairs' if part == 'patterns' else part, *path), fault.reason) from None
    if not scene.in_one_message and len(scene.moving) > MOST_STREAMS:
        raise SceneError(('boxes',), f'{len(scene.moving)} boxes and bodies have a topic of their '
                                     f'own, and at most {MOST_STREAMS} may: set poses: named')
    return scene


def _box(entry: Mapping[str, Any], path: KeyPath, body: str = '') -> Box:
    try:
        return Box(entry['size'], entry.get('pose'), entry.get('pose_topic', ''), body)
    except SceneError as fault:
        raise fault.within(*path) from None


def _frame(name: str, entry: Mapping[str, Any]) -> Frame:
    try:
        return Frame(entry.get('pose'), entry.get('pose_topic', ''))
    except SceneError as fault:
        raise fault.within('bodies', name) from None


def _check_schema(data: Any) -> None:
    """Raise SceneError for the first thing in which the data differs from the schema."""
    from jsonschema import Draft202012Validator  # only here: it takes 0.1 s
    from jsonschema.exceptions import best_match

    schema = json.loads(resource_path('msg_schemas', 'scene.json').read_text('utf-8'))
    error = best_match(Draft202012Validator(schema).iter_errors(data))
    if error is not None:
        path = tuple(error.absolute_path)
        # Files of before have it.
        remedy = ': write named' if path == ('poses',) and error.instance == 'array' else ''
        raise SceneError(path, f'{error.message}{remedy}')


def _is_pattern(entry: Mapping[str, str], bodies: KeysView[str]) -> bool:
    """Return whether an entry of pairs may stand for several: by wildcards, or by a body."""
    sides = entry['a'], entry['b']
    return bool(_WILDCARDS.search(''.join(sides))) or not bodies.isdisjoint(sides)
