# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameters of a table, declared to rclpy and changed while a node runs.

Parameters are declared with dynamic typing, so that the check of each setting refuses a value of
another type, and not rclpy. What the check returns is stored: 200 becomes 200.0 where a double is
meant. rclpy itself enforces the ranges in the descriptors.
"""
from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from .parameters import QOS_OVERRIDES, Limits, Setting, checked, reason_of, unknown_name
from .rclpy_workarounds import parameter_overrides

LOCKED = 'the node is locked: nothing can be changed after its start'


def declare(node: Node, settings: Mapping[str, Setting], *, fixed: bool = False,
            ) -> dict[str, Any]:
    """Declare and check a node's parameters; `fixed`: none can be changed while it runs."""
    given = parameter_overrides(node)
    values = checked(settings, {name: given.get(name, setting.default)
                                for name, setting in settings.items()})
    for name, setting in settings.items():
        node.declare_parameter(
            name, _stored(values[name]), _descriptor(
                setting, read_only=fixed or setting.fixed or values.get('locked', False)),
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


def _descriptor(setting: Setting, *, read_only: bool) -> ParameterDescriptor:
    """Return what tools show of a parameter."""
    limits = setting.check if isinstance(setting.check, Limits) else Limits(setting.check)
    descriptor = ParameterDescriptor(
        description=setting.description, dynamic_typing=True, read_only=read_only,
        additional_constraints=limits.words)
    if limits.range:
        low, high = limits.range
        if isinstance(setting.default, int):
            descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
        else:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(low), to_value=float(high))]
    return descriptor


def _refuse_requests(node: Node) -> None:
    """Refuse what others ask to set, rclpy's own parameters too, before any value is looked at.

    A stranger's megabyte of text or unknown type costs no more than its transport.
    """
    refusal = SetParametersResult(successful=False, reason=LOCKED)

    def refuse(request: Any, response: Any) -> Any:
        response.results = [refusal] * len(request.parameters)
        return response

    def refuse_all(request: Any, response: Any) -> Any:
        response.result = refusal
        return response

    for service in node.services:
        if service.srv_type is SetParameters:
            service.callback = refuse
        elif service.srv_type is SetParametersAtomically:
            service.callback = refuse_all


class CheckedParameters:
    """The parameters of a running node: changed together if all are good, else not at all."""

    def __init__(self, node: Node, settings: Mapping[str, Setting],
                 apply: Callable[[dict[str, Any], Collection[str]], None]) -> None:
        """Declare and check; `apply` gets new values and the names that were set, or refuses."""
        self._settings, self._apply = settings, apply
        self.values = declare(node, settings)
        if self.values.get('locked'):
            _refuse_requests(node)
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
        changes = {p.name: p.value for p in parameters if p.name in self._settings}
        try:
            values = checked(self._settings, {**self.values, **changes})
            self._apply(values, changes)
        except Exception as error:  # the client would wait for ever
            return SetParametersResult(successful=False, reason=reason_of(error))
        self.values = values
        return SetParametersResult(successful=True)
