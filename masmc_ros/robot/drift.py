# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Drift: accelerations in the null space of the task that the model does not explain.

The disturbance estimate of a law is on the task axes. A robot with more velocities than axes is
also accelerated in the null space of the task. Such a mechanism estimates
these accelerations, the *drift*, and a_r compensates them (`follow_drift`, `compensated` of
`mechanism.py`). For any other mechanism the drift stays zero.
"""

from __future__ import annotations

import math

from masmc_ros.jit.field import Field

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
