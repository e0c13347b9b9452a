# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Declaration of a parameter: name, type, default, range and the check of its values."""

from __future__ import annotations

import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
import math
import re
from typing import Any, Generic, Literal, TypeGuard, TypeVar

from masmc_ros.errors import InputError, suggestion
from masmc_ros.params.text import typed, yaml_text


@dataclass(frozen=True)
class Bounds:
    """Interval of the finite numbers; None: no bound on that side."""

    minimum: float | None
    maximum: float | None
    exclusive_minimum: bool
    exclusive_maximum: bool

    def contain(self, value: float) -> bool:
        """Return True if a number is finite and within the bounds."""
        if not math.isfinite(value):
            return False
        if self.minimum is not None and (
            value <= self.minimum if self.exclusive_minimum else value < self.minimum
        ):
            return False
        return self.maximum is None or (
            value < self.maximum if self.exclusive_maximum else value <= self.maximum
        )

    def __str__(self) -> str:
        """Return '>= 0', '< 5', 'in (0, 1]', or '' without bounds."""
        if self.minimum is not None and self.maximum is not None:
            opening = '(' if self.exclusive_minimum else '['
            closing = ')' if self.exclusive_maximum else ']'
            return f'in {opening}{_short(self.minimum)}, {_short(self.maximum)}{closing}'
        if self.minimum is not None:
            return f'{">" if self.exclusive_minimum else ">="} {_short(self.minimum)}'
        if self.maximum is not None:
            return f'{"<" if self.exclusive_maximum else "<="} {_short(self.maximum)}'
        return ''


def _short(number: float) -> str:
    """Return a bound as text, without a trailing '.0'."""
    text = f'{number:g}'
    return text if float(text) == number else repr(number)


Value = bool | int | float | str | tuple[float, ...] | tuple[str, ...]
"""Checked value of a parameter, of the declared type."""

Values = Mapping[str, Any]
"""
Value by parameter name; checked, unless a function checks it.

The declaration of a parameter determines the type of its value: `PERIOD.of(values)`.
"""

MutableValues = dict[str, Any]
"""Values in a dictionary that the receiver may change."""

Content = TypeVar('Content')
"""Type of the checked values of a parameter."""

Kind = Literal['', 'bool', 'integer', 'double', 'string', 'doubles', 'strings']

_LONGEST_QUOTE = 120
_ARRAY = re.compile(r'\s*\[([^][]*)\]\s*')
_NOUNS: dict[str, str] = {
    'bool': 'true or false',
    'integer': 'an integer',
    'double': 'a number',
    'string': 'a string',
    'doubles': 'number',
    'strings': 'string',
}


@dataclass(frozen=True)
class Parameter(Generic[Content]):
    """
    A parameter's declaration.

    Attributes
    ----------
    name
        dotted name within its node.
    default
        value without a setting; a broadcast one is extended to all entries.
    description
        meaning, one sentence without the unit.
    unit
        SI unit or ''.
    length
        number of entries of an array, None for any number.
    broadcast
        a number stands for an array of `length` equal entries, and integers for
        doubles; a string for an array of it. Such a parameter is typed dynamically
        in ROS 2.
    minimum
        smallest value (of each entry), None for no bound.
    maximum
        largest value (of each entry), None for no bound.
    exclusive_minimum
        whether `minimum` itself is out of range.
    exclusive_maximum
        whether `maximum` itself is out of range.
    choices
        the values that a string (or each entry) may have, or a function that
        returns them; none means any.
    read_only
        False if it may be changed while the node runs.
    size
        name, in compiled code, of the number of entries of an array, such as 'joints'.
    rule
        further condition on a value of the right type, length and range, or None.
    rule_text
        expected value in messages if there is a `rule`: 'the names of 4 joints'.
    kind
        'bool', 'integer', 'double', 'string', 'doubles' or 'strings' (arrays); by default
        that of the default value, with 'strings' for the empty tuple.

    """

    name: str
    default: Content
    description: str
    unit: str = ''
    length: int | None = None
    broadcast: bool = False
    minimum: float | None = None
    maximum: float | None = None
    exclusive_minimum: bool = False
    exclusive_maximum: bool = False
    choices: tuple[str, ...] | Callable[[], Sequence[str]] = ()
    read_only: bool = True
    rule: Callable[[Any], bool] | None = None
    rule_text: str = ''
    size: str = ''
    kind: Kind = ''

    def __post_init__(self) -> None:
        """Set the kind and check the default."""
        if self.broadcast and self.length is None and self._kind_of_default() == 'doubles':
            raise ValueError(f'{self.name}: a broadcast parameter needs a length')
        object.__setattr__(self, 'kind', self.kind or self._kind_of_default())
        # Functions of choices may load plug-ins, and are not called while modules load.
        choices = () if callable(self.choices) else self.choices
        object.__setattr__(self, 'default', self._checked(self.default, self.broadcast, choices))

    def _kind_of_default(self) -> Kind:
        default = self.default
        if isinstance(default, tuple) or self.broadcast:
            texts = _is_array(default) and all(isinstance(entry, str) for entry in default)
            return 'strings' if texts else 'doubles'
        kinds: dict[type, Kind] = {bool: 'bool', int: 'integer', float: 'double', str: 'string'}
        return kinds[type(default)]

    def of(self, values: Values) -> Content:
        """Return the value of this parameter among those of a node; KeyError if it is missing."""
        value: Content = values[self.name]
        return value

    def or_default(self, values: Values) -> Content:
        """Return the value of this parameter, or its default if it is missing."""
        value: Content = values.get(self.name, self.default)
        return value

    @cached_property
    def bounds(self) -> Bounds:
        """Return the range of the number or of each entry."""
        return Bounds(self.minimum, self.maximum, self.exclusive_minimum, self.exclusive_maximum)

    @property
    def expected(self) -> str:
        """Return the expected value, such as 'a number or 4 numbers, each >= 0'."""
        if self.rule is not None:
            return self.rule_text
        choices = ', '.join(self.known_choices())
        limits = str(self.bounds) or (f'one of {choices}' if choices else '')
        noun = _NOUNS[self.kind]
        if self.kind == 'string' and choices:
            return limits
        if self.kind not in ('doubles', 'strings'):
            return f'{noun} {limits}'.rstrip()
        entries = f'{noun}s' if self.length != 1 else noun
        many = f'an array of {entries}' if self.length is None else f'{self.length} {entries}'
        if self.broadcast:
            many = f'a {noun} or {many}'
        return f'{many}, each {limits}' if limits else many

    def known_choices(self) -> tuple[str, ...]:
        """Return the current choices."""
        return tuple(self.choices() if callable(self.choices) else self.choices)

    def check(self, value: object, *, integers_for_doubles: bool = False) -> Value:
        """
        Coerce a value to the type of this parameter and check its length and range.

        Parameters
        ----------
        value
            value of a parameter file, a ROS 2 node or a command line.
        integers_for_doubles
            accept `1` for `1.0`. ROS 2 rejects it for a parameter of static type; a
            broadcast parameter always accepts it.

        Returns
        -------
            A bool, int, float or str, or a tuple of floats or of strings.

        Raises
        ------
        InputError
            with the parameter, the value and the expected value.

        """
        return self._checked(value, integers_for_doubles or self.broadcast, self.known_choices())

    def _checked(
        self, value: object, integers_for_doubles: bool, choices: tuple[str, ...]
    ) -> Value:
        coerced = self._coerced(value)
        fits = coerced is not None and self._in_bounds(coerced, choices)
        if coerced is None or not fits or not (self.rule is None or self.rule(coerced)):
            raise InputError(
                f'{self._quoted(value)}: expected {self.expected}{_near(value, choices)}'
                f'{self._mixed(value)}'
            )
        if not integers_for_doubles and _has_integer(value, self.kind):
            raise InputError(
                f'{self._quoted(value)}: expected {self.expected}, written with a '
                f'point; write {yaml_text(coerced)}'
            )
        return coerced

    def _mixed(self, value: object) -> str:
        """Return a hint for an array passed as a string, as `ros2` does with mixed types."""
        array = _ARRAY.fullmatch(value) if isinstance(value, str) else None
        if array is None or self.kind != 'doubles':
            return ''
        entries = [typed(entry.strip()) for entry in array[1].split(',')]
        numbers = tuple(n for entry in entries if (n := _number(entry)) is not None)
        if len(numbers) < len(entries):
            return ''
        reason = 'ROS 2 takes an array of several types for a string: write each with a point'
        if self.length not in (None, len(numbers)):
            return f'; it has {len(numbers)}, and {reason}, as in {yaml_text(numbers[0])}'
        return f'; {reason}, {yaml_text(numbers)}'

    def _quoted(self, value: object) -> str:
        text = yaml_text(value)
        if len(text) > _LONGEST_QUOTE:
            text = f'{text[:_LONGEST_QUOTE]}…'
        return f'{self.name} = {text}'

    def _coerced(self, value: object) -> Value | None:
        """Return the value in the type of this parameter, None if that is not possible."""
        if self.kind == 'bool':
            return value if isinstance(value, bool) else None
        if self.kind == 'integer':
            return value if isinstance(value, int) and not isinstance(value, bool) else None
        if self.kind == 'double':
            return _number(value)
        if self.kind == 'string':
            return value if isinstance(value, str) else None
        if value is None:  # an array without entries, which has no type in ROS 2
            value = ()
        if self.broadcast and not _is_array(value):
            value = (value,) * (1 if self.length is None else self.length)
        if not _is_array(value):
            return None
        if self.kind == 'strings':
            return tuple(value) if all(isinstance(entry, str) for entry in value) else None
        numbers = tuple(number for entry in value if (number := _number(entry)) is not None)
        return numbers if len(numbers) == len(value) else None

    def _in_bounds(self, value: Value, choices: tuple[str, ...]) -> bool:
        if isinstance(value, tuple):
            return self.length in (None, len(value)) and all(
                self._in_bounds(entry, choices) for entry in value
            )
        if isinstance(value, str):
            return not choices or value in choices
        if isinstance(value, bool):
            return True
        return self.bounds.contain(value)


def check_all(
    parameters: Sequence[Parameter],
    values: Mapping[str, object],
    where: str | Mapping[str, str] = '',
    *,
    integers_for_doubles: bool = False,
) -> MutableValues:
    """
    Check a whole set of values and fill in the defaults.

    Parameters
    ----------
    parameters : sequence
        the declarations.
    values
        value by parameter name.
    where
        prefix of messages with the place of the values ('controller: '); a mapping has the
        places by name.
    integers_for_doubles
        as in `Parameter.check`.

    Returns
    -------
        A value for every declared parameter, in the order of declaration.

    Raises
    ------
    InputError
        for an unknown name or an invalid value.

    """
    declared = {parameter.name: parameter for parameter in parameters}
    checked: MutableValues = {parameter.name: parameter.default for parameter in parameters}
    for name, value in values.items():
        place = where if isinstance(where, str) else where.get(name, '')
        if name not in declared:
            # Users write the name of the node with a dot, as for `masmc simulate`.
            short = name.partition('.')[2]
            hint = f'did you mean {short}?' if short in declared else suggestion(name, declared)
            raise InputError(f"{place}unknown parameter '{name}'; {hint}")
        try:
            checked[name] = declared[name].check(value, integers_for_doubles=integers_for_doubles)
        except InputError as error:
            raise InputError(f'{place}{error}') from None
    return checked


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value)
    except OverflowError:
        return None


def _is_array(value: object) -> TypeGuard[list[Any] | tuple[Any, ...] | array.array[float]]:
    return isinstance(value, list | tuple | array.array)


def _has_integer(value: object, kind: str) -> bool:
    """Return True if a value for doubles is or contains an integer."""
    if kind not in ('double', 'doubles'):
        return False
    entries = value if _is_array(value) else (value,)
    return any(isinstance(entry, int) for entry in entries)


def _near(value: object, choices: tuple[str, ...]) -> str:
    hint = suggestion(value, choices) if isinstance(value, str) and choices else ''
    return f'; {hint}' if hint.startswith('did you mean') else ''
