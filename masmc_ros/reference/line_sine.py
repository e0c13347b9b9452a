# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Line plus sine on each task axis: the path of the paper, and also circles and eights."""

from __future__ import annotations

from masmc_ros.jit.compiled import formula
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
