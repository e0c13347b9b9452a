# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Actions of the controller's core, from their cause to the response that contains them."""

from __future__ import annotations

import math

from masmc_ros.control.actions import (
    Action,
    Actions,
    Command,
    Finish,
    Line,
    NOTHING,
    Record,
    State,
    StopCommand,
    Telemetry,
    Throttle,
    Void,
    Wait,
)
from masmc_ros.control.gates import Pacing
from masmc_ros.control.supervisor import state_of, Supervisor
from masmc_ros.loop.controller_parameters import TELEMETRY_DECIMATION
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.stamps import Order
from masmc_ros.params.declaration import MutableValues, Values

_QUIET = 1.0
"""Time in s between two lines about missing states, or about jumps of the pose."""


class Outbox:
    """
    Queue of actions and records, and the responses to states.

    A record waits for the response to the first state that was computed with it.

    Attributes
    ----------
    command, stop_command, void
        Responses of law and safe stop, created once and reused.
    throttle
        Time between two lines about the same topic.
    was_active
        True if the last published state of the controller was active.

    """

    def __init__(self, timing: Timing, values: Values) -> None:
        """Initialise an empty queue with the grid of the run and the controller's parameters."""
        self.command, self.stop_command, self.void = Command(), StopCommand(), Void()
        self.throttle = Throttle(_QUIET)
        self.was_active = False
        self._telemetry = Telemetry()
        self._decimation = TELEMETRY_DECIMATION.of(values)
        self._period_ns = 1e9 * timing.period
        self._last_tick = math.inf if timing.last is None else timing.last
        self._last_stamp = -1 if timing.last is None else timing.stamp(timing.last)
        self._actions: list[Action] = []
        self._records: list[tuple[MutableValues, tuple[str, ...], str]] = []
        self._state = ''
        self._is_waiting = True

    @property
    def is_endless(self) -> bool:
        """Return True for a run without a last tick."""
        return self._last_tick == math.inf

    def add(self, action: Action) -> None:
        """Queue an action."""
        self._actions.append(action)

    def add_line(self, level: str, text: str) -> None:
        """Queue a line of the log."""
        self._actions.append(Line(level, text))

    def add_wait(self, reason: str) -> None:
        """Queue the reason of a wait, which the next response ends."""
        self._is_waiting = True
        self._actions.append(Wait(reason))

    def add_record(
        self, values: Values, event: str = '', changed: tuple[str, ...] = ()
    ) -> None:
        """Queue a record of the current values, with an event or the names of changed ones."""
        self._records.append((dict(values), changed, event))

    def add_state(self, supervisor: Supervisor) -> None:
        """Queue the state of the controller if it differs from the published one."""
        text = supervisor.text
        if text != self._state:
            level = 'error' if supervisor.is_fault else 'info' if self._state else ''
            self._state, self.was_active = text, supervisor.is_active
            self._actions.append(State(text, level, state_of(supervisor)))

    def take(self) -> Actions:
        """Return the queued actions; the queue is empty then."""
        actions = tuple(self._actions)
        self._actions.clear()
        return actions

    def respond(self, answer: Command, stamp: int, order: Order, pacing: Pacing) -> Actions:
        """
        Return the response to a state.

        Parameters
        ----------
        answer
            `command`, `stop_command` or `void`.
        stamp
            Stamp of the state in ns.
        order
            Order of this stamp.
        pacing
            Lock-step or real time.

        """
        answer.stamp = stamp
        actions: Actions = (answer,)
        tick = round(stamp / self._period_ns)
        if answer is self.command and self._decimation and not tick % self._decimation:
            self._telemetry.stamp = stamp
            actions = (answer, self._telemetry)
        if self._is_waiting:
            self._is_waiting = False
            self._actions.append(Wait(None))
        if not (self._actions or self._records or tick >= self._last_tick):
            return actions
        records = [Record(tick, stamp, *record) for record in self._records]
        self._records.clear()
        # The final state may arrive far ahead of the previous one if this process was late at
        # the end of the run. No later state confirms it.
        is_last = tick >= self._last_tick and (
            stamp == self._last_stamp or pacing.is_near(order)
        )
        end = (Finish(),) if is_last else NOTHING
        return (*self.take(), *actions, *records, *end)
