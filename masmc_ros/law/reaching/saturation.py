# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Switching term linear in a boundary layer: sw(s) = s / delta, limited to [-1, 1]."""

from __future__ import annotations

from masmc_ros.aliases import Axes
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.reaching.reaching import BOUNDARY_LAYER, force_of, GAINS, Reaching
from masmc_ros.law.tick import Tick


@formula
def saturation(s: float, delta: float) -> float:
    """Return s / delta, limited to [-1, 1]; both in m/s."""
    ratio = s / delta
    return 1.0 if ratio > 1.0 else (-1.0 if ratio < -1.0 else ratio)


@formula
def reach(settings: Settings, tick: Tick, memory: Memory) -> Axes:
    """Return the reaching force."""
    delta = settings.boundary_layer
    return force_of(settings, tick, elementwise(saturation, tick.surface, delta))


SATURATION = Reaching('saturation', reach, parameters=(*GAINS, BOUNDARY_LAYER))
