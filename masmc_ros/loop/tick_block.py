# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Consecutive ticks of a computed run, and what was changed among them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from masmc_ros.loop.signals import SIGNALS
from masmc_ros.numerics.aliases import Array
from masmc_ros.robot.robot import Robot
import numpy as np
from numpy.typing import NDArray

Values = Mapping[str, Any]

_NAMES = {signal.name for signal in SIGNALS}


class Change(NamedTuple):
    """Checked values of some of the controller's parameters, new at a tick, or an event."""

    tick: int
    """The first tick that is computed with them."""
    values: Values
    event: str = ''
    """One of EVENTS, after the values; empty for none."""


@dataclass(frozen=True)
class TickBlock:
    """
    Consecutive ticks of a run; rows are ticks.

    Each of SIGNALS is an attribute (n, components) by its name; `reference` is the trajectory's.
    Where the controller is not active, the torque is that of the safe stop, error and surface are
    NaN, and the estimate is that of the next activation.
    """

    first: int
    """Tick of row 0."""
    signals: NDArray[np.void]
    """(n) records of SIGNALS, of one lane."""
    active: NDArray[np.bool_]
    """(n) whether the law computed a command."""
    is_void: NDArray[np.bool_]
    """(n) whether nothing was commanded."""
    commands_rates: bool
    """Whether `rates` are commanded, and not `torque`; what is not is 0."""
    contact: Array
    """(n, ...) where wheels touch the ground, as the plant's `contact`; (n, 0) where none do."""
    changes: tuple[Change, ...] = ()
    """Of the controller's parameters, at ticks of the stretch."""

    def __len__(self) -> int:
        """Return the number of ticks."""
        return len(self.signals)

    def __getattr__(self, name: str) -> Array:
        """Return a signal (n, components) by its name."""
        if name not in _NAMES:
            raise AttributeError(f'{name}: no signal of a tick')
        return self.signals[name].reshape(len(self.signals), -1)

    def true_error(self, robot: Robot) -> Array:
        """Return x - x_d (n, axes) of the true state in m, for the true robot."""
        return robot.task_positions(self.true_position) - self.reference[:, :self.error.shape[1]]
