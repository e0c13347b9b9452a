# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Every sample of a line, packed to stand in the page, which draws what can be seen of it."""

from __future__ import annotations

import base64
from typing import Any
import zlib

from masmc_ros.numerics.aliases import Array
import numpy as np
from numpy.typing import NDArray

MOST = 200_000
"""Samples of a line that the page holds; of longer lines it holds stretches."""

_LARGEST = float(np.finfo(np.float32).max)
_NANOSECONDS = 1.0e9


def packed_signal(times: Array, values: Array, most: int = MOST) -> dict[str, Any]:
    """
    Return a signal: all its samples, or the least and the greatest value of every stretch.

    Parameters
    ----------
    times
        (n) in s, kept to the nanosecond.
    values
        (n), kept as float32.
    most
        so many samples or stretches at most.

    """
    size = _size(len(times), most)
    starts = np.arange(0, len(times), size)
    ends = [] if size == 1 else [times[-1]]
    signal = {'x': _packed_times(np.concatenate((times[starts], ends)))}
    if size == 1:
        return {**signal, 'y': _packed(values)}
    return {
        **signal,
        'low': _packed(np.fmin.reduceat(values, starts)),
        'high': _packed(np.fmax.reduceat(values, starts)),
    }


def packed_path(points: Array, most: int = MOST) -> dict[str, Any]:
    """
    Return points (n, 2) of a path; where there are more than `most`, the first of each so many.

    A robot moves on between two of them by less than can be seen.
    """
    size = _size(len(points), most)
    kept = points[np.unique(np.append(np.arange(0, len(points), size), len(points) - 1))]
    return {'x': _packed(kept[:, 0]), 'y': _packed(kept[:, 1])}


def _size(count: int, most: int) -> int:
    """Return how many samples a stretch has, so that there are at most so many."""
    return max(1, -(-count // most))


def _packed(values: Array) -> str:
    """Pack float32: of numbers that follow each other the bits differ little."""
    is_finite = np.isfinite(values)
    kept = np.where(is_finite, np.clip(values, -_LARGEST, _LARGEST), values)
    bits = kept.astype('<f4').view('<i4')
    return _deflated(np.diff(bits, prepend=np.int32(0)).astype('<i4'))


def _packed_times(times: Array) -> str:
    """Pack times as whole nanoseconds: their differences are all alike."""
    return _deflated(np.diff(np.round(times * _NANOSECONDS), prepend=0.0).astype('<f8'))


def _deflated(numbers: NDArray[Any]) -> str:
    """Compress numbers, the first bytes of all, then the second ones and so on."""
    planes = numbers.view(np.uint8).reshape(len(numbers), -1).T
    return base64.b64encode(zlib.compress(planes.tobytes())).decode()
