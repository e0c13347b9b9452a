# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Packages that an installation may lack, and the remedy if one is missing.

They are for logs, reports and viewers. rosdep installs some of them by pip, which a machine may
not allow, and does not know the others. Therefore no node that controls a robot imports them.
"""

from __future__ import annotations

from importlib import import_module

from masmc_ros.errors import UserError

PACKAGES = {
    'clarabel': 'clarabel',
    'cuda': 'cuda-bindings',
    'distributed': 'distributed',
    'gymnasium': 'gymnasium',
    'lz4': 'lz4',
    'mcap': 'mcap',
    'mcap_ros2': 'mcap-ros2-support',
    'mujoco': 'mujoco-core',
    'optuna': 'optuna',
    'pandas': 'pandas',
    'plotly': 'plotly',
    'pyarrow': 'pyarrow',
    'rosbags': 'rosbags',
    'ruckig': 'ruckig',
    'scipy': 'scipy',
    'toppra': 'toppra',
    'trimesh': 'trimesh',
    'viser': 'viser',
    'xarray': 'xarray',
    'zstandard': 'zstandard',
}
"""Names of the modules for pip."""


def remedy(error: ModuleNotFoundError) -> UserError:
    """Return the remedy for a missing module; raise the error for a module not in PACKAGES."""
    module = (error.name or '').partition('.')[0]
    if module not in PACKAGES:
        raise error
    return UserError(f'{module} is not installed; pip install {PACKAGES[module]}')


def require_rclpy() -> None:
    """Raise UserError with the remedy if rclpy cannot be imported."""
    try:
        import_module('rclpy')
    except ImportError as error:
        raise UserError(
            f'rclpy cannot be imported ({error}); source a ROS 2 Jazzy installation, or install'
            " its wheels in a checkout with pip install '.[ros]' (Linux x86_64); masmc simulate"
            ' runs without it'
        ) from error
