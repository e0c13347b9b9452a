# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Settling time of a tracking error."""

from __future__ import annotations

import math

from masmc_ros.aliases import Array
import numpy as np

BAND = 0.02
"""Band around zero as a part of the first error: 2 %, as for a step response."""

FLOOR = 1.0e-3
"""Smallest band in m, for runs that start on their reference."""

STAY = 0.5
"""Part of the time since the last change of parameters for which the error must stay, at its end.

Otherwise an oscillation that happens to be near zero when the log ends would be settled: under
smc the paper's run has such a burst once in ten seconds, the period of its path.
"""

LEAST_STAY = 0.25
"""The same as a part of the whole time, for changes shortly before the end."""


def settling_band(errors: Array) -> float:
    """Return the band in m of errors (n, m) in m, n > 0: BAND of the first, at least FLOOR."""
    return float(np.maximum(BAND * np.linalg.norm(errors[0]), FLOOR))


def settling_time(times: Array, errors: Array, changed: float = -math.inf) -> float | None:
    """
    Return the time after which |e| stays in the band until the log ends.

    The settling time of a step response (Ogata, Modern Control Engineering), with the error in
    place of the distance from the final value.

    Parameters
    ----------
    times
        (n) s, ascending.
    errors
        (n, m) m; NaN is outside the band.
    changed
        time of the last change of parameters, s.

    Returns
    -------
        s from the first error; infinity if it does not settle, or does not stay long enough
        (see STAY, LEAST_STAY); None without errors.

    """
    if not len(errors):
        return None
    outside = np.flatnonzero(~(np.linalg.norm(errors, axis=1) <= settling_band(errors)))
    first = int(outside[-1]) + 1 if len(outside) else 0
    settled = float(times[first]) if first < len(times) else math.inf
    return settled_after(float(times[0]), settled, float(times[-1]), changed)


def settled_after(start: float, settled: float, end: float, changed: float = -math.inf) -> float:
    """
    Return the settling time in s of an error that stays in the band from the time `settled` on.

    `start` and `end` are the times of the first and of the last error; `settled` is infinite if
    the last one is outside of the band.
    """
    stay = max(STAY * (end - max(start, changed)), LEAST_STAY * (end - start))
    return settled - start if end - settled >= stay else math.inf
