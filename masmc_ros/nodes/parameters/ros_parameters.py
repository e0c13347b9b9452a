# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Declarations of `params/` as ROS 2 parameters: descriptors, checks and live changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
import sys
from typing import Any, NamedTuple

from masmc_ros.errors import InputError, suggestion
from masmc_ros.nodes.middleware.clock import CheckedClockNode
from masmc_ros.nodes.parameters.services import CheckedParameterService
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.params.declaration import check_all, MutableValues, Parameter, Values
from masmc_ros.params.text import yaml_text
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.scenario.node_parameters import accepted, drop_foreign, foreign_text
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.context import Context
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
import rclpy.parameter

_LARGEST = sys.float_info.max


def descriptor(parameter: Parameter) -> ParameterDescriptor:
    """Return the descriptor that `ros2 param describe` shows."""
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    result = ParameterDescriptor(
        name=parameter.name,
        description=f'{parameter.description}{unit}',
        additional_constraints=parameter.expected,
        read_only=parameter.read_only,
        # With dynamic typing rclpy checks no types, and the errors have this package's texts.
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


class ParameterNode(CheckedClockNode):
    """
    A node whose parameters start with the values of its command line, as this package reads it.

    A parameter, even a read-only one, may be set to its active value. So `ros2 param load`
    accepts the output of `ros2 param dump`.

    Attributes
    ----------
    outcome
        Function that returns the response to a valid request from its parameter names.

    """

    outcome: Callable[[Iterable[str]], SetParametersResult] | None = None

    def __init__(self, name: str, *, context: Context, command_line: CommandLine) -> None:
        """
        Initialise the node, with parameter services that answer every request.

        Parameters
        ----------
        name
            Name of the node, unless a remapping replaces it.
        context
            Context of the process.
        command_line
            Files and settings with the start values of the parameters.

        Raises
        ------
        InputError
            If a parameter of rclpy itself has a value of the wrong type.

        """
        self._command_line = command_line
        super().__init__(name, context=context, start_parameter_services=False)
        self._parameter_service = CheckedParameterService(self)

    def declare_parameter(
        self,
        name: str,
        value: Any = None,
        descriptor: ParameterDescriptor | None = None,
        ignore_override: bool = False,
    ) -> Any:
        """
        Declare a parameter as `Node` does, but never with the value that rcl has read.

        rclpy itself declares `use_sim_time` and `start_type_description_service` while a node
        is created. Their values have the same order of precedence.
        """
        if not ignore_override:
            start = self._command_line.for_node(self.get_name(), self.get_namespace()).values
            if name in start:
                value = _checked_bool(f'{self.get_name()}: {name}', start[name])
        return super().declare_parameter(
            name, value, descriptor or ParameterDescriptor(), ignore_override=True
        )

    def set_parameters_atomically(
        self, parameter_list: list[rclpy.parameter.Parameter]
    ) -> SetParametersResult:
        """Set the parameters whose values change."""
        new = [parameter for parameter in parameter_list if not self._is_set(parameter)]
        result = SetParametersResult(successful=True)
        if new or not parameter_list:
            result = super().set_parameters_atomically(new)
        if result.successful and self.outcome is not None:
            return self.outcome([parameter.name for parameter in parameter_list])
        return result

    def _is_set(self, requested: rclpy.parameter.Parameter) -> bool:
        if not self.has_parameter(requested.name):
            return False
        current = self.get_parameter(requested.name)
        is_same_type: bool = current.type_ == requested.type_
        return is_same_type and _plain(current.value) == _plain(requested.value)


def _checked_bool(name: str, value: object) -> bool:
    """Return the start value of a parameter of rclpy itself; all are bools."""
    if not isinstance(value, bool):
        raise InputError(f'{name} = {yaml_text(value)}: expected true or false')
    return value


class Pending(NamedTuple):
    """The response to a request that does not take effect at once."""

    text: str = ''
    """Time of the effect, or reason of a failure; empty for an effect at once."""
    withdrawn: tuple[str, ...] = ()
    """Names of parameters that keep their values because the change has failed."""


class RosParameters:
    """
    Parameters of one node: current values, and changes while running.

    The services return the requested value of a parameter. `values`, which the node uses, has it
    when it takes effect: at once, unless the node decides otherwise (`on_request`).

    Attributes
    ----------
    values
        Current checked values by name.

    """

    def __init__(
        self,
        node: Node,
        declare: Callable[[Mechanism], Sequence[Parameter]],
        *,
        command_line: CommandLine,
        check: Callable[[Values], None] = lambda _: None,
    ) -> None:
        """
        Declare the parameters on the node.

        Parameters
        ----------
        node
            Node of the parameters.
        declare
            Function that returns the declarations for a mechanism.
        command_line
            Files and settings with the start values.
        check
            Function that raises InputError for invalid combinations of parameters.

        Raises
        ------
        InputError
            If a name is unknown or a value is invalid.

        """
        self._node = node
        self._check = check
        self._listeners: list[Callable[[MutableValues], None]] = []
        self._decide: Callable[[MutableValues], Pending] | None = None
        self._requested: MutableValues = {}
        self._pending: dict[str, Pending] = {}
        if isinstance(node, ParameterNode):
            node.outcome = self._outcome
        name = node.get_name()
        start = command_line.for_node(name, node.get_namespace())
        start_values = dict(start.values)
        mechanism = mechanism_from(start_values)
        declarations = declare(mechanism)
        self._declarations = {p.name: p for p in declarations}
        for shared in accepted(name, mechanism) & start_values.keys():
            del start_values[shared]
        if foreign := drop_foreign(name, start_values, start.shared, f'{name}: '):
            node.get_logger().warning(foreign_text(foreign))
        self.values = check_all(declarations, start_values, where=f'{name}: ')
        check(self.values)
        for parameter in declarations:
            value = start_values.get(parameter.name, self.values[parameter.name])
            node.declare_parameter(
                parameter.name,
                _as_ros(parameter, value),
                descriptor(parameter),
                ignore_override=True,
            )
        node.add_pre_set_parameters_callback(self._coerce)
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._commit)

    def on_change(self, listener: Callable[[MutableValues], None]) -> None:
        """Call the listener after each change, with the new checked values."""
        self._listeners.append(listener)

    def on_request(self, decide: Callable[[MutableValues], Pending]) -> None:
        """
        Let the node decide when requested values take effect.

        `decide` is called with the checked values of a request. It applies those that take
        effect at once, and returns the response for the others. The node later applies these by
        `take_effect` or discards them by `withdraw`.
        """
        self._decide = decide

    def take_effect(self, values: Values) -> None:
        """Use checked values from now on."""
        self._forget(values)
        new = {name: v for name, v in values.items() if v != self.values[name]}
        if new:
            self.values.update(new)
            for listener in self._listeners:
                listener(new)

    def withdraw(self, names: Iterable[str]) -> None:
        """Reset parameters to the current values and discard the requested ones."""
        names = tuple(names)
        self._forget(names)
        if not names:
            return
        self._node.set_parameters_atomically(
            [
                rclpy.parameter.Parameter(
                    name, value=_as_ros(self._declarations[name], _plain(self.values[name]))
                )
                for name in names
            ]
        )

    def _coerce(self, changes: list[rclpy.parameter.Parameter]) -> list[rclpy.parameter.Parameter]:
        """Convert integers to doubles for parameters that are declared as doubles."""
        for change in changes:
            if not self._node.has_parameter(change.name):
                raise _UnknownParameter(change.name, self._declarations)
        return [
            rclpy.parameter.Parameter(c.name, value=_doubles(self._declarations.get(c.name), c))
            if c.name in self._declarations and c.value is not None
            else c
            for c in changes
        ]

    def _validate(self, changes: list[rclpy.parameter.Parameter]) -> SetParametersResult:
        try:
            self._check({**self.values, **self._requested, **self._checked(changes)})
        except InputError as error:
            self._restore_types(changes)
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _restore_types(self, changes: list[rclpy.parameter.Parameter]) -> None:
        """Restore the types in the descriptors, which rclpy takes from rejected requests too."""
        for change in changes:
            if self._node.has_parameter(change.name):
                current = self._node.get_parameter(change.name)
                self._node.describe_parameter(change.name).type = current.type_.value

    def _commit(self, changes: list[rclpy.parameter.Parameter]) -> None:
        values = self._checked(changes)
        if self._decide is None:
            self.take_effect(values)
            return
        self._requested.update(values)
        pending = self._decide(values)
        # Values that have taken effect, and unchanged values, are not pending.
        for name, value in tuple(self._requested.items()):
            if value == self.values[name]:
                self._forget([name])
        if pending.text:
            self._pending.update(dict.fromkeys(values.keys() & self._requested.keys(), pending))

    def _outcome(self, names: Iterable[str]) -> SetParametersResult:
        """Return the response to a request after it was processed, or to its repetition."""
        for name in names:
            pending = self._pending.get(name)
            if pending is not None:
                self.withdraw(pending.withdrawn)
                return SetParametersResult(
                    successful=not pending.withdrawn, reason=pending.text
                )
        return SetParametersResult(successful=True)

    def _forget(self, names: Iterable[str]) -> None:
        """Remove names from the pending requests."""
        for name in names:
            self._requested.pop(name, None)
            self._pending.pop(name, None)

    def _checked(self, changes: list[rclpy.parameter.Parameter]) -> MutableValues:
        return {
            c.name: self._declarations[c.name].check(_plain(c.value))
            for c in changes
            if c.name in self._declarations
        }


class _UnknownParameter(ParameterNotDeclaredException):
    """Response of rclpy's services to a client that sets an undeclared parameter."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        super().__init__(name)
        self._text = f"unknown parameter '{name}'; {suggestion(name, known)}"

    def __str__(self) -> str:
        return self._text


def _plain(value: Any) -> Any:
    """Return arrays as lists, other values unmodified."""
    is_scalar = value is None or isinstance(value, (bool, int, float, str))
    return value if is_scalar else list(value)


def _as_ros(parameter: Parameter, value: Any) -> object:
    """Return a checked value in the form that rclpy declares."""
    if parameter.broadcast and parameter.kind == 'doubles':
        value = [float(v) for v in value] if isinstance(value, list) else value
        return float(value) if isinstance(value, int) else value
    # rclpy cannot infer the type of an empty array; one empty name represents it.
    return [''] if value in (None, (), []) else value


def _doubles(parameter: Parameter | None, change: rclpy.parameter.Parameter) -> object:
    value = _plain(change.value)
    if parameter is None or parameter.kind not in ('double', 'doubles'):
        return value
    if isinstance(value, list):
        is_numeric = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in value)
        return [float(v) for v in value] if is_numeric else value
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
