# SPDX-License-Identifier: Apache-2.0
"""The events of a YAML file or value turned into parameters by the rules of rcl.

rcl does not build a YAML document: it walks over the parser's events with a few flags. So
it accepts some files that look wrong and refuses some that look right, and a file must mean
the same to the offline commands as to the nodes. This is the same walk, state for state.
Only what rcl does beyond the end of its own arrays (parameter lists in the place of a whole
`ros__parameters` block of more than 128 parameters) is not defined there and harmless here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NoReturn

import yaml

from masmc_ros.errors import InputError
from masmc_ros.params.scalar import Scalar, typed

FileValue = Scalar | list[bool] | list[int] | list[float] | list[str] | None

PARAMETERS_KEY = 'ros__parameters'
# libyaml, which rcl uses too, where PyYAML was built with it.
_LOADER: Any = getattr(yaml, 'CBaseLoader', yaml.BaseLoader)
_TYPES: tuple[type, ...] = (bool, int, float, str)
_TYPE_NAMES = {bool: 'a bool', int: 'an integer', float: 'a double', str: 'a string'}


class Variant:
    """What was written to one parameter: at most one value of every type.

    Values of different types do not replace one another; the first type in the order bool,
    int, float, str, then their arrays, is the one that counts.
    """

    def __init__(self) -> None:
        """Make a parameter without a value."""
        self.scalars: dict[type, Scalar] = {}
        self.arrays: dict[type, list[Any]] = {}

    @property
    def value(self) -> FileValue:
        """The value that counts, None if there is none (an empty array, an empty map)."""
        for values in (self.scalars, self.arrays):
            for type_ in _TYPES:
                if type_ in values:
                    return values[type_]
        return None


@dataclass
class Entry:
    """A parameter in a block: dotted name, line in the file (from 1) and what was written."""

    name: str
    line: int


@dataclass
class NodeEntries:
    """The parameters of one node key, in the order in which rcl numbers them.

    `variants` may have numbers beyond `entries`: a value that stands where rcl does not
    expect one goes to whichever parameter had the turn last, even another node's.
    """

    pattern: str
    line: int
    entries: list[Entry] = field(default_factory=list)
    variants: dict[int, Variant] = field(default_factory=dict)

    def find(self, name: str, line: int) -> int:
        """Return the number of the first parameter of that name, added if there is none."""
        for number, entry in enumerate(self.entries):
            if entry.name == name:
                return number
        self.entries.append(Entry(name, line))
        return len(self.entries) - 1


class ValueReader:
    """Types values and fills arrays, for files and for single values alike."""

    def __init__(self, source: str) -> None:
        """Start; `source` names the file in messages."""
        self.source = source
        self.in_array = False
        self.array_type: type | None = None

    def refuse(self, line: int, message: str) -> NoReturn:
        """Raise the error of one line in the file (from 1)."""
        raise InputError(f'{self.source}:{line}: {message}')

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


def c_string(text: str) -> str:
    """Cut a string where C does: at its first NUL."""
    return text.partition('\0')[0]


def line_of(event: yaml.Event) -> int:
    """Line on which an event starts, counted from 1."""
    return event.start_mark.line + 1 if event.start_mark else 1


def yaml_events(data: bytes, source: str) -> Iterator[yaml.Event]:
    """Parse YAML (UTF-8, or UTF-16 with a byte order mark) into events.

    Raises:
        InputError: not YAML, or not text.
    """
    try:
        yield from yaml.parse(data, Loader=_LOADER)
    except yaml.reader.ReaderError as error:
        line = data[: error.position].count(b'\n') + 1
        raise InputError(
            f'{source}:{line}: not text in UTF-8 ({error.reason}); save the file as UTF-8'
        ) from None
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        problem = ', '.join(filter(None, (error.context, error.problem)))
        raise InputError(
            f'{source}:{line}: not YAML: {problem}; check indentation, colons, brackets and quotes'
        ) from None


def read_value(data: bytes, source: str) -> FileValue:
    """Type one value, as `-p NAME:=VALUE` does.

    Raises:
        InputError: not YAML, or neither a scalar nor an array of one type.
    """
    reader = ValueReader(source)
    variant = Variant()
    for event in yaml_events(data, source):
        if isinstance(event, yaml.ScalarEvent):
            reader.put(event, variant, 'the parameter')
        elif isinstance(event, yaml.SequenceStartEvent):
            reader.start_array()
        elif isinstance(event, yaml.SequenceEndEvent):
            reader.in_array = False
        elif isinstance(event, yaml.MappingStartEvent | yaml.AliasEvent):
            reader.refuse(line_of(event), 'a map or an alias; write one value or an array')
    return variant.value
