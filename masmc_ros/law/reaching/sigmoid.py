# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Smooth switching term sw(s) = s / (|s| + delta)."""

from __future__ import annotations

from masmc_ros.aliases import Axes
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.reaching.reaching import BOUNDARY_LAYER, force_of, GAINS, Reaching
from masmc_ros.law.tick import Tick


@formula
def sigmoid(s: float, delta: float) -> float:
    """Return s / (|s| + delta); both in m/s."""
    return s / (abs(s) + delta)


@formula
def reach(settings: Settings, tick: Tick, memory: Memory) -> Axes:
    """Return the reaching force."""
    delta = settings.boundary_layer
    return force_of(settings, tick, elementwise(sigmoid, tick.surface, delta))


SIGMOID = Reaching('sigmoid', reach, parameters=(*GAINS, BOUNDARY_LAYER))
