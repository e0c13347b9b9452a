# SPDX-License-Identifier: Apache-2.0
"""Task positions of many states at once, for checks and reports."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from masmc_ros.numerics.compiled import kernel
from masmc_ros.robot.two_link.geometry import Geometry, posture
from masmc_ros.robot.two_link.kinematics import task_position


@kernel
def task_positions(geometry: Any, position: Any) -> NDArray[np.float64]:
    """Return (n, 4) task positions in m from lengths (5) and positions (n, 7).

    Positions are in the order of joint_states: x_O, y_O, yaw, wheels, theta_1, theta_2.
    """
    lengths = Geometry(geometry[0], geometry[1], geometry[2], geometry[3], geometry[4])
    out = np.empty((len(position), 4))
    for k in range(len(position)):
        row = position[k]
        x = task_position(lengths, posture(row[2], row[5], row[6]), row[0], row[1])
        out[k, 0] = x[0]
        out[k, 1] = x[1]
        out[k, 2] = x[2]
        out[k, 3] = x[3]
    return out
