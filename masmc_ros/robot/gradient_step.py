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
Adaptation of parameters that are free numbers: down their gradient.

Formulas of the contract, for mechanisms that know nothing better of their parameters.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.record import get
from masmc_ros.numerics.tuples import each
from masmc_ros.robot.mechanism import Numbers


@formula
def gradient_step(estimate: float, gradient: float, gamma: float, period: float) -> float:
    """Return one parameter after an explicit step of (23); `gamma` its entry of Gamma."""
    return estimate - period * gradient / gamma


@formula
def theta_step(
    model: Any, settings: Any, lane: int, theta: Numbers, gradient: Numbers, period: float
) -> Numbers:
    """Return theta - T Gamma^-1 g."""
    return each(gradient_step, theta, gradient, get(settings, 'gamma', lane), period)


@formula
def keeps_bodies(model: Any, settings: Any, lane: int) -> bool:
    """Return False: numbers that are free may be those of no body."""
    return False
