# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters that differ between the runs of a campaign, and axes with their values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
import re
from typing import NamedTuple

from masmc_ros.aliases import AnyArray
from masmc_ros.errors import InputError
from masmc_ros.loop.scenario import Scenario
from masmc_ros.params.declaration import MutableValues, Parameter, Value, Values
from masmc_ros.params.text import Scalar, typed, yaml_text
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.scenario.scenario import readers
import numpy as np

_ENTRY = re.compile(r'(.+)\[([0-9]+)\]')

_TYPES: dict[str, type[np.generic]] = {'bool': np.bool_, 'integer': np.int64, 'string': np.str_}
"""Types of columns by kind; the others are doubles."""


@dataclass(frozen=True)
class Variable:
    """
    Parameter of a scenario, or an entry of an array, that differs between runs.

    Attributes
    ----------
    name
        NODE.parameter or a shared parameter, as in `--set`; with [INDEX] an entry of an array.
    readers
        Declaration of the parameter by each node that reads it.
    index
        Index of the entry, from 0; None for a whole parameter.

    """

    name: str
    readers: Mapping[str, Parameter]
    index: int | None = None

    @classmethod
    def named(cls, name: str, mechanism: Mechanism, place: str) -> Variable:
        """
        Return the variable of a name.

        Parameters
        ----------
        name
            Name as in `--set`, with [INDEX] for an entry of an array.
        mechanism
            Type of the robot, which determines the known names.
        place
            Start of messages, such as the option.

        Raises
        ------
        InputError
            if no parameter has this name, or if it cannot vary.

        """
        entry = _ENTRY.fullmatch(name)
        variable = cls(
            name,
            readers(entry[1] if entry else name, mechanism, place),
            int(entry[2]) if entry else None,
        )
        parameter = variable.parameter
        if parameter.kind == 'strings' or (parameter.kind == 'string' and not parameter.choices):
            raise InputError(
                f'{place}: {parameter.name} is a text; expected a number, or a choice of several'
            )
        if parameter.name.startswith('robot.') and parameter.kind == 'string':
            raise InputError(f'{place}: expected the same type of robot in all runs')
        if variable.index is not None and variable.index >= (parameter.length or 0):
            expected = f'an index < {parameter.length}' if parameter.length else 'no index'
            raise InputError(f'{place}: {name}: expected {expected}')
        return variable

    @property
    def parameter(self) -> Parameter:
        """Return the declaration, which is the same for all nodes."""
        return next(iter(self.readers.values()))

    def overlaps(self, other: Variable) -> bool:
        """Return True if both variables write the same value of a node."""
        writes_all = None in (self.index, other.index)
        return (writes_all or self.index == other.index) and any(
            node in other.readers and other.readers[node].name == parameter.name
            for node, parameter in self.readers.items()
        )

    def checked(self, values: Values, parameter: Parameter, value: object) -> Value:
        """
        Return the checked value of the parameter for a node.

        Parameters
        ----------
        values
            Values of the node by name; they contain the other entries of an array.
        parameter
            Declaration of the parameter by the node.
        value
            Value of the variable.

        """
        if parameter.kind == 'integer' and isinstance(value, float) and value.is_integer():
            value = int(value)
        if self.index is not None:
            entries = list(values[parameter.name])
            entries[self.index] = value
            value = entries
        return parameter.check(value, integers_for_doubles=True)

    def column(self, values: Sequence[object]) -> AnyArray:
        """Return values of several runs as an array (runs) of the type of the parameter."""
        return np.array(values, _TYPES.get(self.parameter.kind, np.float64))

    def setting(self, scenario: Scenario) -> str:
        """Return the option `--set` that gives the parameter its value in a scenario."""
        node, parameter = next(iter(self.readers.items()))
        whole = self.name.partition('[')[0]
        return f'{whole}={yaml_text(scenario[node][parameter.name])}'


def with_variables(
    scenario: Scenario, variables: Sequence[Variable], values: Sequence[object]
) -> Scenario:
    """Return a scenario with values of variables; InputError if a node would reject one."""
    known = scenario.values
    nodes: dict[str, MutableValues] = {}
    for variable, value in zip(variables, values, strict=True):
        for node, parameter in variable.readers.items():
            if node in known:
                own = nodes.setdefault(node, dict(known[node]))
                own[parameter.name] = variable.checked(own, parameter, value)
    return scenario.with_nodes(nodes)


def check_distinct(variables: Sequence[Variable]) -> None:
    """Raise InputError if two variables write the same value: only one would apply."""
    for one, other in combinations(variables, 2):
        if one.name == other.name:
            raise InputError(f'{one.name}: varies twice; expected each parameter once')
        if one.overlaps(other):
            raise InputError(
                f'{one.name}, {other.name}: the same parameter varies twice; expected each'
                ' parameter of a node once'
            )


FORM = 'NAME=LOW:HIGH:COUNT, NAME=LOW:HIGH:COUNT:log, or NAME=VALUE,VALUE,...'

_MOST = 1_000_000
"""Largest number of values of a range."""


class Axis(NamedTuple):
    """Parameter with the values that it takes, in their order."""

    name: str
    values: tuple[Scalar, ...]


def axis(text: str) -> Axis:
    """Return the axis of `--vary`, see FORM; InputError for another text or an empty range."""
    name, _, values = text.partition('=')
    if not name or not values:
        raise InputError(f'--vary {text}: expected {FORM}')
    if ':' in values:
        return Axis(name, _range(f'--vary {text}', values.split(':')))
    listed = tuple(typed(value.strip()) for value in values.split(','))
    if '' in listed or len(set(listed)) < len(listed):
        raise InputError(f'--vary {text}: expected different values, separated by commas')
    return Axis(name, listed)


def _range(place: str, parts: list[str]) -> tuple[float, ...]:
    is_log = parts[3:] == ['log']
    numbers = [typed(part) for part in parts[:3]]
    is_form = len(parts) == 4 if is_log else len(parts) == 3
    if not is_form or not all(map(_is_number, numbers)) or not isinstance(numbers[2], int):
        raise InputError(f'{place}: expected {FORM}')
    start, end, count = float(numbers[0]), float(numbers[1]), numbers[2]
    if not start < end or count < 2:
        raise InputError(f'{place}: empty range; expected LOW < HIGH and COUNT >= 2')
    if count > _MOST:
        raise InputError(f'{place}: {count} values; expected at most {_MOST}')
    if is_log and start <= 0.0:
        raise InputError(f'{place}: expected LOW > 0 for a logarithmic range')
    steps = count - 1
    if is_log:
        return (start, *(start * (end / start) ** (k / steps) for k in range(1, steps)), end)
    # The product first: whole numbers stay whole.
    return (start, *(start + (end - start) * k / steps for k in range(1, steps)), end)


def _is_number(value: Scalar) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
