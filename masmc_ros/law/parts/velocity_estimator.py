# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint velocities from joint angles, by a Luenberger observer for each joint.

The observer estimates angle, rate and unmodelled acceleration. Between two ticks the nominal model
predicts the acceleration by the commanded torque and the law's disturbance estimate. At a tick all
three are corrected by the measured angle. docs/theory/estimator.md has the equations.
"""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula, subroutine
from masmc_ros.jit.tuples import column, elementwise, tail
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.numerics.scalars import plus, zero
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import Lengths, MechanismPosture

SOURCES = ('measured', 'estimated')
"""Choices of the parameter `velocity_source`; compiled code knows them by their position."""

MEASURED, ESTIMATED = range(len(SOURCES))

VELOCITY_SOURCE = Parameter(
    'velocity_source',
    'measured',
    'measured: joint velocities of joint_states; estimated: estimates from the joint angles',
    choices=SOURCES,
    read_only=False,
)

ESTIMATOR_BANDWIDTH = Parameter(
    'estimator_bandwidth',
    0.0,
    'Bandwidth of the velocity estimator; 0: 1000, with compensation of latency 200',
    unit='rad/s',
    minimum=0.0,
    read_only=False,
)

PARAMETERS = (VELOCITY_SOURCE, ESTIMATOR_BANDWIDTH)

BANDWIDTH = 1000.0
"""Default bandwidth in rad/s without compensation of latency."""

_UNMODELLED = 0.1
"""Rate of the disturbance estimate relative to that of a filter of third order."""


@formula
def filter_bandwidth(settings: Settings, default: float) -> float:
    """Return the bandwidth in rad/s: `estimator_bandwidth`, or the default one if it is 0."""
    chosen = settings.estimator_bandwidth
    return chosen if chosen > 0.0 else default


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

    Parameters
    ----------
    angle, rate, unmodelled
        Estimates at the start of the period.
    acceleration
        Acceleration of the model in the period in rad/s².
    measured
        Measured angle at the end of the period in rad.
    period
        Period T in s.
    gain
        Gains of `gains`.

    """
    total = acceleration + unmodelled
    reached = angle + period * rate + 0.5 * period * period * total
    missed = measured - reached
    return (
        reached + gain[0] * missed,
        rate + period * total + gain[1] * missed / period,
        unmodelled + gain[2] * missed / (period * period),
    )


@formula
def expected_acceleration(model: Lengths, theta: Numbers, memory: Memory) -> Numbers:
    """
    Return the joint accelerations (joints) in rad/s² of a model under the last command.

    Parameters
    ----------
    model
        Lengths of the mechanism.
    theta
        Base inertial parameters (parameters) of the model.
    memory
        Memory of the law, with estimated angles and rates, last command and disturbance.

    """
    angles, rates = memory.angles, memory.rates
    torque = elementwise(plus, memory.commanded, memory.disturbance_torque)
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


@subroutine
def estimate_rates(
    settings: Settings, memory: Memory, position: Numbers, knows_torques: bool
) -> None:
    """
    Advance the estimated angles, rates and unmodelled accelerations to the tick of a position.

    Skipped ticks are one long period with separate gains; the gains of a single period would be
    many times too large.

    Parameters
    ----------
    settings, memory
        Settings and memory of the law.
    position
        Measured positions (positions); the last ones are the joint angles.
    knows_torques
        False with commanded rates. The torques of the drives are then unknown, and all
        acceleration is unmodelled.

    """
    angles, rates = memory.angles, memory.rates
    unmodelled = memory.unmodelled
    measured = tail(position, angles)
    period = (1 + memory.uncomputed_ticks) * settings.period
    memory.uncomputed_ticks = 0
    if memory.estimator_initialised == 0:
        memory.estimator_initialised = 1
        memory.angles = measured
        memory.rates = elementwise(zero, angles)
        memory.unmodelled = elementwise(zero, angles)
        return
    gain = gains(filter_bandwidth(settings, BANDWIDTH), period)
    a = elementwise(zero, angles)
    if knows_torques:
        model = mechanism.model_of(settings)
        a = expected_acceleration(model, settings.nominal, memory)
    estimates = elementwise(
        _followed, angles, rates, unmodelled, a, measured, period, gain[0], gain[1], gain[2]
    )
    memory.angles = column(estimates, 0)
    memory.rates = column(estimates, 1)
    memory.unmodelled = column(estimates, 2)


@subroutine
def note_disturbance(
    memory: Memory, model: Lengths, posture: MechanismPosture, disturbance: Numbers
) -> None:
    """
    Store the disturbance estimate of the law as joint torques for the next prediction.

    Parameters
    ----------
    memory
        Memory of the law; `disturbance_torque` (joints) is set, in N·m.
    model, posture
        Lengths, and posture of the state.
    disturbance
        Disturbance force on the task axes (axes) in N.

    """
    force = mechanism.forces_from_task(model, posture, disturbance, memory.rates)
    memory.disturbance_torque = mechanism.joint_torques(model, force)
