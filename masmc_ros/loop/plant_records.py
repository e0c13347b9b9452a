# SPDX-License-Identifier: Apache-2.0
"""What the plant's compiled code reads and remembers, each as one structured array."""

from __future__ import annotations

import numpy as np

from masmc_ros.robot import AXES, BASE_PARAMETERS

PLANT_SETTINGS = np.dtype(
    [
        ('geometry', 'f8', 5),  # lengths in m, in the order of Geometry
        ('theta', 'f8', BASE_PARAMETERS),
        ('amplitude', 'f8', AXES),  # disturbance: N m, rad/s, rad
        ('frequency', 'f8', AXES),
        ('phase', 'f8', AXES),
        ('limit', 'f8', AXES),  # of each motor's torque, N m
        ('rate_limit', 'f8', AXES),  # of its change, N m/s
        ('period', 'f8'),  # s
        ('steps', 'i8'),  # of integration in a period
        ('is_exact', 'i8'),  # whether the state is measured as it is: the next four are zero
        ('resolution', 'f8', AXES),  # rad
        ('noise', 'f8', AXES),  # standard deviation in rad/s
        ('delay', 'i8'),  # ticks
        ('seed', 'i8'),
        ('command_interface', 'i8'),  # position in COMMAND_INTERFACES
        ('bandwidth', 'f8', AXES),  # of the drives' velocity loops, rad/s
        ('inertia', 'f8', AXES),  # for which they are tuned, kg m2
    ],
    align=True,
)
"""The robot, what disturbs it, and how its state is measured."""

PLANT_MEMORY = np.dtype(
    [
        ('position', 'f8', 7),  # the true state, in the order of joint_states
        ('velocity', 'f8', 7),
        ('odometry', 'f8', 3),  # x, y, yaw of the axle's middle by counting wheel angles
        ('wheels', 'f8', 2),  # angles counted so far, rad
        ('driven', 'f8', AXES),  # torque of the last tick, N m
        ('wound', 'f8', AXES),  # integrals of the drives' velocity loops, N m
    ],
    align=True,
)
"""What one tick hands on to the next."""
