# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Received states and references of the controller: order, repetition, lateness and timeouts.

`StateSources` detects usable states from two robots, `StateLateness` the age of each state
compared with the mean. A `Pacing` contains the differences between lock-step and real time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import Protocol

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError, UserError
from masmc_ros.law.parts.delay_fields import LATENCY, LONGEST
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_parameters import REFERENCE_TIMEOUT
from masmc_ros.loop.fault_rules import is_overdue
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.stamps import Order, StampOrder, state_timeout
from masmc_ros.params.declaration import Values
from masmc_ros.reference.windows import ReferenceWindows
from masmc_ros.robot.robot import Robot
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


_MEMORY = 1000
"""Number of states after which the weight of a state in the mean has fallen to 1/e."""


class StateLateness:
    """
    Difference of the age of each state to the mean age.

    A constant difference between the clocks of sender and receiver has no effect.
    """

    def __init__(self) -> None:
        """Initialise without a state."""
        self._origin, self._mean, self._count = 0, 0.0, 0

    def restart(self) -> None:
        """Restart the mean, because the clock of the stamps may have been set."""
        self._count = 0

    def add(self, stamp: int, now: float) -> float:
        """Return by how much a state (stamp in ns) is later than usual at a time, both in s."""
        difference = round(1e9 * now) - stamp
        if self._count == 0:
            self._origin, self._mean = difference, 0.0
        self._count = min(self._count + 1, _MEMORY)
        age = 1e-9 * (difference - self._origin)
        self._mean += (age - self._mean) / self._count
        return age - self._mean


def outdated_latency(controller: Controller, age: float) -> str:
    """
    Return a warning if states are older than `latency`, '' otherwise.

    Parameters
    ----------
    controller
        Controller with its parameters.
    age
        Mean age of the states in s when their commands are sent, by their stamps. The age
        is a part of the latency, so it is a lower bound. A negative age shows that the sender has
        another clock.

    """
    latency, total = LATENCY.of(controller.values), age + controller.stamp_age
    if controller.commands_rates or not latency + controller.period < total < LONGEST:
        return ''
    return (
        f'latency = {latency:g}: the states are {1e3 * total:.1f} ms old when they are answered; '
        f'expected at least {total:.4f}, and the delay of the drives in addition'
    )


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


class ReferenceGate:
    """
    Reference within the reach of a robot, and the time since its end.

    Attributes
    ----------
    windows
        Received samples.

    """

    def __init__(self, robot: Robot, on_notice: Callable[[str], object]) -> None:
        """Initialise without a reference; `on_notice` receives a text if a source is replaced."""
        self._robot = robot
        self.windows = ReferenceWindows(len(robot.mechanism.axes), on_notice)
        self._held_since: float | None = None

    def add(self, window: ReferenceWindow, stamp: int | None) -> None:
        """
        Add a window of samples, or a set-point; `stamp` in ns is that of the last state.

        Raises
        ------
        InputError
            If it is not finite, has a wrong size or is out of reach, or if it is a set-point
            while a trajectory runs.

        """
        samples = window.samples.reshape(len(window.samples), -1)
        self._check_reach(samples)
        if window.stamp_ns is None:
            self.windows.set_point(samples[0], stamp)
        else:
            self.windows.add(window.stamp_ns, window.period, samples)

    def at(self, stamp: int) -> Array | None:
        """Return the sample (3 axes) at a stamp in ns; None without one."""
        reference = self.windows.at(stamp)
        if reference is not None:
            self._held_since = None
        return reference

    def held_after(self, stamp: int, now: float) -> Array | None:
        """Return the last position (3 axes) before a stamp in ns; its end is `now` at first."""
        reference = self.windows.held_after(stamp)
        if reference is not None and self._held_since is None:
            self._held_since = now
        return reference

    def restart_timeout(self) -> None:
        """Let the timeout of a reference that has ended start with the next activation."""
        self._held_since = None

    def is_overdue(self, now: float, timeout: float) -> bool:
        """Return True if the last position is held for more than a timeout, both in s."""
        return self._held_since is not None and is_overdue(now, self._held_since, timeout)

    def _check_reach(self, samples: Array) -> None:
        """Raise InputError for a position that the mechanism cannot reach."""
        mechanism, axes = self._robot.mechanism, len(self._robot.mechanism.axes)
        if samples.shape[1] < axes or not np.isfinite(samples).all():
            return
        unreachable = mechanism.formulas.out_of_reach(
            self._robot.geometry, np.ascontiguousarray(samples[:, :axes])
        )
        if unreachable is not None:
            sample, reason = unreachable
            raise InputError(f'reference: sample {sample} cannot be reached: {reason}')


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
