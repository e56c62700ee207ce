# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node parameters as one table per node: declared, checked, and listed by `--help`.

Parameters are declared with dynamic typing, so that the check of each setting refuses a value of
another type, and not rclpy. What the check returns is stored: 200 becomes 200.0 where a double is
meant. rclpy itself enforces the ranges in the descriptors.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from ..solver.arguments import program_parser
from ..solver.checks import nearest_name, shown, size_fault
from .rclpy_workarounds import parameter_overrides

Check = Callable[[str, Any], Any]
"""From a parameter's name and value to the value as the node uses it; ValueError if it is wrong."""


OF_RCLPY = ('use_sim_time', 'start_type_description_service')  # every node has them
QOS_OVERRIDES = 'qos_overrides.'  # begins the names of those that are declared with a topic
LONGEST_REASON = 1000  # characters: it may quote what a stranger sent
LOCKED = 'the node is locked: nothing can be changed after its start'


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

    def descriptor(self, *, read_only: bool) -> ParameterDescriptor:
        """Return what tools show of the parameter."""
        limits = self.check if isinstance(self.check, Limits) else Limits(self.check)
        descriptor = ParameterDescriptor(
            description=self.description, dynamic_typing=True, read_only=read_only,
            additional_constraints=limits.words)
        if limits.range:
            low, high = limits.range
            if isinstance(self.default, int):
                descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
            else:
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=float(low), to_value=float(high))]
        return descriptor


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


def declare(node: Node, settings: Mapping[str, Setting], *, fixed: bool = False,
            ) -> dict[str, Any]:
    """Declare and check a node's parameters; `fixed`: none can be changed while it runs."""
    given = parameter_overrides(node)
    values = checked(settings, {name: given.get(name, setting.default)
                                for name, setting in settings.items()})
    for name, setting in settings.items():
        node.declare_parameter(
            name, _stored(values[name]), setting.descriptor(
                read_only=fixed or setting.fixed or values.get('locked', False)),
            ignore_override=True)  # the checked value holds the override
    _say_unknown(node, settings)
    return values


def _stored(value: Any) -> Any:
    """Return a checked value as rclpy takes it."""
    return list(value) if isinstance(value, tuple) else value


def _say_unknown(node: Node, settings: Mapping[str, Setting]) -> None:
    """Warn of names without a parameter; a file of parameters may be meant for several nodes."""
    for name in parameter_overrides(node):
        # Those of topics are declared with the topics.
        if not node.has_parameter(name) and not name.startswith(QOS_OVERRIDES):
            node.get_logger().warning(f'{unknown_name("parameter", name, settings)}; it is ignored')


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """Return the refusal of a name that there is not, with the nearest name if one is near."""
    return f'unknown {kind} {shown(name)}{nearest_name(name, known)}'


def checked(settings: Mapping[str, Setting], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return all values as the node uses them, or raise ValueError for the first bad one."""
    return {name: setting.check(name, values[name]) for name, setting in settings.items()}


class CheckedParameters:
    """The parameters of a running node: changed together if all are good, else not at all."""

    def __init__(self, node: Node, settings: Mapping[str, Setting],
                 apply: Callable[[dict[str, Any], Collection[str]], None]) -> None:
        """Declare and check; `apply` gets new values and the names that were set, or refuses."""
        self._settings, self._apply = settings, apply
        self.values = declare(node, settings)
        node.add_pre_set_parameters_callback(self._as_checked)
        node.add_on_set_parameters_callback(self._on_set)

    def _as_checked(self, parameters: list[Parameter]) -> list[Parameter]:
        """Return parameters with the values that are stored, bad ones as they came."""
        found = []
        for parameter in parameters:
            with suppress(Exception):  # `_on_set` refuses what is bad
                value = self._settings[parameter.name].check(parameter.name, parameter.value)
                parameter = Parameter(parameter.name, value=_stored(value))
            found.append(parameter)
        return found

    def _on_set(self, parameters: list[Parameter]) -> SetParametersResult:
        if self.values.get('locked'):  # other nodes' parameters, such as use_sim_time, too
            return SetParametersResult(successful=False, reason=LOCKED)
        changes = {p.name: p.value for p in parameters if p.name in self._settings}
        try:
            values = checked(self._settings, {**self.values, **changes})
            self._apply(values, changes)
        except Exception as error:  # the client would wait for ever
            return SetParametersResult(successful=False, reason=reason_of(error))
        self.values = values
        return SetParametersResult(successful=True)


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
