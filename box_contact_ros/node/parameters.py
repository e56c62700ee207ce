# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameters of a node as one table: checked, and declared to rclpy.

Parameters are declared with dynamic typing. So the validator of each one refuses a value of another
type, and not rclpy. Where a double is meant, 200 is as good as 200.0.
"""
from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from ..solver.checks import nearest_name, short_repr, size_fault
from .rclpy_workarounds import parameter_overrides

Validator = Callable[[str, Any], Any]
"""From a parameter's name and value to the value as the node uses it; ValueError if it is wrong."""


@dataclass(frozen=True)
class Setting:
    """One parameter: its default, what it means (with its unit), and what is accepted."""

    default: Any
    description: str
    validate: Validator


def limited(**limits: Any) -> Callable[[Validator], Validator]:
    """Decorate a validator with the limits that it checks, by fields of a ParameterDescriptor."""
    def decorate(validate: Validator) -> Validator:
        validate.limits = limits  # type: ignore[attr-defined]
        return validate
    return decorate


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def number(low: float, high: float) -> Validator:
    """Validate a number within [low, high]; integers are as good as floats."""
    @limited(floating_point_range=[FloatingPointRange(from_value=float(low), to_value=float(high))])
    def validate(name: str, value: Any) -> float:
        if not _is_number(value):
            raise ValueError(f'{name} must be a number, not {short_repr(value)}')
        if not low <= value <= high:
            raise ValueError(f'{name} must lie within {low:g} and {high:g}, not {value:g}')
        return float(value)
    return validate


def whole_number(low: int, high: int) -> Validator:
    """Validate a whole number within [low, high]."""
    @limited(integer_range=[IntegerRange(from_value=low, to_value=high, step=1)])
    def validate(name: str, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise ValueError(f'{name} must be a whole number from {low} to {high}, '
                             f'not {short_repr(value)}')
        return value
    return validate


@limited(additional_constraints='three numbers > 0')
def size(name: str, value: Any) -> tuple[float, ...]:
    """Validate three full extents [m]."""
    given = list(value) if isinstance(value, Sequence) else value
    if not isinstance(given, list) or len(given) != 3 or not all(map(_is_number, given)):
        raise ValueError(f'{name} must be 3 numbers, not {short_repr(given)}')
    fault = size_fault(given)
    if fault:
        raise ValueError(f'{name} {fault}')
    return tuple(map(float, given))


def text(name: str, value: Any) -> str:
    """Validate a string."""
    if not isinstance(value, str):
        raise ValueError(f'{name} must be a string, not {short_repr(value)}')
    return value


def one_of(choices: Iterable[str]) -> Validator:
    """Validate one of some strings."""
    @limited(additional_constraints=f'one of: {", ".join(choices)}')
    def validate(name: str, value: Any) -> str:
        choice = text(name, value)
        if choice not in choices:
            raise ValueError(f'{name} {short_repr(value)} is not one of: {", ".join(choices)}'
                             f'{nearest_name(choice, choices)}')
        return choice
    return validate


def flag(name: str, value: Any) -> bool:
    """Validate true or false."""
    if not isinstance(value, bool):
        raise ValueError(f'{name} must be true or false, not {short_repr(value)}')
    return value


def declare(node: Node, settings: Mapping[str, Setting], *, live: Collection[str] = (),
            ) -> dict[str, Any]:
    """Return the checked values of a node's parameters; declare those that are not declared yet.

    live: the names that may be set while the node runs; all others are read-only.
    Raises ValueError for the first bad value.
    """
    given = parameter_overrides(node)
    values = {name: setting.validate(
        name, node.get_parameter(name).value if node.has_parameter(name)
        else given.get(name, setting.default)) for name, setting in settings.items()}
    for name, setting in settings.items():
        if not node.has_parameter(name):
            value = values[name]  # the checked value holds the override
            node.declare_parameter(
                name, list(value) if isinstance(value, tuple) else value,
                ParameterDescriptor(description=setting.description, dynamic_typing=True,
                                    read_only=name not in live,
                                    **getattr(setting.validate, 'limits', {})),
                ignore_override=True)
    return values


def warn_of_unknown(node: Node, settings: Mapping[str, Setting]) -> None:
    """Warn of given names that no parameter has; a file may be meant for several nodes.

    rclpy declares those of qualities of service with the topics.
    """
    for name in parameter_overrides(node):
        if not node.has_parameter(name):
            node.get_logger().warning(f'unknown parameter {short_repr(name)}'
                                      f'{nearest_name(name, settings)}; it is ignored')


def reason_of(error: Exception) -> str:
    """Return what an error says; with its type, unless it is a refusal or a missing library."""
    known = isinstance(error, (ValueError, ImportError))
    return str(error) if known else f'{type(error).__name__}: {error}'
