# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Differences between lock-step and real time in the controller, as functions without state."""

from __future__ import annotations

import math
from typing import Protocol

from masmc_ros.errors import UserError
from masmc_ros.loop.controller_parameters import REFERENCE_TIMEOUT
from masmc_ros.messages.stamp_order import Order, state_timeout
from masmc_ros.params.declaration import Values


class Pacing(Protocol):
    """
    Policy for late and missing messages.

    Attributes
    ----------
    name
        Value of the parameter `pacing`.
    is_timed
        True if robot and reference move on without a command. An inactive controller then acts
        at once, skipped ticks count, each start and a reference that steps are approached, and a
        run-away is detected.

    """

    name: str
    is_timed: bool

    def gap_ns(self, values: Values) -> int | None:
        """Return the longest ordinary interval in ns between two states; None: no limit."""

    def state_timeout(self, values: Values) -> float:
        """Return the time in s without a state after which a fault is raised."""

    def reference_timeout(self, values: Values) -> float:
        """Return the time in s after the end of the reference until a fault is raised."""

    def is_near(self, order: Order) -> bool:
        """Return True if a state with this order of its stamp may end the run."""

    def holds(self, stamp: int, pending: int | None, computed: int | None) -> bool:
        """Return True if the last position is held at a stamp that no reference covers."""

    def ends_with(self, error: Exception) -> bool:
        """Return True if an error of the law ends a run of limited duration."""


class LockStep:
    """The plant waits for each command, and the controller for the reference."""

    name = 'lockstep'
    is_timed = False

    def gap_ns(self, values: Values) -> int | None:
        """Return None: no state is missing."""
        return None

    def state_timeout(self, values: Values) -> float:
        """Return infinity: a plant that waits for a command sends no state."""
        return math.inf

    def reference_timeout(self, values: Values) -> float:
        """Return infinity: the reference will arrive."""
        return math.inf

    def is_near(self, order: Order) -> bool:
        """Return False: every state arrives, the last one too."""
        return False

    def holds(self, stamp: int, pending: int | None, computed: int | None) -> bool:
        """Return True for a newer state while one is pending: this plant does not wait."""
        return computed is not None and pending is not None and pending != stamp

    def ends_with(self, error: Exception) -> bool:
        """Return True, so a UserError of the law ends the run; raise any other error."""
        if not isinstance(error, UserError):
            raise error
        return True


class RealTime:
    """States arrive in their own time; a state that is missing for too long is a fault."""

    name = 'realtime'
    is_timed = True

    def gap_ns(self, values: Values) -> int | None:
        """Return `state_timeout`."""
        return round(1e9 * state_timeout(values))

    def state_timeout(self, values: Values) -> float:
        """Return `state_timeout`."""
        return state_timeout(values)

    def reference_timeout(self, values: Values) -> float:
        """Return `reference_timeout`; infinity if that is 0."""
        return REFERENCE_TIMEOUT.of(values) or math.inf

    def is_near(self, order: Order) -> bool:
        """Return False for a single stamp far ahead, which may be wrong."""
        return order is not Order.AHEAD

    def holds(self, stamp: int, pending: int | None, computed: int | None) -> bool:
        """Return True."""
        return True

    def ends_with(self, error: Exception) -> bool:
        """Return False: the robot moves on, and the error is a fault."""
        return False


PACINGS: dict[str, Pacing] = {pacing.name: pacing for pacing in (LockStep(), RealTime())}
