# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Packages that not every installation has, and what to do where one is missing.

They are for logs, reports and viewers. rosdep installs some of them by pip, which a machine may
not allow, and does not know the others. Therefore nothing that steers a robot imports them.
"""

from __future__ import annotations

from masmc_ros.errors import UserError

PACKAGES = {
    'foxglove': 'foxglove-sdk',
    'lz4': 'lz4',
    'mcap': 'mcap',
    'mcap_ros2': 'mcap-ros2-support',
    'mujoco': 'mujoco-core',
    'plotly': 'plotly',
    'pyarrow': 'pyarrow',
    'rosbags': 'rosbags',
    'zstandard': 'zstandard',
}
"""Modules, and the names by which pip installs them."""


def explained(error: ModuleNotFoundError) -> UserError:
    """Return what to do about a module that is missing; raise the error if it is none of these."""
    module = (error.name or '').partition('.')[0]
    if module not in PACKAGES:
        raise error
    return UserError(f'{module} is not installed; pip install {PACKAGES[module]}')
