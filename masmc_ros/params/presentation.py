# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Presentation of parameters: tables for the documentation, lists for the terminal, and sliders.

A gain may be an array with an entry for each axis or parameter. Its slider has one number, the
largest entry. A move of the slider scales the whole array.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import textwrap
from typing import NamedTuple

from masmc_ros.params.declaration import Parameter
from masmc_ros.params.text import yaml_text

_HEADER = ('parameter', 'meaning', 'unit', 'default', 'range', 'change')


def markdown_table(parameters: Iterable[Parameter]) -> str:
    """Return declarations as a Markdown table, in their order, with a final line break."""
    rows = [_HEADER, ('---',) * len(_HEADER), *(_row(parameter) for parameter in parameters)]
    return ''.join(f'| {" | ".join(row)} |\n' for row in rows)


def _row(parameter: Parameter) -> tuple[str, ...]:
    return (
        f'`{parameter.name}`',
        _escaped(parameter.description),
        _escaped(parameter.unit),
        f'`{_escaped(_default(parameter))}`',
        _escaped(parameter.expected),
        'read-only' if parameter.read_only else 'live',
    )


def plain_list(parameters: Iterable[Parameter], width: int) -> Iterator[str]:
    """Yield the lines of a list for a terminal, with all properties of the parameters."""
    for parameter in parameters:
        unit = f' {parameter.unit}' if parameter.unit else ''
        default = f'default {_default(parameter)}{unit}'
        facts = [default, parameter.expected, *([] if parameter.read_only else ['live'])]
        yield f'  {parameter.name}'
        for text in (parameter.description, '; '.join(facts)):
            yield from textwrap.wrap(
                text, width, initial_indent=' ' * 6, subsequent_indent=' ' * 8,
                break_on_hyphens=False,
            )


def _default(parameter: Parameter) -> str:
    """Return the default as text, one number if all entries are equal."""
    default = parameter.default
    if parameter.broadcast and len(set(default)) == 1:
        default = default[0]
    return yaml_text(default)


def _escaped(text: str) -> str:
    """Return text that stays within its cell."""
    return ' '.join(text.replace('|', r'\|').splitlines())


SLIDERS = ('k_s1', 'k_s2', 'sigma', 'gamma', 'boundary_layer')
"""Parameters of the controller with a slider."""

_STEPS = 400
"""Number of steps of a slider."""

FACTOR = 4.0
"""End of a slider as a multiple of the value at which it is set up."""


class SliderRange(NamedTuple):
    """Smallest and largest value of a slider, and its step."""

    lowest: float
    highest: float
    step: float

    def contains(self, level: float) -> bool:
        """Return True if the slider can show a value."""
        return self.lowest <= level <= self.highest


def level_of(value: object) -> float:
    """Return the number of a slider for a value: a number, or the largest entry of an array."""
    return float(max(value)) if isinstance(value, list | tuple) else float(str(value))


def slider_range(parameter: Parameter, level: float) -> SliderRange:
    """
    Return the range of a slider: from the parameter's minimum to four times a value.

    Parameters
    ----------
    parameter
        Declaration, with bounds and default.
    level
        Current value of the slider; the default replaces 0.

    """
    return range_up_to(parameter, FACTOR * (level or level_of(parameter.default) or 1.0))


def range_up_to(parameter: Parameter, highest: float) -> SliderRange:
    """Return the range of a slider from the parameter's minimum to a value, within its bounds."""
    if parameter.maximum is not None:
        highest = min(highest, parameter.maximum)
    lowest = 0.0 if parameter.minimum is None else parameter.minimum
    step = _rounded((highest - lowest) / _STEPS)
    return SliderRange(lowest + step if parameter.exclusive_minimum else lowest, highest, step)


def scaled(value: object, level: float) -> float | list[float]:
    """
    Return a parameter's value with another level.

    An array keeps the ratios of its entries. If they are equal, one number replaces them.
    """
    if not isinstance(value, list | tuple) or len(set(value)) == 1:
        return _rounded(level)
    largest = level_of(value)
    return [_rounded(level * float(entry) / largest) for entry in value]


def gain_text(value: object) -> str:
    """Return a parameter's value as text, one number if all entries are equal."""
    if isinstance(value, list | tuple) and len(set(value)) == 1:
        return yaml_text(value[0])
    return yaml_text(value)


def _rounded(number: float) -> float:
    """Return a number with six digits: sums of steps have errors of rounding."""
    return float(f'{number:.6g}')
