# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameters of a node as one table: checked, and declared to rclpy. Help needs no ROS.

Parameters are declared with dynamic typing. So the validator of each one refuses a value of another
type, and not rclpy. Where a double is meant, 200 is as good as 200.0.
"""
from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from ..core import LENGTH_MAX
from ..models.make_model import MODELS, MOST_SOUP_DIVISIONS, SOUP_DIVISIONS, check_model
from ..scene.boxes import CONTAINER
from ..solver.checks import nearest_name, short_repr, size_fault
from ..stream.pairing import PAIRINGS

if TYPE_CHECKING:
    from rcl_interfaces.msg import ParameterDescriptor
    from rclpy.node import Node

LONGEST = 1e6  # s, about twelve days

Validator = Callable[[str, Any], Any]
"""From a parameter's name and value to the value as the node uses it; ValueError if it is wrong."""


@dataclass(frozen=True)
class Setting:
    """One parameter: its default, what it means (with its unit), and what is accepted."""

    default: Any
    description: str
    validate: Validator


def limited(**limits: Any) -> Callable[[Validator], Validator]:
    """Decorate a validator with the limits that it checks, by fields of a ParameterDescriptor.

    A range is the least and the largest value.
    """
    def decorate(validate: Validator) -> Validator:
        validate.limits = limits  # type: ignore[attr-defined]
        return validate
    return decorate


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def number(low: float, high: float) -> Validator:
    """Validate a number within [low, high]; integers are as good as floats."""
    @limited(floating_point_range=(float(low), float(high)))
    def validate(name: str, value: Any) -> float:
        if not _is_number(value):
            raise ValueError(f'{name} must be a number, not {short_repr(value)}')
        if not low <= value <= high:
            raise ValueError(f'{name} must lie within {low:g} and {high:g}, not {value:g}')
        return float(value)
    return validate


def whole_number(low: int, high: int) -> Validator:
    """Validate a whole number within [low, high]."""
    @limited(integer_range=(low, high))
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


@limited(additional_constraints=f'one of: {", ".join(MODELS)}')
def model(name: str, value: Any) -> str:
    """Validate the name of a model."""
    check_model(name, text(name, value))
    return str(value)


CONTACT_PARAMETERS = {
    'size_a': Setting(CONTAINER, 'full extents of box A, three numbers > 0 [m]', size),
    'size_b': Setting(CONTAINER, 'full extents of box B, three numbers > 0 [m]', size),
    'scene': Setting('', 'scene file, which replaces size_a and size_b', text),
    'model': Setting('exact', f'how the contact point is found: {", ".join(MODELS)}', model),
    'pairing': Setting('stamp', 'stamp: answer once, when poses of equal stamp are in; latest: '
                                "answer every pose with the other boxes' last", one_of(PAIRINGS)),
    'tolerance': Setting(0.0, 'with pairing stamp: stamps this far apart still belong together [s]',
                         number(0.0, LONGEST)),
    'max_age': Setting(1.0, 'a box whose newest stamp is older than this is reported as stale; '
                            'with pairing latest, its pairs get no contact; 0: never [s]',
                       number(0.0, LONGEST)),
    'margin': Setting(0.0, 'pairs apart are listed as near up to this distance [m]',
                      number(0.0, LENGTH_MAX)),
    'pair_topics': Setting(True, 'whether pairs have topics of their own next to contacts', flag),
    'autostart': Setting(True, 'whether the node configures and activates itself', flag),
}
SOUP_PARAMETERS = {
    'divisions': Setting(
        SOUP_DIVISIONS, f'squares along each edge of a face, 1 to {MOST_SOUP_DIVISIONS}; '
        'N make 12 N² triangles a box', whole_number(1, MOST_SOUP_DIVISIONS)),
} | {name: setting for name, setting in CONTACT_PARAMETERS.items() if name != 'model'}
SCENE_PARAMETERS = {name: CONTACT_PARAMETERS[name] for name in ('size_a', 'size_b', 'scene')}
"""Of what shows a scene."""


def declare(node: Node, settings: Mapping[str, Setting], *, live: Collection[str] = (),
            ) -> dict[str, Any]:
    """Return the checked values of a node's parameters; declare those that are not declared yet.

    live: the names that may be set while the node runs; all others are read-only.
    Raises ValueError for the first bad value.
    """
    from .rclpy_workarounds import parameter_overrides

    given = parameter_overrides(node)
    values = {name: setting.validate(
        name, node.get_parameter(name).value if node.has_parameter(name)
        else given.get(name, setting.default)) for name, setting in settings.items()}
    for name, setting in settings.items():
        if not node.has_parameter(name):
            value = values[name]  # the checked value holds the override
            node.declare_parameter(
                name, list(value) if isinstance(value, tuple) else value,
                describe(setting, read_only=name not in live), ignore_override=True)
    return values


def describe(setting: Setting, *, read_only: bool) -> ParameterDescriptor:
    """Return what rclpy tells of a parameter."""
    from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

    limits = dict(getattr(setting.validate, 'limits', {}))
    for name, kind in (('floating_point_range', FloatingPointRange),
                       ('integer_range', partial(IntegerRange, step=1))):
        if name in limits:
            low, high = limits[name]
            limits[name] = [kind(from_value=low, to_value=high)]
    return ParameterDescriptor(description=setting.description, dynamic_typing=True,
                               read_only=read_only, **limits)


def warn_of_unknown(node: Node, settings: Mapping[str, Setting]) -> None:
    """Warn of given names that no parameter has; a file may be meant for several nodes.

    rclpy declares those of qualities of service with the topics.
    """
    from .rclpy_workarounds import parameter_overrides

    for name in parameter_overrides(node):
        if not node.has_parameter(name):
            node.get_logger().warning(f'unknown parameter {short_repr(name)}'
                                      f'{nearest_name(name, settings)}; it is ignored')


def reason_of(error: Exception) -> str:
    """Return what an error says; with its type, unless it is a refusal or a missing library."""
    known = isinstance(error, (ValueError, ImportError))
    return str(error) if known else f'{type(error).__name__}: {error}'
