# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Gains of the compensation of latency: rule for h, beta and beta_2, and gains of the observer.

docs/theory/latency.md derives them.
"""

from __future__ import annotations

from masmc_ros.jit.compiled import formula
from masmc_ros.law.fields import Settings

HORIZON, LARGEST_HORIZON = 1.1, 1.5
"""
Horizon h in latencies, to which a period is added, and largest h in latencies.

A smaller one is more accurate and tolerates smaller errors of latency and masses. Without the
period, nodes at 500 Hz with a jitter of some milliseconds diverge on a busy machine.
"""

SLOPE, SLOPE_PERIODS = 0.25, 0.05
"""
Gain beta_2 of the slope, as a multiple of beta squared: least, and increase with T / latency.

A larger one is more accurate. With a latency of many periods the loop then oscillates if the
assumed masses are less than 0.4 of the true ones.
"""

LAG_SHARE, LEAST_LAG_SHARE = 0.25, 0.75
"""
Shares of the motor lag in the latency of the rule for h and beta: added, and the least.

The model contains the lag, so the gains need a part of it only. Without latency, a smaller least
share is unstable.
"""

LARGEST_GAIN = 0.25
"""Largest beta of the rule."""


@formula
def horizon_of_rule(latency: float, period: float) -> float:
    """Return h in s for a latency and a control period in s."""
    longer = max(latency, period)
    return min(HORIZON * longer + period, LARGEST_HORIZON * longer)


@formula
def gain_of_rule(latency: float, period: float) -> float:
    """Return beta for a latency and a control period in s."""
    return period / latency if LARGEST_GAIN * latency > period else LARGEST_GAIN


@formula
def slope_of_rule(latency: float, period: float) -> float:
    """Return beta_2 as a multiple of beta squared for a latency and a control period in s."""
    return SLOPE + SLOPE_PERIODS * period / max(latency, period)


@formula
def _latency_of_rule(settings: Settings) -> float:
    """Return the latency in s by which the rule sets the gains."""
    lag = settings.motor_lag
    return max(settings.latency + LAG_SHARE * lag, LEAST_LAG_SHARE * lag)


@formula
def horizon(settings: Settings) -> float:
    """Return h in s: the chosen one, that of the rule, or T without latency."""
    chosen, period = settings.compensation_horizon, settings.period
    latency = _latency_of_rule(settings)
    of_rule = horizon_of_rule(latency, period) if latency > 0.0 else period
    return chosen if chosen > 0.0 else of_rule


@formula
def estimate_gain(settings: Settings) -> float:
    """Return beta, the gain of the disturbance estimate per tick."""
    chosen = settings.compensation_gain
    of_rule = gain_of_rule(_latency_of_rule(settings), settings.period)
    return chosen if chosen > 0.0 else of_rule


@formula
def slope(settings: Settings) -> float:
    """Return beta_2 as a multiple of beta squared."""
    chosen = settings.compensation_slope
    of_rule = slope_of_rule(_latency_of_rule(settings), settings.period)
    return chosen if chosen > 0.0 else of_rule


@formula
def observer_gains(
    bandwidth: float, period: float, gain: float, slope_gain: float
) -> tuple[float, float, float, float]:
    """
    Return the gains of angle, rate (times T), d (times T^2) and delta (times T^2).

    Two poles are 1 / (1 + bandwidth T). The others are those of the estimate from measured rates.
    docs/theory/latency.md derives them.

    Parameters
    ----------
    bandwidth
        Bandwidth of the observer in rad/s.
    period
        Time T since the last computed tick in s.
    gain
        Gain beta of d.
    slope_gain
        Gain beta_2 of delta.

    """
    a = 1.0 - 1.0 / (1.0 + bandwidth * period)
    b = gain + slope_gain
    of_slope = a * a * slope_gain
    of_d = a * a * b + 2.0 * a * slope_gain - 1.5 * of_slope
    of_rate = a * a + 2.0 * a * b + slope_gain - 1.5 * of_d - 0.5 * of_slope
    return 2.0 * a + b - of_rate - 0.5 * of_d, of_rate, of_d, of_slope
