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
How the joints accelerate under torques, by the mechanism's other formulas.

A formula of the contract, for mechanisms that know no shorter way.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.scalars import minus
from masmc_ros.numerics.tuples import each
from masmc_ros.robot import mechanism
from masmc_ros.robot.mechanism import Numbers


@formula
def joint_accelerations(
    model: Any, posture: Any, theta: Numbers, rates: Numbers, torques: Numbers
) -> Numbers:
    """Return those of H^-1 (f - V v - g)."""
    bias = mechanism.coriolis(model, posture, theta, mechanism.motion(model, rates))
    force = each(minus, mechanism.forces(model, torques), bias)
    h = mechanism.inertia(model, posture, theta)
    return mechanism.joint_rates(model, mechanism.inertia_solve(model, h, force))
