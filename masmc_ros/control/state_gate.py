# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Received states of the robot: their order, repetition and lateness, and their timeout."""

from __future__ import annotations

from dataclasses import dataclass
import math

from masmc_ros.aliases import Array
from masmc_ros.control.state_lateness import StateLateness
from masmc_ros.messages.stamp_order import Order, StampOrder
import numpy as np

SECOND_LOOK = 0.01
"""Time in s after which a missing state is confirmed; this process may have been late."""


@dataclass(slots=True)
class Counts:
    """
    Numbers of states that arrived out of order, and of periods without a computation.

    Attributes
    ----------
    late, repeated, gaps
        States older than the last one, states with its stamp, and gaps between states.
    skipped
        Control periods without a new torque, during which the previous one was held.

    """

    late: int = 0
    repeated: int = 0
    gaps: int = 0
    skipped: int = 0


class StateGate:
    """
    States in the order of their arrival, and the last one that has no response.

    Attributes
    ----------
    counts
        Irregular states and ticks.
    arrival
        Time in s at which the last state arrived, infinite before the first one.
    order
        Order of the stamps.
    lateness
        Age of the states compared with their mean.
    pending, pending_order
        Stamp in ns of a state that waits for its response, None without one, and its order.
    position, velocity
        Pending state, in real time the last state (positions).
    has_plant
        True if the robot is a simulated plant, which repeats its state while it pauses.
    was_mixed
        True if states came from two robots since the last usable one.
    timeout
        Time in s without a state after which it is missing.
    void_due
        Time in s at which the gravity torque of a last state ends.

    """

    def __init__(self, positions: int) -> None:
        """Initialise without a state, for a number of positions."""
        self.counts = Counts()
        self.arrival = self.timeout = self.void_due = math.inf
        self.order, self.lateness = StampOrder(), StateLateness()
        self.pending: int | None = None
        self.pending_order = Order.NEXT
        self.position, self.velocity = np.zeros(positions), np.zeros(positions)
        self.has_plant = self.was_mixed = False
        # After a late state, a repetition of the last one does not prove that the robot runs.
        self._is_confused = False
        # Start of the state timeout: the last arrival or activation.
        self._watched = math.inf
        # Time of the second look; infinite while no state is missing.
        self._second_look = math.inf

    @property
    def stamp(self) -> int | None:
        """Return the stamp in ns of the pending state, or of the last one."""
        return self.order.last if self.pending is None else self.pending

    def judge(self, stamp: int) -> Order:
        """Return the order of a state with a stamp in ns, and count a late one."""
        order = self.order.judge(stamp)
        if order is Order.NEXT:
            self._is_confused = False
        elif order is Order.LATE and not self.was_mixed:
            self.counts.late += 1
            self._is_confused = True
        elif order is not Order.REPEATED:
            self._is_confused = False
            if order is Order.LATE:
                # The later stamps may be those of the other robot.
                return self.order.set_back(stamp)
        return order

    def is_alive_when_repeated(self, *, is_timed: bool) -> bool:
        """
        Return True if a repeated state shows that the robot is alive.

        A paused plant repeats its state. A robot driver that repeats it has stopped measuring.
        """
        return not self._is_confused and (self.has_plant or not is_timed)

    def note_arrival(self, now: float) -> None:
        """Note that a state of a living robot arrived at the time `now` in s."""
        self.arrival = self._watched = now
        self._second_look = math.inf

    def note_activation(self, now: float) -> None:
        """Restart the timeout at the time `now` in s, if a state has arrived before."""
        if self._watched < math.inf:
            self._watched, self._second_look = now, math.inf

    def keep(self, position: Array, velocity: Array) -> None:
        """Copy a state (positions, positions)."""
        self.position[:], self.velocity[:] = position, velocity

    def drop_mixed(self) -> None:
        """Drop a pending state, because states come from two robots."""
        self._second_look, self.pending, self.was_mixed = math.inf, None, True

    def deadline(self, *, is_watched: bool) -> float:
        """Return the time in s of the next event; `is_watched`: a missing state is one."""
        if not is_watched:
            return self.void_due
        if self._second_look < math.inf:
            return min(self._second_look, self.void_due)
        return min(self._watched + self.timeout, self.void_due)

    def confirms_missing(self, now: float) -> bool:
        """
        Return True if a missing state is confirmed at a second look, the time `now` in s.

        A controller that was late itself first processes the states in its queue.
        """
        is_confirmed = self._second_look < math.inf
        self._second_look = math.inf if is_confirmed else now + SECOND_LOOK
        return is_confirmed
