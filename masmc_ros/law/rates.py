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
The kinematic law of commanded rates, for drives that have a velocity loop of their own.

Drives that follow v_r let the error decay as on the sliding surface, edot = -sigma e. The
command v_r + T a_r / 2 is held for a period, whose middle its second term looks ahead to.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.law.law import Law, register
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.model import ESTIMATE
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.record import get, put
from masmc_ros.numerics.scalars import zero
from masmc_ros.numerics.tuples import each
from masmc_ros.robot import mechanism

Numbers = tuple[float, ...]


@formula
def _ahead(velocity: float, acceleration: float, time: float) -> float:
    """Return a velocity so much later."""
    return velocity + time * acceleration


@formula
def torque(settings: Any, tick: Tick, memory: Any, lane: int) -> Numbers:
    """Return no torque; write the command as the drives take it to the memory."""
    v = each(_ahead, tick.reference_velocity, tick.reference_acceleration, 0.5 * tick.period)
    put(memory, 'velocity_command', lane, mechanism.rate_command(tick.model, v))
    return each(zero, get(memory, 'commanded', lane))


RATES = register(Law('rates', torque, (SIGMA,), (ESTIMATE,), settle=project, uses_switching=False))
