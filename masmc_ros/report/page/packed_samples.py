# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Packed samples of lines; the page draws the visible ones."""

from __future__ import annotations

import base64
import zlib

from masmc_ros.aliases import AnyArray, Array
from masmc_ros.robot.robot import Robot
import numpy as np

MOST = 200_000
"""Maximum number of ranges of a line, each with two values; shorter lines have every sample."""

COMPLETE = 2
"""Maximum number of runs of a page with all samples."""

_RANGES = 13_000
"""Number of ranges of one line of all runs together; a page of 20 runs has 5 MB."""

_FEWEST = 50
"""Minimum number of ranges of a line; a page of 1000 runs has 20 MB."""

REPLAYED = 500
"""Minimum number of ranges of lines with which runs have a replay: pages of up to 26 runs."""

_INSTANTS = 200
"""Maximum number of instants of a replay; the page interpolates between them."""

_LARGEST = float(np.finfo(np.float32).max)
_NANOSECONDS = 1.0e9


def ranges_per_line(runs: int) -> int:
    """
    Return the maximum number of ranges of samples of a line, of a page with some runs.

    Pages of one or two runs contain all samples of common logs.
    """
    return MOST if runs <= COMPLETE else max(_FEWEST, _RANGES // runs)


def packed_signal(times: Array, values: Array, most: int = MOST) -> dict[str, str]:
    """
    Return all samples of a signal, or the minimum and maximum of ranges of samples.

    Parameters
    ----------
    times
        (n) in s, kept to the nanosecond.
    values
        (n), kept as float32.
    most
        maximum number of ranges; twice as many samples are kept.

    """
    size = 1 if len(times) <= 2 * most else _size(len(times), most)
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


def packed_path(x: Array, y: Array, most: int = MOST) -> dict[str, str]:
    """
    Return points (x, y) of a path, of more than `most` the first of each range.

    The distance between two points is too small to be visible.
    """
    kept = np.unique(np.append(np.arange(0, len(x), _size(len(x), most)), len(x) - 1))
    return {'x': _packed(x[kept]), 'y': _packed(y[kept])}


def packed_robot(robot: Robot, times: Array, positions: Array) -> dict[str, object]:
    """
    Return the outline of a robot in top view at instants evenly spread over a run.

    Parameters
    ----------
    robot
        Robot.
    times
        (n) in s from the first state.
    positions
        (n, positions) in the order of joint_states.

    """
    count = min(_INSTANTS, len(times))
    places = np.linspace(0, len(times) - 1, count).round().astype(int)
    draw, geometry = robot.mechanism.formulas.outline, robot.geometry
    outlines = [draw(geometry, positions[place]).shapes for place in places]
    points = np.array([np.concatenate([s.points for s in shapes]).ravel() for shapes in outlines])
    return {
        'times': np.round(times[places], 6).tolist(),
        'parts': [[shape.kind, len(shape.points)] for shape in outlines[0]],
        'points': _packed(points.T.ravel()),  # those of a coordinate differ little
    }


def _size(count: int, most: int) -> int:
    """Return the number of samples of a range for at most `most` ranges."""
    return max(1, -(-count // most))


def _packed(values: Array) -> str:
    """Pack float32: the bits of consecutive numbers differ little."""
    is_finite = np.isfinite(values)
    kept = np.where(is_finite, np.clip(values, -_LARGEST, _LARGEST), values)
    bits = kept.astype('<f4').view('<i4')
    return _deflated(np.diff(bits, prepend=np.int32(0)).astype('<i4'))


def _packed_times(times: Array) -> str:
    """Pack times as whole nanoseconds, whose differences are similar."""
    return _deflated(np.diff(np.round(times * _NANOSECONDS), prepend=0.0).astype('<f8'))


def _deflated(numbers: AnyArray) -> str:
    """Compress numbers: the first bytes of all, then the second bytes, and so on."""
    planes = numbers.view(np.uint8).reshape(len(numbers), -1).T
    return base64.b64encode(zlib.compress(planes.tobytes())).decode()
