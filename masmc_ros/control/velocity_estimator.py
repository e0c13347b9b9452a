# SPDX-License-Identifier: Apache-2.0
"""Rates from joint angles: a Luenberger observer of angle, rate and push, one joint at a time.

Between two ticks the nominal model says how the commanded torque and the law's disturbance
estimate accelerate the joint; the push, an acceleration, is what they leave unsaid. At a tick
all three follow the angle that was measured. docs/estimator.md has the equations.
"""

from __future__ import annotations

from masmc_ros.compiled import formula

SOURCES = ('measured', 'estimated')
"""Choices of the parameter `velocity_source`; compiled code knows them by their position."""

MEASURED, ESTIMATED = range(len(SOURCES))

_PUSH = 0.1
"""How fast the push follows, in proportion to what a filter of third order would have."""


@formula
def gains(bandwidth: float, period: float) -> tuple[float, float, float]:
    """Return the gains of angle, rate (times T) and push (times T^2).

    Angle and rate are those of a critically damped filter of second order, both poles at
    1 / (1 + bandwidth T): bandwidth in rad/s, T the period in s.
    """
    pole = 1.0 / (1.0 + bandwidth * period)
    of_angle = 1.0 - pole * pole
    of_rate = (1.0 - pole) * (1.0 - pole)
    return of_angle, of_rate, _PUSH * of_rate * of_rate / of_angle


@formula
def followed(
    angle: float,
    rate: float,
    push: float,
    acceleration: float,
    measured: float,
    period: float,
    gain: tuple[float, float, float],
) -> tuple[float, float, float]:
    """Return angle (rad), rate (rad/s) and push (rad/s2) one period later.

    `acceleration` (rad/s2) is what the model expects over the period, `measured` the angle at
    its end.
    """
    total = acceleration + push
    reached = angle + period * rate + 0.5 * period * period * total
    missed = measured - reached
    return (
        reached + gain[0] * missed,
        rate + period * total + gain[1] * missed / period,
        push + gain[2] * missed / (period * period),
    )
