# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Consecutive ticks of a simulated run, and the changes at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.loop.signals import SIGNALS
from masmc_ros.params.declaration import Values
from masmc_ros.robot.robot import Robot
import numpy as np
from numpy.typing import NDArray

_NAMES = {signal.name for signal in SIGNALS}


class Change(NamedTuple):
    """Change of parameters of a node at a tick, or an event of the controller."""

    tick: int
    """First tick computed with the values."""
    values: Values
    event: str = ''
    """Event of `controller_events.EVENTS`, applied after the values; empty without an event."""
    node: str = 'controller'
    """Node of the parameters: controller or plant."""


@dataclass(frozen=True)
class TickBlock:
    """
    Consecutive ticks of a run; rows are ticks.

    Each of SIGNALS is an attribute (n, components) by its name; `reference` is that of the
    trajectory. While the controller is inactive, the torque is that of the safe stop, error and
    surface are NaN, and the estimate is that of the next activation.
    """

    first: int
    """Tick of row 0."""
    signals: NDArray[np.void]
    """Records (n) of SIGNALS with one lane."""
    active: NDArray[np.bool_]
    """True (n) if the law computed the command."""
    is_void: NDArray[np.bool_]
    """True (n) if nothing was commanded."""
    commands_rates: bool
    """True if `rates` are commanded and `torque` is 0; False if it is the reverse."""
    contact: Array
    """Contact signals (n, ...) of the plant; (n, 0) without contact physics."""
    changes: tuple[Change, ...] = ()
    """Changes of controller and plant at ticks of this block."""

    def __len__(self) -> int:
        """Return the number of ticks."""
        return len(self.signals)

    def __getattr__(self, name: str) -> Array:
        """Return a signal (n, components) by its name."""
        if name not in _NAMES:
            raise AttributeError(f'{name}: no signal of a tick')
        return self.signals[name].reshape(len(self.signals), -1)

    def true_error(self, robot: Robot) -> Array:
        """Return the task error (n, axes) of the true state; `robot` is the true robot."""
        return robot.task_errors(self.true_position, self.reference[:, :self.error.shape[1]])
