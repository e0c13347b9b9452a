# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Text of results: tables with aligned columns, and JSON in one form for all commands."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
import json
import math
from pathlib import Path
import sys
from typing import Any

import numpy as np

WIDTH = 80
"""Width of printed tables in characters."""

_GAP = '  '


def aligned(
    rows: Sequence[Sequence[str]],
    left: Container[int],
    *,
    keys: int = 1,
    rule: int = 0,
    width: int = sys.maxsize,
) -> list[str]:
    """
    Return the lines of a table whose columns are as wide as their longest cells.

    Parameters
    ----------
    rows
        cells, as many in each row.
    left
        indices of the columns that are aligned left; the others are aligned right.
    keys
        number of columns that a further part of the table repeats.
    rule
        number of rows above a rule; 0: no rule.
    width
        maximum width of a part of the table; the remaining columns follow below.

    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    parts = [list(range(keys))]
    for column in range(keys, len(widths)):
        columns = [*parts[-1], column]
        size = sum(widths[i] + len(_GAP) for i in columns) - len(_GAP)
        if size > width and len(parts[-1]) > keys:
            parts.append([*range(keys), column])
        else:
            parts[-1] = columns
    if rule:
        rows = [*rows[:rule], ['-' * size for size in widths], *rows[rule:]]
    lines: list[str] = []
    for part in parts:
        lines += [''] * bool(lines)
        for row in rows:
            cells = (
                row[i].ljust(widths[i]) if i in left else row[i].rjust(widths[i]) for i in part
            )
            lines.append(_GAP.join(cells).rstrip())
    return lines


_NOT_FINITE = {math.inf: 'Infinity', -math.inf: '-Infinity'}


def json_text(value: object) -> str:
    """
    Return a value as JSON with all digits.

    Numbers that JSON lacks are the texts `NaN`, `Infinity` and `-Infinity`, which `float` of
    Python and `Number` of JavaScript read. `null` stands for a value that does not exist.
    """
    return json.dumps(_plain(value), indent=1, allow_nan=False)


def with_sizes(paths: Iterable[Path], *, as_json: bool) -> str:
    """Return written files and their sizes in bytes: a line each, or JSON."""
    sizes = {path: path.stat().st_size for path in paths}
    if as_json:
        return json_text({'files': [{'file': p, 'bytes': n} for p, n in sizes.items()]})
    return '\n'.join(f'{path}: {size} bytes' for path, size in sizes.items())


def _plain(value: Any) -> Any:
    """Return a value that consists of dictionaries, lists, texts, numbers and None."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return _NOT_FINITE.get(value, 'NaN')
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, Iterable):
        return [_plain(entry) for entry in value]
    raise TypeError(f'{type(value).__name__} has no representation in JSON')
