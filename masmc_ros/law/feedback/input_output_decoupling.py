# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Input-output decoupling: torque of `nonlinear_feedback`, as the paper names its reference [4].

The second derivative of the outputs y = x is yddot = Jdot v + J H^-1 (f - V v). The inputs
f = (J H^-1)^-1 (nu - Jdot v) + V v give yddot = nu, one output for each input. They equal
H J^-1 (nu - Jdot v) + V v, therefore formulas and parameters are those of the other file.
"""

from __future__ import annotations

from masmc_ros.law.feedback.nonlinear_feedback import learn, Memory, Settings, torque
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project

INPUT_OUTPUT_DECOUPLING = Law(
    'input_output_decoupling',
    torque,
    Settings,
    Memory,
    learn,
    project,
    summary='one output for each input: `nonlinear_feedback` by another name',
    source='[4] of the paper; input-output linearisation',
    uses_switching=False,
)
