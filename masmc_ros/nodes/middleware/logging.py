# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Preparation of rclpy's logging, so the first log line does not delay a tick.

rclpy looks up the caller of each log line by `inspect.getframeinfo` (`_find_caller` in
rclpy/impl/rcutils_logger.py of rclpy 7.1). Its first call inspects all modules of the process:
50 ms, and a third of a second on a busy machine. Later calls use a cache. No upstream issue is
known. This file can be removed when rclpy takes the file name from the frame's code object.
"""

from __future__ import annotations

import inspect


def prepare_logging() -> None:
    """Fill the cache that maps modules to their files."""
    frame = inspect.currentframe()
    if frame is not None:
        inspect.getframeinfo(frame)
