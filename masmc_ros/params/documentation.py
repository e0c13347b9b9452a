# SPDX-License-Identifier: Apache-2.0
"""Tables of parameters for the documentation."""

from __future__ import annotations

from collections.abc import Iterable

from masmc_ros.params.declaration import Parameter
from masmc_ros.params.text import yaml_text

_HEADER = ('parameter', 'meaning', 'unit', 'default', 'range', 'change')


def markdown_table(parameters: Iterable[Parameter]) -> str:
    """Write declarations as a Markdown table, in their order, ending with a line break."""
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


def _default(parameter: Parameter) -> str:
    """Write the default the short way: one number where all entries are equal."""
    default = parameter.default
    if parameter.broadcast and len(set(default)) == 1:
        default = default[0]
    return yaml_text(default)


def _escaped(text: str) -> str:
    """Keep a text within its cell."""
    return ' '.join(text.replace('|', r'\|').splitlines())
