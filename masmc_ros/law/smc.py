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

"""Robust sliding mode control (15): tau = Y theta_hat + J' u, the estimate stays as it is."""

from __future__ import annotations

from typing import Any

from masmc_ros.law.law import Law, register
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.model import ESTIMATE, model_torque
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.reaching.reaching import correct, GAINS, reach
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.record import get

Numbers = tuple[float, ...]


@formula
def torque(settings: Any, tick: Tick, memory: Any, lane: int) -> Numbers:
    """Return the joints' torques in N m."""
    u = reach(settings, tick, memory, lane)
    return model_torque(tick, get(memory, 'estimate', lane), u)


SMC = register(
    Law(
        'smc',
        torque,
        (*GAINS, SIGMA),
        (ESTIMATE,),
        correct,
        project,
        summary='sliding mode control with the nominal model',
        source='(15) of the paper',
    )
)
