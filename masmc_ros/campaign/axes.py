# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Axes of variation: a parameter with a list or a range of values."""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.params.text import Scalar, typed

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
