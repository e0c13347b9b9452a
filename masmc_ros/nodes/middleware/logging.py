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

"""
Preparation of rclpy's logging, so the first log line does not delay a tick.

rclpy finds the caller of each log line by `inspect.getframeinfo` (`_find_caller` in
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
