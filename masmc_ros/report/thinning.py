# SPDX-License-Identifier: Apache-2.0
"""Fewer samples that draw the same line: the least and the greatest of every stretch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BUCKETS = 1000
"""Stretches that a line is cut into: about the pixels that it is drawn on."""


def envelope(values: NDArray[np.float64], buckets: int = BUCKETS) -> NDArray[np.intp]:
    """Return which samples to draw, in order, so that no spike is lost.

    Of every stretch of ceil(n / buckets) samples these are the least and the greatest value of
    each column, and the first that is not a number, which is a gap in the line; and the first
    and the last sample of all.

    Args:
        values: (n, m).
        buckets: at most so many stretches. Up to two samples a stretch all are drawn.
    """
    n = len(values)
    size = -(-n // buckets)
    if size <= 2:
        return np.arange(n)
    count = -(-n // size)
    padding = np.zeros((count * size - n, values.shape[1]))
    is_gap = np.isnan(values)
    chosen = [np.array([0, n - 1])]
    for score in (
        np.where(is_gap, -np.inf, values),
        np.where(is_gap, -np.inf, -values),
        is_gap.astype(np.float64),
    ):
        # Samples of nothing come last: the first of equals is taken, which is a real one.
        stretches = np.concatenate((score, padding - np.inf)).reshape(count, size, -1)
        best = stretches.argmax(axis=1) + size * np.arange(count)[:, None]
        chosen.append(best.ravel())
    # Where there is no gap, the third picks the first sample of the stretch, which does no harm.
    return np.unique(np.concatenate(chosen))
