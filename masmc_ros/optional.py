# SPDX-License-Identifier: Apache-2.0
"""Packages that not every installation has, and what to do where one is missing.

ROS 2 installs what rosdep knows; these it does not know, so that nothing that steers a robot
may import them: they are for logs, reports and viewers.
"""

from __future__ import annotations

from masmc_ros.errors import UserError

PACKAGES = {
    'foxglove': 'foxglove-sdk',
    'lz4': 'lz4',
    'mcap': 'mcap',
    'mcap_ros2': 'mcap-ros2-support',
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
