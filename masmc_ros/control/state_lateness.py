# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Age of states by their stamps and times of arrival: deviation from the mean, and a warning."""

from __future__ import annotations

from masmc_ros.law.parts.delay_fields import LONGEST
from masmc_ros.loop.controller import Controller

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
    latency, total = controller.values['latency'], age + controller.stamp_age
    if controller.commands_rates or not latency + controller.period < total < LONGEST:
        return ''
    return (
        f'latency = {latency:g}: the states are {1e3 * total:.1f} ms old when they are answered; '
        f'expected at least {total:.4f}, and the delay of the drives in addition'
    )
