# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node parameters as one table per node: checked, and listed by `--help`, which needs no ROS.

`declared_parameters` gives them to a node.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..solver.arguments import program_parser
from ..solver.checks import nearest_name, shown, size_fault

Check = Callable[[str, Any], Any]
"""From a parameter's name and value to the value as the node uses it; ValueError if it is wrong."""


OF_RCLPY = ('use_sim_time', 'start_type_description_service')  # every node has them
QOS_OVERRIDES = 'qos_overrides.'  # begins the names of those that are declared with a topic
LONGEST_REASON = 1000  # characters: it may quote what a stranger sent


@dataclass(frozen=True)
class Limits:
    """A check whose limits a parameter's descriptor shows: a range, or words."""

    check: Check
    words: str = ''
    range: tuple[float, float] | tuple[int, int] | None = None

    def __call__(self, name: str, value: Any) -> Any:
        """Return the value as the node uses it, or raise ValueError."""
        return self.check(name, value)


@dataclass(frozen=True)
class Setting:
    """One parameter: its default, what it means (with its unit), and what is accepted."""

    default: Any
    description: str
    check: Check
    fixed: bool = False  # whether it is for the start only


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def number(low: float, high: float) -> Check:
    """Check for a number within [low, high]; integers are as good as floats."""
    def check(name: str, value: Any) -> float:
        if not _is_number(value):
            raise ValueError(f'{name} must be a number, not {shown(value)}')
        if not low <= value <= high:
            raise ValueError(f'{name} must lie within {low:g} and {high:g}, not {value:g}')
        return float(value)
    return Limits(check, range=(low, high))


def whole_number(low: int, high: int) -> Check:
    """Check for a whole number within [low, high]."""
    def check(name: str, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise ValueError(f'{name} must be a whole number from {low} to {high}, '
                             f'not {shown(value)}')
        return value
    return Limits(check, range=(low, high))


def numbers(count: int) -> Check:
    """Check for so many finite numbers."""
    def check(name: str, value: Any) -> tuple[float, ...]:
        found = value if isinstance(value, Sequence) else ()
        if len(found) != count or not all(map(_is_number, found)) or not all(
                map(math.isfinite, found)):
            raise ValueError(f'{name} must be {count} finite numbers, not '
                             f'{shown(list(found) if len(found) else value)}')
        return tuple(map(float, found))
    return Limits(check, f'{count} finite numbers')


def size(name: str, value: Any) -> tuple[float, ...]:
    """Check three full extents [m]."""
    extents: tuple[float, ...] = numbers(3)(name, value)
    fault = size_fault(extents)
    if fault:
        raise ValueError(f'{name} {fault}')
    return extents


def text(name: str, value: Any) -> str:
    """Check for a string."""
    if not isinstance(value, str):
        raise ValueError(f'{name} must be a string, not {shown(value)}')
    return value


def one_of(choices: Iterable[str]) -> Check:
    """Check for one of some strings."""
    def check(name: str, value: Any) -> str:
        choice = text(name, value)
        if choice not in choices:
            raise ValueError(f'{name} {shown(value)} is not one of: {", ".join(choices)}'
                             f'{nearest_name(choice, choices)}')
        return choice
    return Limits(check, f'one of: {", ".join(choices)}')


def flag(name: str, value: Any) -> bool:
    """Check for true or false."""
    if not isinstance(value, bool):
        raise ValueError(f'{name} must be true or false, not {shown(value)}')
    return value


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """Return the refusal of a name that there is not, with the nearest name if one is near."""
    return f'unknown {kind} {shown(name)}{nearest_name(name, known)}'


def checked(settings: Mapping[str, Setting], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return all values as the node uses them, or raise ValueError for the first bad one."""
    return {name: setting.check(name, values[name]) for name, setting in settings.items()}


def reason_of(error: Exception) -> str:
    """Return what an error says; with its type, unless it is a refusal or a missing library."""
    known = isinstance(error, (ValueError, ImportError))
    return (str(error) if known else f'{type(error).__name__}: {error}')[:LONGEST_REASON]


def answer_help(program: str, doc: str | None, settings: Mapping[str, Setting],
                args: Sequence[str] | None) -> None:
    """Serve `--help`, and refuse arguments and parameters that there are not (exit status 2).

    A parameter after `-p` is meant for this node. One from a file may be meant for another node.
    """
    width = max(map(len, settings))
    lines = [f'  {name:<{width}}  {setting.description} (default: {default_text(setting.default)})'
             for name, setting in settings.items()]
    parser = program_parser(
        program, doc, usage=f'{program} [-h] [--ros-args -p NAME:=VALUE ... -r FROM:=TO ...]',
        epilog='parameters (--ros-args -p NAME:=VALUE):\n' + '\n'.join(lines))
    parser.add_argument('--shared-parameters', action='store_true',
                        help='parameters after -p are for several nodes, as those of SetParameter '
                        'in a launch file: log unknown ones, and start')
    options, unknown = parser.parse_known_args(outside_ros_args(args or ()))
    if unknown:
        hint = _as_parameter(unknown, settings)
        parser.error(f'unrecognized arguments: {" ".join(unknown)}{hint}')
    for rule in rules_after_p(args or ()):
        name, given, value = rule.partition(':=')
        if not given:
            parser.error(f'{shown(rule)} is not NAME:=VALUE, such as rate:=200.0')
        if value.startswith('[') and ']' not in value:  # a shell has cut it in pieces
            parser.error(f'{shown(rule)} is half a list: write it without blanks, as in '
                         f'{name}:=[1,2,3], or put it in quotes, as in "{name}:=[1, 2, 3]"')
        name = name.rpartition(':')[2]
        if not (name in settings or name in OF_RCLPY or name.startswith(QOS_OVERRIDES)
                or options.shared_parameters):
            parser.error(f'{unknown_name("parameter", name, settings)}. Parameters that several '
                         'nodes share need --params-file or --shared-parameters')


def _as_parameter(arguments: Sequence[str], settings: Collection[str]) -> str:
    """Return how to write the first of unknown arguments that names a parameter; '' for none."""
    for argument in arguments:
        name = argument.lstrip('-').partition('=')[0].rstrip(':').replace('-', '_')
        if name in settings:
            return f' (parameters follow --ros-args: --ros-args -p {name}:=VALUE)'
    return ''


def outside_ros_args(args: Sequence[str]) -> list[str]:
    """Return what is not between `--ros-args` and `--`; rclpy's function fails on a bad value."""
    found, inside = [], False
    for arg in args:
        if arg == '--ros-args' or (inside and arg == '--'):
            inside = arg == '--ros-args'
        elif not inside:
            found.append(arg)
    return found


def rules_after_p(args: Sequence[str]) -> list[str]:
    """Return what follows each `-p`: `NAME:=VALUE` or `NODE:NAME:=VALUE`."""
    return [rule for flag, rule in zip(args, args[1:]) if flag in ('-p', '--param')]


def default_text(default: Any) -> str:
    """Return a default as it is typed in a shell."""
    if isinstance(default, tuple):
        return '[' + ','.join(map(str, default)) + ']'
    return str(default).lower() if isinstance(default, bool) else str(default) or 'none'
