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

"""The first line that a process logs, without what it costs."""

from __future__ import annotations

import inspect


def prepare_logging() -> None:
    """
    Find out now which file each module is from; a line that is logged asks for its caller's.

    rclpy finds the caller of each line by `inspect.getframeinfo`. The first time that takes a
    look at every module of the process: 50 ms, and a third of a second on a machine that is
    busy, in the middle of a tick and of all times with the first warning. Afterwards it is
    known. This can go when rclpy takes the file's name from the frame's code.
    """
    frame = inspect.currentframe()
    if frame is not None:
        inspect.getframeinfo(frame)
