# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Nonlinear feedback: inverse model, with task errors that decay like those of springs.

    xddot_c = xddot_d - K_d edot - K_p e - K_i w,    wdot = e
    tau = H J^-1 (xddot_c - Jdot v) + V v

is known as computed torque in task space, or resolved acceleration: J. Y. S. Luh, M. W. Walker and
R. P. C. Paul, "Resolved-acceleration control of mechanical manipulators", IEEE Transactions on
Automatic Control 25, 1980. The integral is an addition, with K_i = 0 by default. The paper names
nonlinear feedback, its reference [1], without equations. `input_output_decoupling` is the same.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.integral import integrated
from masmc_ros.law.parts.inverse_dynamics import (
    acceleration_torque,
    DAMPING,
    limited_acceleration,
    spring,
    STIFFNESS,
)
from masmc_ros.law.tick import Tick


class Settings(fields.Settings, group='nonlinear_feedback'):
    """Settings of the law."""

    nonlinear_feedback_k_p: Axes = gain(STIFFNESS, 'Stiffness K_p per mass', '1/s²')
    nonlinear_feedback_k_d: Axes = gain(DAMPING, 'Damping K_d per mass', '1/s')
    nonlinear_feedback_k_i: Axes = gain(0.0, 'Gain K_i of the integral', '1/s³')


class Memory(fields.Memory):
    """Memory of the law."""

    nonlinear_feedback_integral: Axes = field('w, integral of the error', 'm·s')


@formula
def _with_integral(acceleration: float, k_i: float, w: float) -> float:
    """Return xddot_c of one axis."""
    return acceleration - k_i * w


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    acceleration = elementwise(
        _with_integral,
        spring(tick, settings.nonlinear_feedback_k_d, settings.nonlinear_feedback_k_p),
        settings.nonlinear_feedback_k_i,
        memory.nonlinear_feedback_integral,
    )
    return acceleration_torque(tick, tick.nominal, acceleration)


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Integrate the error, with back-calculation from the commanded torque."""
    w = elementwise(
        integrated,
        memory.nonlinear_feedback_integral,
        tick.error,
        limited_acceleration(tick, tick.nominal, raw, torque),
        settings.nonlinear_feedback_k_p,
        settings.nonlinear_feedback_k_i,
        tick.period,
    )
    memory.nonlinear_feedback_integral = w


NONLINEAR_FEEDBACK = Law(
    'nonlinear_feedback',
    torque,
    Settings,
    Memory,
    learn,
    project,
    summary='the model inverted in task space, with PD feedback (and an integral)',
    source='[1] of the paper; computed torque in task space',
    uses_switching=False,
)
