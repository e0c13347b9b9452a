# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint velocities from joint angles, by a Luenberger observer for each joint.

The observer estimates angle, rate and unmodelled acceleration. Between two ticks the nominal model
predicts the acceleration by the commanded torque and the law's disturbance estimate. At a tick all
three are corrected by the measured angle. docs/theory/estimator.md has the equations.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.record import get, put
from masmc_ros.numerics.scalars import plus, zero
from masmc_ros.numerics.tuples import column, elementwise, tail
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import mechanism

SOURCES = ('measured', 'estimated')
"""Choices of the parameter `velocity_source`; compiled code knows them by their position."""

MEASURED, ESTIMATED = range(len(SOURCES))

PARAMETERS = (
    Parameter(
        'velocity_source',
        'measured',
        'measured: joint velocities of joint_states; estimated: estimates from the joint angles',
        choices=SOURCES,
        read_only=False,
    ),
    Parameter(
        'estimator_bandwidth',
        1000.0,
        'Bandwidth of the velocity estimator',
        unit='rad/s',
        minimum=0.0,
        exclusive_minimum=True,
        read_only=False,
    ),
)

_UNMODELLED = 0.1
"""Rate of the disturbance estimate relative to that of a filter of third order."""


@formula
def gains(bandwidth: float, period: float) -> tuple[float, float, float]:
    """
    Return the gains of angle, rate (times T) and unmodelled acceleration (times T^2).

    Angle and rate are those of a critically damped filter of second order, both poles at
    1 / (1 + bandwidth T): bandwidth in rad/s, T the period in s.
    """
    pole = 1.0 / (1.0 + bandwidth * period)
    of_angle = 1.0 - pole * pole
    of_rate = (1.0 - pole) * (1.0 - pole)
    return of_angle, of_rate, _UNMODELLED * of_rate * of_rate / of_angle


@formula
def followed(
    angle: float,
    rate: float,
    unmodelled: float,
    acceleration: float,
    measured: float,
    period: float,
    gain: tuple[float, float, float],
) -> tuple[float, float, float]:
    """
    Return angle (rad), rate (rad/s) and unmodelled acceleration (rad/s²) one period later.

    `acceleration` (rad/s²) is that of the model in the period, `measured` the angle at its end.
    """
    total = acceleration + unmodelled
    reached = angle + period * rate + 0.5 * period * period * total
    missed = measured - reached
    return (
        reached + gain[0] * missed,
        rate + period * total + gain[1] * missed / period,
        unmodelled + gain[2] * missed / (period * period),
    )


MEMORY = (
    Field('estimator_initialised', description='1 after the first measured position', kind='i8'),
    Field('left_out', description='Ticks since the last one that were not computed', kind='i8'),
    Field('angles', 'joints', 'Estimated angles', 'rad'),
    Field('rates', 'joints', 'Estimated rates', 'rad/s'),
    Field('unmodelled', 'joints', 'Estimated unmodelled accelerations', 'rad/s²'),
    Field('felt', 'joints', "The law's disturbance estimate as torques at the last tick", 'N·m'),
    Field('commanded', 'joints', 'Torque of the last tick', 'N·m'),
)
"""Memory of the estimator."""


@formula
def expected_acceleration(model: Any, theta: Numbers, memory: Any, lane: int) -> Numbers:
    """Return the joints' acceleration (rad/s2) under the last command by the nominal model."""
    angles, rates = get(memory, 'angles', lane), get(memory, 'rates', lane)
    torque = elementwise(plus, get(memory, 'commanded', lane), get(memory, 'felt', lane))
    bend = mechanism.posture_of_joints(model, angles)
    return mechanism.joint_accelerations(model, bend, theta, rates, torque)


@formula
def _followed(
    angle: float,
    rate: float,
    unmodelled: float,
    acceleration: float,
    measured: float,
    period: float,
    of_angle: float,
    of_rate: float,
    of_unmodelled: float,
) -> tuple[float, float, float]:
    gain = (of_angle, of_rate, of_unmodelled)
    return followed(angle, rate, unmodelled, acceleration, measured, period, gain)


@formula
def estimate_rates(
    settings: Any, memory: Any, position: Numbers, lane: int, knows_torques: bool
) -> None:
    """
    Advance the estimated angles, rates and unmodelled accelerations to the tick of a position.

    Skipped ticks are one long period with separate gains; the gains of a single period would be
    many times too large. `knows_torques` is false with commanded rates: the torques of the drives
    are unknown then, and all acceleration is unmodelled.
    """
    angles, rates = get(memory, 'angles', lane), get(memory, 'rates', lane)
    unmodelled = get(memory, 'unmodelled', lane)
    measured = tail(position, angles)
    period = (1 + get(memory, 'left_out', lane)) * get(settings, 'period', lane)
    put(memory, 'left_out', lane, 0)
    if get(memory, 'estimator_initialised', lane) == 0:
        put(memory, 'estimator_initialised', lane, 1)
        put(memory, 'angles', lane, measured)
        put(memory, 'rates', lane, elementwise(zero, angles))
        put(memory, 'unmodelled', lane, elementwise(zero, angles))
        return
    gain = gains(get(settings, 'estimator_bandwidth', lane), period)
    a = elementwise(zero, angles)
    if knows_torques:
        model = mechanism.model_of(settings, lane)
        a = expected_acceleration(model, get(settings, 'nominal', lane), memory, lane)
    estimates = elementwise(
        _followed, angles, rates, unmodelled, a, measured, period, gain[0], gain[1], gain[2]
    )
    put(memory, 'angles', lane, column(estimates, 0))
    put(memory, 'rates', lane, column(estimates, 1))
    put(memory, 'unmodelled', lane, column(estimates, 2))


@formula
def note_disturbance(
    memory: Any, model: Any, posture: Any, disturbance: Numbers, lane: int
) -> None:
    """Store the law's disturbance estimate (N) as torques for the next prediction."""
    force = mechanism.forces_from_task(
        model, posture, disturbance, get(memory, 'rates', lane)
    )
    put(memory, 'felt', lane, mechanism.joint_torques(model, force))
