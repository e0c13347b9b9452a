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

"""A gain that grows with what is left of an error, and leaks."""

from __future__ import annotations

from masmc_ros.numerics.compiled import formula


@formula
def grown(
    gain: float, s: float, rate: float, dead_zone: float, leak: float, period: float
) -> float:
    """
    Return a gain after a period of k' = rate (|s| - dead zone)+ - leak k; leak in 1/s.

    Explicit in the growth and implicit in the leak, which no rate can make unstable.
    """
    beyond = abs(s) - dead_zone
    beyond = beyond if beyond > 0.0 else 0.0
    return (gain + period * rate * beyond) / (1.0 + period * leak)
