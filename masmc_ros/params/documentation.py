# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters as tables for the documentation, and as a list for the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import textwrap

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
