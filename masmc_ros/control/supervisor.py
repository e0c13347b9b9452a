# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Whether the controller may move the robot: inactive, active, or in a fault with a reason."""

from __future__ import annotations

INACTIVE = 'inactive'
ACTIVE = 'active'
FAULT = 'fault'

_GUIDED = 'hand guiding'

NO_REFERENCE = 'no reference'
"""Start of the reason of a fault because the reference ended."""


def would_follow(text: str) -> bool:
    """
    Return True if a controller in the state of this text follows its reference.

    One in the fault that a reference ends does: it becomes active by one alone.
    """
    return text == ACTIVE or text.startswith(f'{FAULT}: {NO_REFERENCE}')


class Supervisor:
    """
    Mode of the controller, changed by its services and by faults.

    The law is computed in `active` only. A passing fault ends with its cause, a latched one when
    it is cleared or the controller is enabled. After an activation the law restarts.

    Attributes
    ----------
    state
        `inactive`, `active` or `fault`.
    is_active
        True if the law is computed.
    is_guided
        True if the arm is guided by hand, which is a kind of `inactive`.
    reason
        Reason of an inactive state or a fault, in one line; empty if active.
    cause
        Kind of the fault, empty without one.
    is_latched
        True if the fault stays until it is cleared.
    activations
        Number of activations.

    """

    def __init__(self, *, active: bool) -> None:
        """Initialise as active, or as inactive until it is enabled."""
        self.activations = 0
        self._enter(INACTIVE, 'not enabled yet')
        if active:
            self.enable()

    @property
    def text(self) -> str:
        """Return the state and, where it is not active, the reason: `fault: emergency stop`."""
        return f'{self.state}: {self.reason}' if self.reason else self.state

    def enable(self) -> None:
        """Become active from any state; every fault is cleared."""
        if self.state != ACTIVE:
            self._enter(ACTIVE)
            self.activations += 1

    def disable(self) -> None:
        """Become inactive from any state; a fault is forgotten."""
        self._enter(INACTIVE, 'disabled')

    def guide(self) -> None:
        """Let a hand guide the arm; the caller has checked that there is no fault."""
        self._enter(INACTIVE, _GUIDED)

    @property
    def is_guided(self) -> bool:
        """Return True if the arm is guided by hand."""
        return self.state == INACTIVE and self.reason == _GUIDED

    def stop(self) -> None:
        """Stop at once, from any state, until it is enabled or the fault is cleared."""
        self.fail('emergency stop', 'emergency stop', is_latched=True)

    def clear(self) -> bool:
        """Leave a fault for `inactive`; False where there is none."""
        if self.state != FAULT:
            return False
        self._enter(INACTIVE, 'a fault was cleared')
        return True

    def fail(self, cause: str, reason: str, *, is_latched: bool = False) -> bool:
        """
        Note a fault; return True if the state changes.

        A passing fault counts only where the controller is active; a latched one counts
        in all states except another latched fault, whose reason stays.
        """
        counts = (self.state != FAULT or not self.is_latched) if is_latched else self.is_active
        if counts:
            self._enter(FAULT, reason, cause, is_latched=is_latched)
        return counts

    def recover(self, cause: str, *, is_anew: bool) -> bool:
        """
        Become active again after a passing fault of this cause; return True then.

        `is_anew`: True for an activation, False to continue after the interruption.
        """
        if self.state != FAULT or self.is_latched or self.cause != cause:
            return False
        self._enter(ACTIVE)
        self.activations += is_anew
        return True

    def _enter(
        self, state: str, reason: str = '', cause: str = '', *, is_latched: bool = False
    ) -> None:
        self.state, self.reason, self.cause, self.is_latched = state, reason, cause, is_latched
        self.is_active = state == ACTIVE
