# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Docstrings of the Python API as plain text with numpydoc sections.

Docstrings of this package are written for readers of the source: formulas are indented blocks, and
`*`, `|s|` and `theta_` are mathematics. The hook escapes what reStructuredText would interpret and
turns indented blocks and tables into literal blocks. Sections of numpydoc are left to napoleon.
"""

from __future__ import annotations

from itertools import pairwise
import re
from typing import Any

_SECTIONS = ('Parameters', 'Returns', 'Raises', 'Attributes', 'Yields', 'Notes', 'Examples')
_CODE = re.compile(r'(``?[^`]+``?)')
_MARKUP = re.compile(r'([*|\\]|_(?!\w))')


def _escape(line: str) -> str:
    """Escape markup outside of backquotes, and set single backquotes as code."""
    parts = _CODE.split(line)
    for index, part in enumerate(parts):
        if index % 2:
            parts[index] = f'``{part.strip("`")}``'
        else:
            parts[index] = _MARKUP.sub(r'\\\1', part).replace('`', '\\`')
    return ''.join(parts)


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _section_start(lines: list[str]) -> int:
    """Return the index of the first numpydoc section, or the number of lines."""
    for index, (line, underline) in enumerate(pairwise(lines)):
        if line in _SECTIONS and underline and set(underline) == {'-'}:
            return index
    return len(lines)


def plain_text(lines: list[str]) -> list[str]:
    """
    Return the text of a docstring as reStructuredText without inline markup.

    Parameters
    ----------
    lines
        Lines of the docstring before its first section.

    """
    made: list[str] = []
    literal = table = False
    for line in lines:
        if not line.strip():
            made.append('')
            table = False
            continue
        table = table or line.startswith('===')
        if table:
            line = f'    {line}'
        if _indent(line):
            if not literal:
                made += ['', '::', '']
            literal = True
            made.append(line)
            continue
        if literal:
            made.append('')
        literal = False
        made.append(_escape(line))
    return made


def _process(
    app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Replace the lines of a docstring; the signature is that of the event."""
    start = _section_start(lines)
    text, sections = lines[:start], lines[start:]
    lines[:] = [*plain_text(text), '', *(_escape(line) for line in sections)]


def setup(app: Any) -> dict[str, bool]:
    """Register the hook before that of napoleon."""
    app.connect('autodoc-process-docstring', _process, priority=100)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}
