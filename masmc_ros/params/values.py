# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Scalars and arrays written to a parameter by the rules of rcl, and single values."""

from __future__ import annotations

from typing import Any, NoReturn

from masmc_ros.errors import InputError
from masmc_ros.params.scalar import Scalar, typed
from masmc_ros.params.yaml_events import c_string, line_of, Place, yaml_events
import yaml

FileValue = Scalar | list[bool] | list[int] | list[float] | list[str] | None

_TYPES: tuple[type, ...] = (bool, int, float, str)
_TYPE_NAMES = {bool: 'a bool', int: 'an integer', float: 'a double', str: 'a string'}


class Variant:
    """
    The storage of one parameter: at most one value of every type, as in rcl.

    A value inside an array may leave values of several types; the first type in the order
    bool, int, float, str, then their arrays, applies. A whole value replaces all others.
    """

    def __init__(self) -> None:
        """Make a parameter without a value."""
        self.scalars: dict[type, Scalar] = {}
        self.arrays: dict[type, list[Any]] = {}

    def clear(self) -> None:
        """Remove all values, as a later one replaces them whatever its type."""
        self.scalars.clear()
        self.arrays.clear()

    @property
    def value(self) -> FileValue:
        """Return the value that counts, None if there is none (an empty array, an empty map)."""
        for values in (self.scalars, self.arrays):
            for type_ in _TYPES:
                if type_ in values:
                    return values[type_]
        return None


class ValueReader:
    """Types values and fills arrays, for files and for single values alike."""

    def __init__(self, place: Place) -> None:
        """Start; `place` tells in messages where a line is."""
        self.place = place
        self.in_array = False
        self.array_type: type | None = None

    def refuse(self, line: int, message: str) -> NoReturn:
        """Raise the error that is at a line of the file (from 1)."""
        raise InputError(f'{self.place(line)}: {message}')

    def start_array(self) -> None:
        """Begin an array; inside another one, the type is free again."""
        self.in_array = True
        self.array_type = None

    def put(self, event: yaml.ScalarEvent, variant: Variant, name: str) -> None:
        """Write a scalar event to a parameter, or add it to the parameter's array."""
        quoted = event.style in ("'", '"')
        text = c_string(event.value)
        line = line_of(event)
        if not event.value and not quoted:
            self.refuse(line, f"no value for {name}; write one ('' for an empty string)")
        value = typed(text, quoted=quoted, tag=event.tag)
        type_ = type(value)
        if not self.in_array:
            variant.scalars[type_] = value
        elif self.array_type is None:
            self.array_type = type_
            variant.arrays[type_] = [value]
        elif self.array_type is not type_:
            self.refuse(
                line,
                f'{name} has {_TYPE_NAMES[type_]} ({text}) in an array that began '
                f'with {_TYPE_NAMES[self.array_type]}; write all its entries as one '
                'type (doubles with a point: 1.0)',
            )
        elif type_ not in variant.arrays:
            self.refuse(line, f'{name} is a map inside an array; write a plain array')
        else:
            variant.arrays[type_].append(value)


def read_value(data: bytes, source: str) -> FileValue:
    """
    Type one value, as `-p NAME:=VALUE` does; `source` names it in messages.

    Raises
    ------
    InputError
        not YAML, or neither a scalar nor an array of one type.

    """

    def place(_: int) -> str:
        return source

    reader = ValueReader(place)
    variant = Variant()
    for event in yaml_events(data, place):
        if isinstance(event, yaml.ScalarEvent):
            reader.put(event, variant, 'it')
        elif isinstance(event, yaml.SequenceStartEvent):
            reader.start_array()
        elif isinstance(event, yaml.SequenceEndEvent):
            reader.in_array = False
        elif isinstance(event, yaml.MappingStartEvent | yaml.AliasEvent):
            reader.refuse(line_of(event), 'a map or an alias; write one value or an array')
    return variant.value
