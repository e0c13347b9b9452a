# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Motion of minimum jerk along a curve, from rest to rest, with holds at its ends."""

from __future__ import annotations

from masmc_ros.jit.compiled import formula
from masmc_ros.numerics.hermite import quintic, Sample
from masmc_ros.params.declaration import Parameter


def duration_parameters(kind: str) -> tuple[Parameter, Parameter]:
    """Return the parameters `delay` and `duration` of a type of trajectory."""
    return (
        Parameter(f'{kind}.delay', 0.0, 'Time at which the motion starts', unit='s', minimum=0.0),
        Parameter(
            f'{kind}.duration', 10.0, 'Duration of the motion',
            unit='s', minimum=0.0, exclusive_minimum=True,
        ),
    )  # fmt: skip


@formula
def rest_to_rest(total: float, delay: float, duration: float, time: float) -> Sample:
    """
    Return the way along a curve, and its two derivatives, at a time in s.

    The way starts at 0 after `delay` s and is `total` from `duration` s later on. Its unit is
    that of the curve's parameter.
    """
    part = max((time - delay) / duration, 0.0)
    way, speed, change = total, 0.0, 0.0
    if part < 1.0:
        way, speed, change = quintic((0.0, 0.0, 0.0), (total, 0.0, 0.0), duration, part)
    return way, speed, change
