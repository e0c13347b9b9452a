# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""State derivative of the plant as one vector, for comparison with other derivations."""

from __future__ import annotations

from typing import NamedTuple

from helpers.robots import Quad
from masmc_ros.plant_model import motion
from masmc_ros.robot.two_link.dynamics import BaseParameters
from masmc_ros.robot.two_link.geometry import Geometry


class PlantState(NamedTuple):
    """Pose of the axle's centre O, wheel and arm angles, reduced velocity; SI, radians."""

    x: float
    y: float
    yaw: float
    wheel_right: float
    wheel_left: float
    arm_1: float
    arm_2: float
    v_right: float
    v_left: float
    v_arm_1: float
    v_arm_2: float


def derivative(
    theta: BaseParameters, geometry: Geometry, state: PlantState, torque: Quad
) -> PlantState:
    """Return the state's time derivative under a torque (4) in N·m."""
    rates, accelerations = motion.derivative(
        geometry, tuple(theta), tuple(state[:7]), tuple(state[7:]), torque
    )
    return PlantState(*rates, *accelerations)
