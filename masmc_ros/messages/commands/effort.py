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

"""The controller's torques as a message."""

from __future__ import annotations

from collections.abc import Sequence

from masmc_ros.messages.commands.labelled_command import CommandKind, LabelledCdr
from masmc_ros.messages.names import DRIVEN_JOINTS

EFFORT = CommandKind('effort command', 'torque', 'effort@', DRIVEN_JOINTS)
"""Torques in N m, labelled `effort@SECONDS.NANOSECONDS`."""


class EffortCdr(LabelledCdr):
    """Torques of the driven joints in N m, in `data`."""

    def __init__(self, joints: Sequence[str] = DRIVEN_JOINTS) -> None:
        """Make a command of zeros, for joints of these names, that answers the state of time 0."""
        super().__init__(EFFORT.named(joints))
