# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Text tables with aligned columns."""

from __future__ import annotations

from collections.abc import Container, Sequence


def aligned(rows: Sequence[Sequence[str]], left: Container[int]) -> list[str]:
    """
    Return the lines of a table whose columns are as wide as their longest cells.

    Parameters
    ----------
    rows
        cells, as many in each row.
    left
        indices of the columns that are aligned left; the others are aligned right.

    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        '  '.join(
            cell.ljust(width) if column in left else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
