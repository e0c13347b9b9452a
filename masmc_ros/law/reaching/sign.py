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

"""The paper's switching term, sw(s) = sgn s. Sampled, it chatters."""

from __future__ import annotations

from typing import Any

from masmc_ros.law.reaching.reaching import force_of, Reaching, register
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.tuples import each


@formula
def sign(s: float) -> float:
    """Return -1, 0 or 1."""
    return 1.0 if s > 0.0 else (-1.0 if s < 0.0 else s)


@formula
def reach(settings: Any, tick: Tick, memory: Any, lane: int) -> tuple[float, ...]:
    """Return the reaching force."""
    return force_of(settings, tick, lane, each(sign, tick.surface))


SIGN = register(Reaching('sign', reach))
