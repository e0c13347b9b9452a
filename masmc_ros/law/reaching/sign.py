# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Switching term of the paper, sw(s) = sgn s, which chatters in discrete time."""

from __future__ import annotations

from masmc_ros.aliases import Axes
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.reaching.reaching import force_of, Reaching
from masmc_ros.law.tick import Tick


@formula
def sign(s: float) -> float:
    """Return -1, 0 or 1."""
    return 1.0 if s > 0.0 else (-1.0 if s < 0.0 else s)


@formula
def reach(settings: Settings, tick: Tick, memory: Memory) -> Axes:
    """Return the reaching force."""
    return force_of(settings, tick, elementwise(sign, tick.surface))


SIGN = Reaching('sign', reach)
