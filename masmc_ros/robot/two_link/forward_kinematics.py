# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Task positions of many states at once, for checks and reports."""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.compiled import kernel
from masmc_ros.robot.two_link.geometry import Geometry, posture
from masmc_ros.robot.two_link.kinematics import task_position
import numpy as np
from numpy.typing import NDArray


@kernel
def task_positions(geometry: Any, position: Any) -> NDArray[np.float64]:
    """
    Return (n, 4) task positions in m from lengths (5) and positions (n, 7).

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
