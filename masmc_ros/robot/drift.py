# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0


"""
Drift: accelerations in the null space of the task that the model does not explain.

The disturbance estimate of a law is on the task axes. A robot with more velocities than axes is
also accelerated in the null space of the task. Such a mechanism estimates
these accelerations, the *drift*, and a_r compensates them. For any other mechanism the formulas
here apply, which change nothing.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.field import Field
from masmc_ros.robot.formula_types import LawMemory, LawSettings, Lengths, MechanismPosture

FIRST_GAIN = 0.5
"""Gain of the first estimate; later gains decrease."""

MEMORY = (
    Field('drift', 'joints', 'Estimated drift, in the velocities of the mechanism', '1/s²'),
    Field(
        'drift_predicted', 'joints', 'sigma of the next tick without a change of the drift',
        '1/s', initial=math.nan,
    ),
    Field('drift_limited', 'joints', 'Time since torques are at a limit, with its sign', 's'),
    Field('drift_gain', description='Gain of the next estimate', initial=FIRST_GAIN),
)  # fmt: skip
"""Memory of every law."""


@formula
def surface_itself(
    model: Lengths,
    posture: MechanismPosture,
    motion: Numbers,
    reference: Numbers,
    surface: Numbers,
) -> Numbers:
    """Return s (axes) unmodified; the default of `reachable_surface`."""
    return surface


@formula
def acceleration_itself(model: Lengths, acceleration: Numbers, drift: Numbers) -> Numbers:
    """Return a_r (joints) unmodified; the default of `compensated`."""
    return acceleration


@formula
def no_damping(model: Lengths) -> float:
    """Return 0 1/s; the default of `reference_damping`."""
    return 0.0


@formula
def no_drift(
    model: Lengths,
    posture: MechanismPosture,
    settings: LawSettings,
    memory: LawMemory,
    motion: Numbers,
    reference: Numbers,
    surface: Numbers,
    missing: Numbers,
) -> None:
    """Leave the memory unchanged; the default of `follow_drift`."""
