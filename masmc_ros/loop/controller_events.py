# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Events, other than parameter changes, that change the torque from a tick onwards."""

from __future__ import annotations

ACTIVATED = 'activated'
"""The controller restarts as at the start of a run; with an approach if it was inactive."""

RESUMED = 'resumed'
"""The controller continues with the estimates from before its deactivation."""

DEACTIVATED = 'deactivated'
"""The law is not computed; the safe stop commands according to `fault_action`."""

GUIDED = 'hand guiding'
"""The law is not computed; gravity is compensated, and a hand moves the arm."""

UNFOLDED = 'leaving a singular posture'
"""Before an activation: the joints move to a posture in which the law can start."""

ADAPTATION_RESET = 'adaptation reset'
"""The adaptation is reset; the last command persists."""

RELEASED = 'released'
"""The controller no longer holds the robot; `deactivated` commands no torque from here on."""

EVENTS = (ACTIVATED, RESUMED, DEACTIVATED, GUIDED, UNFOLDED, ADAPTATION_RESET, RELEASED)
