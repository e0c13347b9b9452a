# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Detection of usable states from two robots, by their positions."""

from __future__ import annotations

from masmc_ros.aliases import Array
import numpy as np

_STEP = 0.02
"""Change of a position in rad or m between two states, beyond its velocity, that is a jump."""

_SPEEDS = 3.0
"""Multiple of the velocities in both states that a position may change at."""

_LONGEST = 0.2
"""Longest time in s between two states whose change is explained by velocities."""

_WINDOW = 1.0
"""Time in s in which two jumps show two sources: one jump is a restart or a localisation."""

_QUIET = 3.0
"""Time in s without a jump after which one source remains."""


class StateSources:
    """
    Comparison of successive states while more than one node publishes them.

    The graph alone is no evidence. A killed node stays listed for up to 20 s, and the driver of
    a gripper publishes joints that no usable state consists of. States of two robots alternate:
    their positions jump there and back.

    Attributes
    ----------
    are_mixed
        True while the states come from two robots.

    """

    def __init__(self, positions: int) -> None:
        """Initialise for states with a number of positions."""
        self.are_mixed = False
        self._position, self._velocity = np.zeros((2, positions))
        self._stamp: int | None = None
        self._jump = -np.inf

    def restart(self) -> None:
        """Forget all states: one node publishes them."""
        self.are_mixed, self._stamp, self._jump = False, None, -np.inf

    def add(self, stamp: int, position: Array, velocity: Array, now: float) -> None:
        """Compare a usable state (stamp in ns) that arrived at `now` in s with the previous."""
        if self._stamp is not None:
            time = min(1e-9 * abs(stamp - self._stamp), _LONGEST)
            speed = np.maximum(np.abs(velocity), np.abs(self._velocity))
            allowed = _STEP + _SPEEDS * time * speed
            if (np.abs(position - self._position) > allowed).any():
                self.are_mixed |= now - self._jump <= _WINDOW
                self._jump = now
        self._stamp = stamp
        self._position[:], self._velocity[:] = position, velocity
        self.are_mixed &= now - self._jump <= _QUIET
