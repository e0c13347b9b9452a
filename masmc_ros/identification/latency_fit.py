# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Latency and motor lag: best alignment of commands with the measured motion.

The averaged equations of motion are linear in the parameters, which are therefore eliminated
(variable projection, Golub and Pereyra 1973). The remaining residual depends on the latency L and
the lag alone. L is the age of a state when the torque computed from it starts to act.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from masmc_ros.aliases import Array
import numpy as np

LARGEST = 0.1
"""Largest latency and motor lag in s."""

_COARSE = 0.005
"""Step in s of the first search."""

_STEP = 1.0e-4
"""Step in s of the differences."""


_SHARES = (0.1, 0.5, 0.9)
"""Shares of the lag in the sum of latency and lag, at the starts of the search."""


class Estimate(NamedTuple):
    """Value and its standard error, in the same unit."""

    value: float
    error: float


class LatencyFit(NamedTuple):
    """Latency, motor lag and their sum in s; the sum has the smallest error."""

    latency: Estimate
    lag: Estimate
    total: Estimate


def fit_timing(
    residual: Callable[[float, float], Array], near: LatencyFit | None = None
) -> LatencyFit:
    """
    Return the latency and the motor lag with the smallest residual.

    Parameters
    ----------
    residual
        Function of latency and lag in s that returns the projected and weighted residuals (r).
    near
        Estimate from which the search starts; None: a search over the whole range.

    """
    from scipy.optimize import least_squares

    if near is None:
        grid = np.arange(_COARSE, LARGEST + _COARSE / 2.0, _COARSE)
        costs = [float(np.sum(residual(total, 0.0) ** 2)) for total in grid]
        start = float(grid[int(np.argmin(costs))])
        shares = list(_SHARES)
    else:
        start = max(near.total.value, _STEP)
        shares = [min(max(near.lag.value / start, _SHARES[0]), _SHARES[-1])]

    def derivatives(latency: float, lag: float) -> Array:
        """Return the derivatives (r, 2) by latency and lag."""
        low_latency, low_lag = max(latency - _STEP, 0.0), max(lag - _STEP, 0.0)
        by_latency = residual(latency + _STEP, lag) - residual(low_latency, lag)
        by_lag = residual(latency, lag + _STEP) - residual(latency, low_lag)
        return np.column_stack([
            by_latency / (latency + _STEP - low_latency),
            by_lag / (lag + _STEP - low_lag),
        ])

    # The sum of both and the share of the lag in it are nearly independent variables.
    def of_share(x: Array) -> tuple[float, float]:
        return float(x[0] * (1.0 - x[1])), float(x[0] * x[1])

    def jacobian(x: Array) -> Array:
        total, share = x
        outer = np.array([[1.0 - share, -total], [share, total]])
        return np.asarray(derivatives(*of_share(x)) @ outer)

    fits = [
        least_squares(
            lambda x: residual(*of_share(x)),
            [start, share],
            jacobian,
            ([0.0, 0.0], [2.0 * LARGEST, 1.0]),
            x_scale=[_COARSE, 1.0],
        )
        for share in shares
    ]
    fit = min(fits, key=lambda candidate: candidate.cost)
    latency, lag = of_share(fit.x)
    factors = derivatives(latency, lag)
    variance = 2.0 * fit.cost / max(1, len(fit.fun) - 2)
    covariance = variance * np.linalg.pinv(factors.T @ factors)
    return LatencyFit(
        Estimate(latency, float(np.sqrt(covariance[0, 0]))),
        Estimate(lag, float(np.sqrt(covariance[1, 1]))),
        Estimate(latency + lag, float(np.sqrt(covariance.sum()))),
    )
