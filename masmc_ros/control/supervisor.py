# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Mode of the controller: inactive, active, or in a fault with a reason; its lifecycle for ROS 2.

The states and transitions of the lifecycle are those of a managed node, with the numbers and
labels of lifecycle_msgs. The mode determines the state, so services and faults change it as well.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from masmc_ros.loop.fault_rules import recovers, takes_fault


class Mode(Enum):
    """State of the controller; the value is its text on `controller/state`."""

    NOT_ENABLED = 'inactive: not enabled yet'
    DISABLED = 'inactive: disabled'
    GUIDED = 'inactive: hand guiding'
    CLEARED = 'inactive: a fault was cleared'
    UNCONFIGURED = 'inactive: not configured'
    SHUT_DOWN = 'inactive: shut down'
    ACTIVE = 'active'
    FAULT = 'fault'
    """The reason follows in the text."""


class Cause(Enum):
    """Cause of a fault."""

    STATES = 'states'
    REFERENCE = 'no reference'
    """The value is the start of the reason, by which other nodes recognise this fault."""
    LAW = 'law'
    RUNAWAY = 'run-away'
    STOP = 'emergency stop'


_WITHOUT_REFERENCE = f'{Mode.FAULT.value}: {Cause.REFERENCE.value}'


def would_follow(text: str) -> bool:
    """
    Return True if a controller with this text on `controller/state` follows a new reference.

    A controller in the fault of a missing reference becomes active when one arrives.
    """
    return text == Mode.ACTIVE.value or text.startswith(_WITHOUT_REFERENCE)


class Supervisor:
    """
    Mode of the controller, changed by its services and by faults.

    The law is computed in `active` only. A passing fault ends with its cause, a latched one when
    it is cleared or the controller is enabled. After an activation the law restarts. Without a
    configuration, only `configure` and `shut_down` have an effect; after `shut_down` nothing has.

    Attributes
    ----------
    mode
        State of the controller.
    is_active
        True if the law is computed.
    reason
        Reason of a fault in one line, for display only; empty without one.
    cause
        Cause of the fault; None without one.
    is_latched
        True if the fault stays until it is cleared.
    activations
        Number of activations.

    """

    def __init__(self, *, active: bool) -> None:
        """Initialise as active, or as inactive until it is enabled."""
        self.activations = 0
        self._enter(Mode.NOT_ENABLED)
        if active:
            self.enable()

    @property
    def text(self) -> str:
        """Return the state and, if it is not active, the reason: `fault: emergency stop`."""
        return f'{self.mode.value}: {self.reason}' if self.reason else self.mode.value

    @property
    def is_fault(self) -> bool:
        """Return True in a fault."""
        return self.mode is Mode.FAULT

    def enable(self) -> None:
        """Change to active from any configured state; clear every fault."""
        if not self.is_active and self.is_configured:
            self._enter(Mode.ACTIVE)
            self.activations += 1

    def disable(self) -> None:
        """Change to inactive from any configured state; clear every fault."""
        if self.is_configured:
            self._enter(Mode.DISABLED)

    def configure(self) -> None:
        """Change from unconfigured to inactive."""
        if not (self.is_configured or self.is_shut_down):
            self._enter(Mode.NOT_ENABLED)

    def clean_up(self) -> None:
        """Change to unconfigured from any configured state; clear every fault."""
        if self.is_configured:
            self._enter(Mode.UNCONFIGURED)

    def shut_down(self) -> None:
        """Change to the final state, which no event ends."""
        self._enter(Mode.SHUT_DOWN)

    @property
    def is_configured(self) -> bool:
        """Return False if neither activation nor fault is possible."""
        return self.mode not in (Mode.UNCONFIGURED, Mode.SHUT_DOWN)

    @property
    def is_shut_down(self) -> bool:
        """Return True in the final state."""
        return self.mode is Mode.SHUT_DOWN

    def guide(self) -> None:
        """Change to hand guiding; the caller has checked that this is possible."""
        self._enter(Mode.GUIDED)

    @property
    def is_guided(self) -> bool:
        """Return True if the arm is guided by hand."""
        return self.mode is Mode.GUIDED

    def stop(self) -> None:
        """Change to the latched fault of an emergency stop, from any configured state."""
        self.fail(Cause.STOP, Cause.STOP.value, is_latched=True)

    def clear(self) -> bool:
        """Change from a fault to inactive; return False if there is no fault."""
        if not self.is_fault:
            return False
        self._enter(Mode.CLEARED)
        return True

    def fail(self, cause: Cause, reason: str, *, is_latched: bool = False) -> bool:
        """
        Change to a fault if it has an effect in the present state; return True then.

        Only an active controller has a passing fault. A latched fault takes effect in all
        configured states except another latched fault, whose reason stays.

        Parameters
        ----------
        cause
            Cause of the fault.
        reason
            Reason in one line.
        is_latched
            True if the fault stays until it is cleared.

        """
        is_latched_fault = self.is_fault and self.is_latched
        has_effect = self.is_configured and takes_fault(
            self.is_active, is_latched_fault, is_latched
        )
        if has_effect:
            self._enter(Mode.FAULT, reason, cause, is_latched=is_latched)
        return has_effect

    def recover(self, cause: Cause, *, is_restart: bool) -> bool:
        """
        Change to active after a passing fault of this cause; return True then.

        `is_restart`: True for an activation, False to continue after the interruption.
        """
        if not recovers(self.is_fault, self.is_latched, self.cause is cause):
            return False
        self._enter(Mode.ACTIVE)
        self.activations += is_restart
        return True

    def _enter(
        self,
        mode: Mode,
        reason: str = '',
        cause: Cause | None = None,
        *,
        is_latched: bool = False,
    ) -> None:
        self.mode, self.reason, self.cause, self.is_latched = mode, reason, cause, is_latched
        self.is_active = mode is Mode.ACTIVE


class LifecycleState(NamedTuple):
    """Primary state of a managed node, with its number and label in lifecycle_msgs."""

    number: int
    label: str


UNCONFIGURED = LifecycleState(1, 'unconfigured')
INACTIVE = LifecycleState(2, 'inactive')
ACTIVE = LifecycleState(3, 'active')
FINALIZED = LifecycleState(4, 'finalized')
STATES = (UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED)


class Transition(NamedTuple):
    """Transition between two states, with its number and label in lifecycle_msgs."""

    number: int
    label: str
    start: LifecycleState
    goal: LifecycleState


TRANSITIONS = (
    Transition(1, 'configure', UNCONFIGURED, INACTIVE),
    # The controller starts configured. Lifecycle managers configure every node first.
    Transition(1, 'configure', INACTIVE, INACTIVE),
    Transition(2, 'cleanup', INACTIVE, UNCONFIGURED),
    Transition(3, 'activate', INACTIVE, ACTIVE),
    Transition(4, 'deactivate', ACTIVE, INACTIVE),
    Transition(5, 'shutdown', UNCONFIGURED, FINALIZED),
    Transition(6, 'shutdown', INACTIVE, FINALIZED),
    Transition(7, 'shutdown', ACTIVE, FINALIZED),
)


def state_of(supervisor: Supervisor) -> LifecycleState:
    """
    Return the lifecycle state of a mode.

    A passing fault is `active`: it ends without a request, and `deactivate` must prevent that.
    """
    if supervisor.is_shut_down:
        return FINALIZED
    if not supervisor.is_configured:
        return UNCONFIGURED
    is_passing = supervisor.is_fault and not supervisor.is_latched
    return ACTIVE if supervisor.is_active or is_passing else INACTIVE


def transitions_from(state: LifecycleState) -> tuple[Transition, ...]:
    """Return the transitions that are available in a state."""
    return tuple(transition for transition in TRANSITIONS if transition.start == state)


def find_transition(state: LifecycleState, number: int, label: str) -> Transition | None:
    """
    Return a transition that is available in a state; None if there is no such transition.

    A label takes precedence over the number, which is 0 in requests with a label only.
    """
    for transition in transitions_from(state):
        if transition.label == label if label else transition.number == number:
            return transition
    return None
