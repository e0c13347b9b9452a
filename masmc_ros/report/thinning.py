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
    # The last stretch is filled up with what is never the best of it.
    padding = np.full((count * size - n, values.shape[1]), -np.inf)

    def best(score: NDArray[np.float64]) -> NDArray[np.intp]:
        stretches = np.concatenate((score, padding)).reshape(count, size, -1)
        return (stretches.argmax(axis=1) + size * np.arange(count)[:, None]).ravel()

    is_gap = np.isnan(values)
    gaps = best(is_gap.astype(np.float64))
    chosen = (
        [0, n - 1],
        best(np.where(is_gap, -np.inf, values)),
        best(np.where(is_gap, -np.inf, -values)),
        gaps[np.any(is_gap[gaps], axis=1)],
    )
    return np.unique(np.concatenate(chosen))
