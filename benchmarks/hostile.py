# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Random requests and messages for running nodes: valid ones, invalid ones, and malformed bytes.

Services, topics, types and parameters are discovered from the graph, so new ones are covered
without a change here. All choices come from one seeded generator.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import importlib
import json
import random
import re
import struct
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rclpy.serialization import deserialize_message, serialize_message

_TYPE = re.compile(
    r'(?:sequence<(?P<sequence>.+?)(?:, (?P<most>\d+))?>|(?P<base>[\w/<>]+)\[(?P<count>\d+)\])'
)
_STRING = re.compile(r'w?string(?:<(\d+)>)?')
_CHOICES = re.compile(r'(?:one of )?([\w.]+(?:, [\w.]+)+)')

FLOATS = (
    *(0.0, -0.0, 1.0, -1.0, 1e-3, 0.25, 1e9, -1e9, 1e-300, 5e-324),
    *(1e308, -1e308, float('nan'), float('inf'), float('-inf')),
)
TEXTS = ('', 'a', ' ', '/', '..', '[]', '{"a": 1}', '%s%n', 'é∂ß', '\n', '[1, 2.0]', 'nan', '~')

_DEEP = 20_000
"""Number of opening brackets in a text, above the limit of a recursive parser."""

_INTEGERS = {
    f'{sign}int{bits}': (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    for sign in ('', 'u')
    for bits in (8, 16, 32, 64)
} | {'octet': (0, 255), 'char': (0, 255)}

_LARGEST_ARRAY = 20_000
_MOST_TEXTS = 500
_LONGEST_TEXT = 200_000

_FIELDS = {
    ParameterType.PARAMETER_BOOL: 'bool_value',
    ParameterType.PARAMETER_INTEGER: 'integer_value',
    ParameterType.PARAMETER_DOUBLE: 'double_value',
    ParameterType.PARAMETER_STRING: 'string_value',
    ParameterType.PARAMETER_DOUBLE_ARRAY: 'double_array_value',
}
"""Fields of a ParameterValue by the types of this package's parameters."""


def interface_class(type_name: str) -> Any:
    """Return the class of a type such as `std_srvs/srv/Trigger`; None if it is not installed."""
    package, kind, name = type_name.split('/')
    try:
        return getattr(importlib.import_module(f'{package}.{kind}'), name)
    except (ImportError, AttributeError):
        return None


class RandomInput:
    """Generator of random values of ROS types."""

    def __init__(self, seed: int, *, is_tame: bool = False) -> None:
        """
        Initialise the generator with a seed.

        Parameters
        ----------
        seed
            seed of all choices.
        is_tame
            True to exclude valid extreme parameter values, with which a robot may move at its
        maximum speed. Messages are smaller, as the middleware keeps buffers of the size of the
        largest message.

        """
        self.random = random.Random(seed)
        self._is_tame = is_tame
        self._largest_array = 40 if is_tame else _LARGEST_ARRAY
        self._longest_text = 300 if is_tame else _LONGEST_TEXT

    # Values.

    def number(self) -> float:
        """Return a floating-point number, often an extreme one."""
        if self.random.random() < 0.5:
            return self.random.choice(FLOATS)
        return self.random.uniform(-100.0, 100.0)

    def integer(self, low: int, high: int) -> int:
        """Return an integer of a range, often one of its ends."""
        middle = self.random.randint(max(low, -300), min(high, 300))
        anything = self.random.randint(low, high)
        return self.random.choice((low, high, middle, min(high, 1), anything))

    def text(self, longest: int = _LONGEST_TEXT) -> str:
        """Return a string, rarely a very long one."""
        if self.random.random() < 0.05:
            unit = self.random.choice(('x', '[', '{"a":'))
            return (unit * self.random.randint(1, _DEEP))[: min(longest, self._longest_text)]
        return self.random.choice(TEXTS)[:longest]

    def json_text(self, text: str) -> str:
        """Return a JSON object with one changed entry, at any depth."""
        try:
            content = part = json.loads(text)
            while isinstance(part, dict) and part:
                name = self.random.choice(list(part))
                if isinstance(part[name], dict) and self.random.random() < 0.8:
                    part = part[name]
                    continue
                if self.random.random() < 0.2:
                    del part[name]
                else:
                    part[name] = self.json_value()
                break
            return json.dumps(content)
        except ValueError:
            return self.text()

    def json_value(self, depth: int = 0) -> Any:
        """Return a random value that JSON can express, including numbers beyond 64 bits."""
        kind = self.random.randrange(8 if depth < 3 else 6)
        if kind == 6:
            return [self.json_value(depth + 1) for _ in range(self.length(8))]
        if kind == 7:
            return {self.text(20): self.json_value(depth + 1) for _ in range(self.length(4))}
        values = (None, True, self.integer(-(2**70), 2**70), self.number(), self.text(), '')
        return values[kind]

    def length(self, most: int | None = None) -> int:
        """Return the length of an array, rarely a very large one."""
        usual = self.random.choice((0, 1, 2, 3, 4, 5, 7, 12))
        large = self.random.randint(0, self._largest_array)
        length = large if self.random.random() < 0.05 else usual
        return length if most is None else min(length, most)

    def fill(self, message: Any, depth: int = 0) -> Any:
        """Set every field of a message or request to a random value and return it."""
        for name, kind in message.get_fields_and_field_types().items():
            setattr(message, name, self.field(kind, depth))
        return message

    def field(self, kind: str, depth: int = 0) -> Any:
        """Return a random value of a field's type, as `get_fields_and_field_types` names it."""
        match = _TYPE.fullmatch(kind)
        if match is not None:
            fixed = match['count']
            element = match['base'] or match['sequence']
            most = int(match['most']) if match['most'] else None
            count = int(fixed) if fixed else self.length(most)
            if '/' in element:
                count = min(count, 3 if depth else 40)
            elif 'string' in element and not fixed:
                count = min(count, _MOST_TEXTS)
            values = [self.field(element, depth + 1) for _ in range(count)]
            if fixed and element in ('double', 'float'):
                return np.array(values, np.float64 if element == 'double' else np.float32)
            return values
        if (bounded := _STRING.fullmatch(kind)) is not None:
            return self.text(int(bounded[1]) if bounded[1] else _LONGEST_TEXT)
        if kind == 'boolean':
            return self.random.random() < 0.5
        if kind == 'double':
            return self.number()
        if kind == 'float':
            value = self.number()
            return value if abs(value) < 3e38 or value != value else 3e38
        if kind == 'octet':
            return bytes((self.random.randrange(256),))
        if kind in _INTEGERS:
            return self.integer(*_INTEGERS[kind])
        package, _, name = kind.rpartition('/')
        return self.fill(interface_class(f'{package}/msg/{name}')(), depth + 1)

    # Parameters.

    def parameter_value(self) -> ParameterValue:
        """Return a value of a random type, which may not exist."""
        value: ParameterValue = self.fill(ParameterValue())
        if self.random.random() < 0.8:
            value.type = self.random.randint(0, 10)
        return value

    def valid_value(
        self, present: ParameterValue, choices: Sequence[str], scale: float
    ) -> ParameterValue | None:
        """
        Return a valid value of a parameter; None if only its present value is known to be valid.

        Parameters
        ----------
        present
            a value that the node has accepted, such as the initial one.
        choices
            the strings that the parameter accepts; empty if unknown.
        scale
            largest divisor of a number. No number exceeds the present one: with a gain too
            large for the control period a robot may move at its maximum speed.

        """
        value = ParameterValue(type=present.type)
        factor = scale ** self.random.uniform(-1.0, 0.0)
        if present.type == ParameterType.PARAMETER_BOOL:
            value.bool_value = self.random.random() < 0.5
        elif present.type == ParameterType.PARAMETER_DOUBLE:
            value.double_value = present.double_value * factor
        elif present.type == ParameterType.PARAMETER_DOUBLE_ARRAY:
            value.double_array_value = [factor * entry for entry in present.double_array_value]
        elif present.type == ParameterType.PARAMETER_STRING and choices:
            value.string_value = self.random.choice(choices)
        else:
            return None
        return value

    def wrong_value(self, present: ParameterValue) -> ParameterValue:
        """Return an extreme, often invalid value of a parameter's type."""
        value = ParameterValue(type=present.type)
        name = _FIELDS.get(present.type)
        if name is None:
            return self.parameter_value()
        kind = ParameterValue.get_fields_and_field_types()[name]
        setattr(value, name, self.field(kind))
        return value

    def invalid_value(self, present: ParameterValue) -> ParameterValue:
        """Return a value that no parameter accepts instead of the present one."""
        wrong = self.random.choice((float('nan'), float('inf'), float('-inf')))
        value = ParameterValue(type=present.type)
        kind = self.random.randrange(3)
        if kind == 0:
            value.type = self.random.randint(10, 255)
        elif present.type == ParameterType.PARAMETER_DOUBLE and kind == 1:
            value.double_value = wrong
        elif present.type == ParameterType.PARAMETER_DOUBLE_ARRAY and kind == 1:
            value.double_array_value = [wrong] * len(present.double_array_value)
        else:
            value.type = ParameterType.PARAMETER_BYTE_ARRAY
            value.byte_array_value = [bytes((self.random.randrange(256),))]
        return value

    # Requests.

    def request(self, service: Any, known: Mapping[str, ParameterValue]) -> Any:
        """
        Return a request to a service; most requests about parameters have known names.

        `known` contains the parameters of the node and accepted values.
        """
        request = service.Request()
        fields = request.get_fields_and_field_types()
        if fields.get('parameters') == 'sequence<rcl_interfaces/Parameter>':
            count = self.random.choice((0, 1, 1, 1, 2, 5, 40))
            request.parameters = [self.parameter(known) for _ in range(count)]
            return request
        self.fill(request)
        if service is ChangeState and self._is_tame:
            # A controller that is shut down does not follow its path again.
            request.transition.id %= Transition.TRANSITION_UNCONFIGURED_SHUTDOWN
        if 'names' in fields and self.random.random() < 0.7:
            request.names = [self.name(known) for _ in range(self.length(40))]
        return request

    def name(self, known: Mapping[str, ParameterValue]) -> str:
        """Return the name of a parameter, occasionally of a missing one."""
        if known and self.random.random() < 0.85:
            return self.random.choice(list(known))
        return self.text(1000)

    def parameter(self, known: Mapping[str, ParameterValue]) -> Parameter:
        """Return a parameter with a valid or invalid value or one of an unknown type."""
        name = self.name(known)
        kind = self.random.random()
        if name in known and kind < 0.3:
            return Parameter(name=name, value=known[name])
        if name in known and self._is_tame:
            return Parameter(name=name, value=self.invalid_value(known[name]))
        if name in known and kind < 0.7:
            return Parameter(name=name, value=self.wrong_value(known[name]))
        return Parameter(name=name, value=self.parameter_value())

    # Messages.

    def message(self, kind: Any, template: bytes | None) -> bytes:
        """
        Return the bytes of a message: random fields, a changed template, or invalid bytes.

        `template` is a message that a node has sent on the topic; None if none has been received.
        """
        makers: list[Callable[[], bytes]] = [
            lambda: serialize_message(self.fill(kind())),
            lambda: self.garbage(),
        ]
        if template is not None:
            makers += [
                lambda: self._changed(kind, template),
                lambda: self._changed(kind, template),
                lambda: self._damaged(template),
            ]
            if not self._is_tame:
                # Its sender would be ambiguous: a node or this client.
                makers.append(lambda: template)
        return self.random.choice(makers)()

    def disarmed(self, kind: Any, raw: bytes) -> bytes:
        """
        Return a tame message of a topic that robots follow: its numbers are NaN.

        A sender of valid torques or states can move the robot arbitrarily. No controller can keep
        it within bounds then.
        """
        if not self._is_tame:
            return raw
        try:
            message = deserialize_message(raw, kind)
        except Exception:
            return raw
        for name in ('data', 'position', 'velocity'):
            if hasattr(message, name):
                setattr(message, name, [float('nan')] * max(1, len(getattr(message, name))))
        return serialize_message(message)

    def garbage(self) -> bytes:
        """Return bytes that are no message, often after a valid encapsulation header."""
        head = self.random.choice((b'', b'\0\1\0\0', b'\0\0\0\0', b'\0\1\0'))
        sizes = (0, 1, 3, 4, 8, 100, 300 if self._is_tame else 70_000)
        body = self.random.randbytes(self.random.choice(sizes))
        if self.random.random() < 0.3:
            body = b'\xff\xff\xff\x7f' + body
        return head + body

    def _changed(self, kind: Any, template: bytes) -> bytes:
        """Return a message with one changed field, at any depth."""
        message = deserialize_message(template, kind)
        part = message
        while True:
            fields = part.get_fields_and_field_types()
            if not fields:
                break
            name = self.random.choice(list(fields))
            inner = getattr(part, name)
            if hasattr(inner, 'get_fields_and_field_types') and self.random.random() < 0.9:
                part = inner
                continue
            is_array = not isinstance(inner, str) and hasattr(inner, '__len__') and len(inner)
            if is_array and '/' not in fields[name] and self.random.random() < 0.6:
                match = _TYPE.fullmatch(fields[name])
                element = (match['base'] or match['sequence']) if match else 'double'
                place = self.random.randrange(len(inner))
                inner[place] = self.field(element)
            elif isinstance(inner, str) and inner.startswith('{'):
                setattr(part, name, self.json_text(inner))
            else:
                setattr(part, name, self.field(fields[name]))
            break
        return serialize_message(message)

    def _damaged(self, template: bytes) -> bytes:
        """Return the bytes of a message with some of them missing, added or changed."""
        data = bytearray(template)
        kind = self.random.randrange(4)
        if kind == 0:
            return bytes(data[: self.random.randrange(len(data) + 1)])
        if kind == 1:
            return bytes(data) + self.random.randbytes(self.random.randint(1, 64))
        for _ in range(self.random.choice((1, 1, 4, 30))):
            data[self.random.randrange(len(data))] = self.random.randrange(256)
        if kind == 3 and len(data) >= 8:
            place = 4 * self.random.randrange(len(data) // 4)
            struct.pack_into('<I', data, min(place, len(data) - 4), 2**31 - 1)
        return bytes(data)


def choices_of(constraints: str) -> tuple[str, ...]:
    """Return the strings in the constraints of a descriptor, such as 'one of smc, rasmc'."""
    match = _CHOICES.fullmatch(constraints)
    return () if match is None else tuple(match[1].split(', '))
