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

"""A line with a sine on it, per task axis: the paper's path, and circles and eights as well."""

from __future__ import annotations

from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.portable_math import sin_cos


@formula
def line_sine(
    time: float, offset: float, slope: float, amplitude: float, frequency: float, phase: float
) -> tuple[float, float, float]:
    """
    Return position, velocity and acceleration of one task axis in m, m/s and m/s2.

    x_d(t) = offset + slope t + amplitude sin(frequency t + phase); time in s, frequency in
    rad/s, phase in rad.
    """
    s, c = sin_cos(frequency * time + phase)
    swing = amplitude * s
    speed = frequency * amplitude
    return (
        offset + slope * time + swing,
        slope + speed * c,
        -frequency * frequency * swing,
    )
