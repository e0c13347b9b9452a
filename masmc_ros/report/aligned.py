# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Text tables with aligned columns."""

from __future__ import annotations

from collections.abc import Container, Sequence
import sys

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
