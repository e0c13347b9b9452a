# SPDX-License-Identifier: Apache-2.0
"""What the controller's compiled code reads and remembers, each as one structured array.

Both are arrays of one record, so that a name stands where a position in a list of arguments
would; compiled code and Python read the same fields.
"""

from __future__ import annotations

import numpy as np

from masmc_ros.robot import AXES, BASE_PARAMETERS

SETTINGS = np.dtype(
    [
        ('geometry', 'f8', 5),  # lengths in m, in the order of Geometry
        ('nominal', 'f8', BASE_PARAMETERS),  # theta of the nominal model
        ('period', 'f8'),  # s
        ('law', 'i8'),  # position in BUILT_IN
        ('switching', 'i8'),  # position in SWITCHING
        ('k_s1', 'f8', AXES),
        ('k_s2', 'f8', AXES),
        ('sigma', 'f8', AXES),
        ('gamma', 'f8', BASE_PARAMETERS),
        ('boundary_layer', 'f8'),
        ('observer_gain', 'f8'),
        ('has_limits', 'i8'),  # whether any of the next two is not zero
        ('torque_limit', 'f8', AXES),
        ('torque_rate_limit', 'f8', AXES),
        ('leakage', 'f8'),
        ('e_modification', 'f8'),
        ('dead_zone', 'f8'),
        ('freeze_when_saturated', 'i8'),
        ('projection_lower', 'f8'),  # 0: no projection
        ('projection_upper', 'f8'),
        ('velocity_source', 'i8'),  # position in SOURCES
        ('estimator_bandwidth', 'f8'),
        ('command_interface', 'i8'),  # position in COMMAND_INTERFACES
    ],
    align=True,
)
"""Gains and model; units as in the declarations of the parameters of the same names."""

MEMORY = np.dtype(
    [
        ('estimate', 'f8', BASE_PARAMETERS),  # theta_hat of the next tick
        ('disturbance', 'f8', AXES),  # d of the implicit law, N
        ('predicted', 'f8', AXES),  # s+ in m/s, not-a-number where there is none
        ('commanded', 'f8', AXES),  # torque of the last tick, N m
        ('velocity_command', 'f8', AXES),  # of the last tick: m/s, then three rates in rad/s
        ('follows', 'i8'),  # whether the velocity estimator has begun
        ('left_out', 'i8'),  # ticks since the last one that were not computed
        ('angles', 'f8', AXES),  # its estimates: rad, rad/s, rad/s2
        ('rates', 'f8', AXES),
        ('push', 'f8', AXES),
        ('felt', 'f8', AXES),  # d as torques at the last tick, N m
    ],
    align=True,
)
"""What one tick hands on to the next."""
