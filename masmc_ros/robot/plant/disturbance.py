# SPDX-License-Identifier: Apache-2.0
"""External disturbance torques on the reduced coordinates, continuous in time."""

from __future__ import annotations

from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.portable_math import sin


@formula
def sinusoid(time: float, amplitude: float, frequency: float, phase: float) -> float:
    """Return amplitude sin(frequency t + phase) in N m: time in s, rad/s, rad."""
    return amplitude * sin(frequency * time + phase)
