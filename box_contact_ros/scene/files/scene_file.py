# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scene files: YAML (or JSON, which is YAML) to a `Scene`; every refusal names line and field.

The format is msg_schemas/scene.json. A file is data and nothing else: no tags, no anchors (a few
lines of them expand to gigabytes), no key twice.
"""
from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import yaml

from ...resources import find_file, resource_path
from ...solver.checks import shown
from ..scene_solver import Fault, Place, Scene, dotted
from .limits import OWN, SceneLimits
from .short_forms import check_streams, expand_boxes, expand_pairs

LARGEST_FILE = 16 * 2**20  # bytes that are read at most; some 100,000 pairs
DEEPEST = 20  # levels of nesting that are followed; a scene has four
MOST_FAULTS = 1000  # that are looked for to name the first: all of a megabyte would take a minute


class _Loader(getattr(yaml, 'CSafeLoader', yaml.SafeLoader)):  # type: ignore[misc]
    """The core schema of YAML 1.2, in C where there is libyaml.

    In YAML 1.1, which PyYAML knows, 010 is eight, 1:30 is ninety, and `no` is false.
    """

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}


def _whole(loader: _Loader, node: yaml.ScalarNode) -> int:
    base = {'0o': 8, '0x': 16}.get(node.value[:2], 10)
    return int(node.value, base)  # ValueError: thousands of digits, which would take long


for _kind, _pattern, _first in (
        ('null', r'~|null|Null|NULL|', '~nN'),
        ('bool', r'true|True|TRUE|false|False|FALSE', 'tTfF'),
        ('int', r'[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+', '-+0123456789'),
        ('float', r'[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|'
                  r'[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)', '-+.0123456789')):
    _Loader.add_implicit_resolver(f'tag:yaml.org,2002:{_kind}', re.compile(f'(?:{_pattern})$'),
                                  [*_first, *([''] if _kind == 'null' else [])])
_Loader.add_constructor('tag:yaml.org,2002:int', _whole)


class SceneError(ValueError):
    """A scene that is refused: where, and why."""


def read_scene(source: str | os.PathLike[str], *,
               check: Callable[[Scene], None] = lambda _: None,
               limits: SceneLimits = OWN) -> Scene:
    """Return the scene of a file, or of a text that begins with `{` or has more than one line.

    A path that leads to no file from here may be one of the package's own, config/scenes/…. So may
    the bare name of a scene there, such as `yard_bay`.
    Raises SceneError, whose words name file, line and field. `check` may raise Fault.
    """
    if not isinstance(source, str):
        source = os.fspath(source)
    elif is_inline(source):
        return parse_scene(source, check=check, limits=limits)
    try:
        path = find_file(source)
        if path.exists() and not path.is_file() and not path.is_dir():
            raise OSError('it is no regular file')  # opening a FIFO would wait for its writer
        with path.open('rb') as file:
            data = file.read(LARGEST_FILE + 1)
        text = data.decode('utf-8')
    except UnicodeDecodeError as error:
        raise SceneError(f'{source}: not UTF-8 at byte {error.start}') from error
    except (OSError, ValueError) as error:  # the latter: a NUL in the name
        reason = getattr(error, 'strerror', None) or error
        raise SceneError(f'scene {shown(source)} cannot be read: {reason}') from error
    if len(data) > LARGEST_FILE:
        raise SceneError(f'{source}: larger than {LARGEST_FILE} bytes')
    return parse_scene(text, source, check=check, limits=limits)


def is_inline(source: str) -> bool:
    """Return whether a text is the scene itself, not the path of its file."""
    return source.lstrip().startswith('{') or '\n' in source


def parse_scene(text: str, name: str = 'scene', *,
                check: Callable[[Scene], None] = lambda _: None,
                limits: SceneLimits = OWN) -> Scene:
    """Return the scene that a text describes; `name` is how errors call it.

    check: Whether the scene can be computed here; it raises Fault.
    """
    lines: dict[Place, int] = {}
    try:
        text.encode('utf-8')
        return _scene_of(_plain(text, lines, limits.events), lines, check, limits)
    except UnicodeEncodeError as error:
        raise SceneError(f'{name}: not UTF-8 at character {error.start}') from error
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        reason = getattr(error, 'problem', None) or str(error).replace('\n', ' ')
        line = mark.line + 1 if mark else 1
        raise SceneError(f'{name}:{line}: not YAML: {reason}') from error
    except Fault as error:
        place = error.place
        line = next((lines[place[:n]] for n in range(len(place), -1, -1) if place[:n] in lines), 1)
        where = f'{dotted(place)}: ' if place else ''
        raise SceneError(f'{name}:{line}: {where}{error.reason}') from None


def _scene_of(data: Any, lines: dict[Place, int], check: Callable[[Scene], None],
              limits: SceneLimits) -> Scene:
    """Return the scene that data means, or raise Fault with a place in the data."""
    _check_schema(data, lines)
    boxes, key_of = expand_boxes(data, limits)
    pairs, entry_of = expand_pairs(data['pairs'], boxes, limits)
    try:
        scene = Scene(boxes, pairs, data.get('frame_id', ''), data.get('poses') == 'array')
        check_streams(scene)
        check(scene)
    except Fault as error:
        kind, *rest = error.place
        if rest:
            rest[0] = key_of[str(rest[0])] if kind == 'boxes' else entry_of[int(rest[0])]
        raise Fault((kind, *rest), error.reason) from None
    return scene


def write_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene to a file, which `read_scene` reads as the same scene.

    A moving box without a source of poses gets the topic `<name>/pose`, as in any file.
    Raises ValueError for a scene that a file cannot describe, such as one with a name that no topic
    can have.
    """
    text = scene_text(scene)
    if len(text.encode()) > LARGEST_FILE:
        raise ValueError(f'{len(scene.pairs)} pairs need more than {LARGEST_FILE} bytes')
    topics = {name: box if box.pose or box.frame or box.pose_topic or scene.pose_array
              else replace(box, pose_topic=f'{name}/pose') for name, box in scene.boxes.items()}
    if parse_scene(text) != replace(scene, boxes=topics):
        raise ValueError('not all fields of this scene can stand in a file')
    Path(path).write_text(text, 'utf-8')


def scene_text(scene: Scene) -> str:
    """Return a scene as YAML, every box and pair by its name and without short forms."""
    lines = ['frame_id: ' + json.dumps(scene.frame_id)] if scene.frame_id else []
    lines += ['poses: array'] if scene.pose_array else []
    lines.append('boxes:')
    for name, box in scene.boxes.items():
        fields = {'size': box.size} | ({'pose': box.pose} if box.pose else {}) | (
            {'pose_topic': box.pose_topic} if box.pose_topic else {}) | (
            {'frame': box.frame} if box.frame else {}) | (
            {'mass': box.mass} if box.mass else {})
        lines.append(f'  {json.dumps(name)}: {json.dumps(fields)}')
    lines.append('pairs:')
    lines += [f'  - {json.dumps(pair._asdict() | {"name": pair.label})}' for pair in scene.pairs]
    return '\n'.join([*lines, ''])


def _plain(text: str, lines: dict[Place, int], most_events: int) -> Any:
    """Return the data of a YAML text; the line of each of its values goes to `lines`."""
    depth = 0
    for number, event in enumerate(yaml.parse(text, Loader=_Loader)):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        reason, tag = '', getattr(event, 'tag', None)
        if getattr(event, 'anchor', None):
            reason = 'anchors and aliases are not accepted'
        elif tag:
            reason = f'tag {shown(tag)} is not accepted'
        elif depth > DEEPEST:  # the C loader, which descends, would end the process
            reason = 'nested too deeply'
        elif number >= most_events:
            reason = f'more than {most_events} values and brackets'
        if reason:
            lines[()] = event.start_mark.line + 1 if event.start_mark else 1
            raise Fault((), reason)
    loader = _Loader(text)
    try:
        root = loader.get_single_node()

        def value(node: Any, path: Place) -> Any:
            lines.setdefault(path, node.start_mark.line + 1)
            if isinstance(node, yaml.ScalarNode):
                try:
                    return loader.construct_object(node)
                except ValueError as error:  # such as a date with month 13
                    raise Fault(path, f'{shown(node.value)}: {error}') from error
            if isinstance(node, yaml.SequenceNode):
                return [value(item, (*path, n)) for n, item in enumerate(node.value)]
            found: dict[str, Any] = {}
            for key_node, item in node.value:
                key = key_node.value if isinstance(key_node, yaml.ScalarNode) else None
                if not isinstance(key, str):
                    raise Fault(path, 'a key must be a name')
                lines[(*path, key)] = key_node.start_mark.line + 1
                if key in found:
                    raise Fault((*path, key), 'is there twice')
                found[key] = value(item, (*path, key))
            return found

        if root is None:
            raise Fault((), 'is empty')
        return value(root, ())
    finally:
        loader.dispose()


def _check_schema(data: Any, lines: dict[Place, int]) -> None:
    """Raise Fault for the first thing, by line, in which the data differs from the schema."""
    from jsonschema import Draft202012Validator  # only here: it takes 0.1 s

    schema = json.loads(resource_path('msg_schemas', 'scene.json').read_text('utf-8'))
    schema = _with_definitions(schema, schema['$defs'])
    found = [(_place(error), error) for error in islice(
        Draft202012Validator(schema).iter_errors(data), MOST_FAULTS)]
    if found:
        path, error = min(found, key=lambda entry: (lines.get(entry[0], 0), entry[0] == ()))
        raise Fault(path, _words(error))


def _with_definitions(schema: Any, definitions: Mapping[str, Any]) -> Any:
    """Return a schema with each reference replaced: jsonschema looks references up at every use."""
    if isinstance(schema, list):
        return [_with_definitions(item, definitions) for item in schema]
    if not isinstance(schema, dict):
        return schema
    target = definitions[schema['$ref'].rpartition('/')[2]] if '$ref' in schema else {}
    return target | {key: _with_definitions(value, definitions)
                     for key, value in schema.items() if key != '$ref'}


def _place(error: Any) -> Place:
    """Return the place of an error; of two fields that exclude each other, what has them."""
    path = tuple(error.absolute_path)
    return path[:-1] if error.validator == 'not' else path


def _words(error: Any) -> str:
    if error.validator == 'not':  # its path: …, dependentSchemas, FIELD, properties, EXCLUDED, not
        return f'has both {error.schema_path[-4]} and {error.schema_path[-2]}'
    value = shown(error.instance)
    if error.validator == 'oneOf':
        return 'needs one of: ' + '; '.join(
            ' and '.join(choice['required']) for choice in error.validator_value)
    if error.validator in ('minItems', 'maxItems') and error.validator_value > 1:
        return f'must be {error.validator_value} numbers, not {value}'
    if error.validator == 'exclusiveMinimum':
        return f'{value} is not positive'
    if error.validator == 'type':
        kinds = {'object': 'a mapping', 'array': 'a list', 'number': 'a number',
                 'integer': 'a whole number', 'string': 'a string'}
        accepted = error.validator_value
        return f'{value} is not ' + ' or '.join(
            kinds[kind] for kind in ([accepted] if isinstance(accepted, str) else accepted))
    if error.validator == 'pattern':
        return f'{value} is no name that a topic can have'
    if error.validator in ('required', 'additionalProperties'):
        return str(error.message)
    return f'{value}: {error.message}' if value not in error.message else str(error.message)
