# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Folder of the log files of rcl for a user without a writable home.

rcl writes into `~/.ros/log`, and no node starts if that is not possible. This file can be removed
when nodes start without it (`test/cli/test_environment.py`).
"""

from __future__ import annotations

import os
from pathlib import Path

from masmc_ros.user_folder import runtime_folder

_CONFIGURED = ('ROS_LOG_DIR', 'ROS_HOME')


def prepare_log_folder() -> None:
    """
    Let rcl write its log files into the user's runtime folder if the home cannot take them.

    Call this before rclpy is initialized. Nothing changes if the user has chosen a folder.
    """
    if any(os.environ.get(name) for name in _CONFIGURED):
        return
    home = os.environ.get('HOME')
    if not home or not _is_writable(Path(home) / '.ros' / 'log'):
        os.environ[_CONFIGURED[0]] = str(runtime_folder() / 'log')


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)
