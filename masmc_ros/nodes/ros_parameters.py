# SPDX-License-Identifier: Apache-2.0
"""Declarations of `params/` as ROS 2 parameters: descriptors, checks and live changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import sys
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
import rclpy.parameter

from masmc_ros.errors import InputError
from masmc_ros.nodes.command_line import CommandLine
from masmc_ros.nodes.parameters import accepted, is_from_rcl
from masmc_ros.params.declaration import check_all, Parameter

_LARGEST = sys.float_info.max


def descriptor(parameter: Parameter) -> ParameterDescriptor:
    """Return the descriptor that `ros2 param describe` shows."""
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    result = ParameterDescriptor(
        name=parameter.name,
        description=f'{parameter.description}{unit}',
        additional_constraints=parameter.expected,
        read_only=parameter.read_only,
        # What changes while running is typed dynamically: a refusal is then ours to word.
        dynamic_typing=parameter.broadcast or not parameter.read_only,
    )
    low, high = parameter.minimum, parameter.maximum
    if parameter.kind == 'double' and (low is not None or high is not None):
        result.floating_point_range = [
            FloatingPointRange(
                from_value=-_LARGEST if low is None else float(low),
                to_value=_LARGEST if high is None else float(high),
            )
        ]
    if parameter.kind == 'integer' and (low is not None or high is not None):
        result.integer_range = [
            IntegerRange(
                from_value=-(2**63) if low is None else int(low),
                to_value=2**63 - 1 if high is None else int(high),
                step=1,
            )
        ]
    return result


class RosParameters:
    """The parameters of one node: values in force, and changes while running."""

    def __init__(
        self,
        node: Node,
        declarations: Sequence[Parameter],
        *,
        command_line: CommandLine,
        check: Callable[[Mapping[str, Any]], None] = lambda _: None,
    ) -> None:
        """Declare everything on the node.

        `check` refuses by InputError combinations that no single declaration can.
        Raises InputError for unknown names and values that are not right.
        """
        self._node = node
        self._declarations = {p.name: p for p in declarations}
        self._check = check
        self._listeners: list[Callable[[dict[str, Any]], None]] = []
        name = node.get_name()
        given = {**_given(node), **command_line.for_node(name)}
        given = {n: v for n, v in given.items() if not is_from_rcl(n)}
        for shared in accepted(name) & given.keys():
            del given[shared]
        self.values = check_all(declarations, given, where=f'{name}: ')
        check(self.values)
        for parameter in declarations:
            value = given.get(parameter.name, self.values[parameter.name])
            node.declare_parameter(
                parameter.name,
                _as_ros(parameter, value),
                descriptor(parameter),
                ignore_override=True,
            )
        node.add_pre_set_parameters_callback(self._coerce)
        node.add_on_set_parameters_callback(self._refuse)
        node.add_post_set_parameters_callback(self._commit)

    def on_change(self, listener: Callable[[dict[str, Any]], None]) -> None:
        """Call the listener with the checked values that a change brings, after it."""
        self._listeners.append(listener)

    def _coerce(self, changes: list[Any]) -> list[Any]:
        """Turn integers into doubles where a double is declared; touch nothing else."""
        return [
            rclpy.parameter.Parameter(c.name, value=_doubles(self._declarations.get(c.name), c))
            if c.name in self._declarations and c.value is not None
            else c
            for c in changes
        ]

    def _refuse(self, changes: list[Any]) -> SetParametersResult:
        try:
            self._check({**self.values, **self._checked(changes)})
        except InputError as error:
            self._restore_types(changes)
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _restore_types(self, changes: list[Any]) -> None:
        """Undo what rclpy has noted as the types of refused values."""
        for change in changes:
            if self._node.has_parameter(change.name):
                in_force = self._node.get_parameter(change.name)
                self._node.describe_parameter(change.name).type = in_force.type_.value

    def _commit(self, changes: list[Any]) -> None:
        new = self._checked(changes)
        if new:
            self.values.update(new)
            for listener in self._listeners:
                listener(new)

    def _checked(self, changes: list[Any]) -> dict[str, Any]:
        return {
            c.name: self._declarations[c.name].check(_plain(c.value))
            for c in changes
            if c.name in self._declarations
        }


def _given(node: Node) -> dict[str, Any]:
    """Return what files and command line give this node, as rcl resolved it."""
    # rclpy has no public way to see overrides that nobody declares, and passes them silently.
    overrides = node._parameter_overrides
    return {name: _plain(parameter.value) for name, parameter in overrides.items()}


def _plain(value: Any) -> Any:
    """Return arrays as lists, other values as they are."""
    scalar = value is None or isinstance(value, (bool, int, float, str))
    return value if scalar else list(value)


def _as_ros(parameter: Parameter, value: Any) -> Any:
    """Return a checked value in the form that rclpy declares."""
    if parameter.broadcast:
        value = [float(v) for v in value] if isinstance(value, list) else value
        return float(value) if isinstance(value, int) else value
    # rclpy cannot tell the type of an empty array; one empty name stands for none.
    return [''] if value in (None, (), []) else value


def _doubles(parameter: Parameter | None, change: Any) -> Any:
    value = _plain(change.value)
    if parameter is None or parameter.kind not in ('double', 'doubles'):
        return value
    if isinstance(value, list):
        exact = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in value)
        return [float(v) for v in value] if exact else value
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
