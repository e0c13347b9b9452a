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

"""Events, other than parameter changes, that change the computed torque from a tick on."""

from __future__ import annotations

ACTIVATED = 'activated'
"""The controller restarts as at the start of a run; with an approach if it was inactive."""

RESUMED = 'resumed'
"""The controller continues with the estimates from before its deactivation."""

DEACTIVATED = 'deactivated'
"""The law is not computed; the safe stop commands, as `fault_action` says."""

GUIDED = 'hand guiding'
"""The law is not computed; gravity is compensated, and a hand moves the arm."""

UNFOLDED = 'leaving a singular posture'
"""Before an activation: the joints move to a posture in which the law can start."""

ADAPTATION_RESET = 'adaptation reset'
"""The adaptation is reset; the last command persists."""

EVENTS = (ACTIVATED, RESUMED, DEACTIVATED, GUIDED, UNFOLDED, ADAPTATION_RESET)
