# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Mode of the controller: inactive, active, or in a fault with a reason."""

from __future__ import annotations

from masmc_ros.loop.fault_rules import recovers, takes_fault

INACTIVE = 'inactive'
ACTIVE = 'active'
FAULT = 'fault'

_GUIDED = 'hand guiding'
_NEW = 'not enabled yet'
_UNCONFIGURED = 'not configured'
_SHUT_DOWN = 'shut down'

NO_REFERENCE = 'no reference'
"""Start of the reason of a fault because the reference ended."""


def would_follow(text: str) -> bool:
    """
    Return True if a controller in the state of this text follows a new reference.

    A controller in the fault of a missing reference becomes active when one arrives.
    """
    return text == ACTIVE or text.startswith(f'{FAULT}: {NO_REFERENCE}')


class Supervisor:
    """
    Mode of the controller, changed by its services and by faults.

    The law is computed in `active` only. A passing fault ends with its cause, a latched one when
    it is cleared or the controller is enabled. After an activation the law restarts. Without a
    configuration, only `configure` and `shut_down` have an effect; after `shut_down` nothing has.

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
        self._enter(INACTIVE, _NEW)
        if active:
            self.enable()

    @property
    def text(self) -> str:
        """Return the state and, if it is not active, the reason: `fault: emergency stop`."""
        return f'{self.state}: {self.reason}' if self.reason else self.state

    def enable(self) -> None:
        """Change to active from any configured state; clear every fault."""
        if self.state != ACTIVE and self.is_configured:
            self._enter(ACTIVE)
            self.activations += 1

    def disable(self) -> None:
        """Change to inactive from any configured state; clear every fault."""
        if self.is_configured:
            self._enter(INACTIVE, 'disabled')

    def configure(self) -> None:
        """Change from unconfigured to inactive."""
        if not (self.is_configured or self.is_shut_down):
            self._enter(INACTIVE, _NEW)

    def clean_up(self) -> None:
        """Change to unconfigured from any configured state; clear every fault."""
        if self.is_configured:
            self._enter(INACTIVE, _UNCONFIGURED)

    def shut_down(self) -> None:
        """Change to the final state, which no event ends."""
        self._enter(INACTIVE, _SHUT_DOWN)

    @property
    def is_configured(self) -> bool:
        """Return False if neither activation nor fault is possible."""
        return self.state != INACTIVE or self.reason not in (_UNCONFIGURED, _SHUT_DOWN)

    @property
    def is_shut_down(self) -> bool:
        """Return True in the final state."""
        return self.state == INACTIVE and self.reason == _SHUT_DOWN

    def guide(self) -> None:
        """Change to hand guiding; the caller has checked that this is possible."""
        self._enter(INACTIVE, _GUIDED)

    @property
    def is_guided(self) -> bool:
        """Return True if the arm is guided by hand."""
        return self.state == INACTIVE and self.reason == _GUIDED

    def stop(self) -> None:
        """Change to the latched fault of an emergency stop, from any configured state."""
        self.fail('emergency stop', 'emergency stop', is_latched=True)

    def clear(self) -> bool:
        """Change from a fault to inactive; return False if there is no fault."""
        if self.state != FAULT:
            return False
        self._enter(INACTIVE, 'a fault was cleared')
        return True

    def fail(self, cause: str, reason: str, *, is_latched: bool = False) -> bool:
        """
        Change to a fault if it has an effect in the present state; return True then.

        Only an active controller has a passing fault. A latched fault takes effect in all
        configured states except another latched fault, whose reason stays.

        Parameters
        ----------
        cause
            Kind of the fault.
        reason
            Reason in one line.
        is_latched
            True if the fault stays until it is cleared.

        """
        is_latched_fault = self.state == FAULT and self.is_latched
        has_effect = self.is_configured and takes_fault(
            self.is_active, is_latched_fault, is_latched
        )
        if has_effect:
            self._enter(FAULT, reason, cause, is_latched=is_latched)
        return has_effect

    def recover(self, cause: str, *, is_restart: bool) -> bool:
        """
        Change to active after a passing fault of this cause; return True then.

        `is_restart`: True for an activation, False to continue after the interruption.
        """
        if not recovers(self.state == FAULT, self.is_latched, self.cause == cause):
            return False
        self._enter(ACTIVE)
        self.activations += is_restart
        return True

    def _enter(
        self, state: str, reason: str = '', cause: str = '', *, is_latched: bool = False
    ) -> None:
        self.state, self.reason, self.cause, self.is_latched = state, reason, cause, is_latched
        self.is_active = state == ACTIVE
