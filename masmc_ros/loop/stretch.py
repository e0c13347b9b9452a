# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Consecutive ticks of a computed run, and what was changed among them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from masmc_ros.robot.robot import Robot
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Values = Mapping[str, Any]


class Change(NamedTuple):
    """Checked values of some of the controller's parameters, new at a tick, or an event."""

    tick: int
    """The first tick that is computed with them."""
    values: Values
    event: str = ''
    """One of EVENTS, after the values; empty for none."""


@dataclass(frozen=True)
class Stretch:
    """Consecutive ticks of a run; rows are ticks, SI units, radians."""

    first: int
    """Tick of row 0."""
    position: Array
    """(n, positions) as measured, in the order of joint_states."""
    velocity: Array
    """(n, positions) as measured, in the same order."""
    true_position: Array
    """(n, positions) as they are."""
    true_velocity: Array
    """(n, positions) as they are."""
    applied: Array
    """(n, joints) torque held over the interval that ended at the tick."""
    raw_torque: Array
    """(n, joints) torque that the law asked for, before the controller's limits."""
    torque: Array
    """(n, joints) command computed at the tick."""
    active: NDArray[np.bool_]
    """(n) whether a torque was computed; where not, nothing is commanded, error and surface are
    not known, and the estimate is that of the next activation."""
    rates: Array
    """(n, joints) commanded at the tick in place of a torque: the base's own velocities in m/s and
    rad/s, then the rates of the other joints in rad/s; (0, joints) where a torque is."""
    reference: Array
    """(n, 3 axes) x_d, xdot_d, xddot_d."""
    error: Array
    """(n, axes) e, of the measured state."""
    surface: Array
    """(n, axes) s."""
    estimate: Array
    """(n, parameters) theta_hat used in the tick's torque."""
    singular: int
    """Number of ticks at which the task was close to singular."""
    changes: tuple[Change, ...] = ()
    """Of the controller's parameters, at ticks of the stretch."""

    def true_error(self, robot: Robot) -> Array:
        """Return x - x_d (n, axes) of the true state in m, for the true robot."""
        return robot.task_positions(self.true_position) - self.reference[:, :self.error.shape[1]]


def joined(parts: Sequence[Stretch], changes: tuple[Change, ...]) -> Stretch:
    """Return consecutive stretches as one, with the changes on its way."""
    rows = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(Stretch)
        if isinstance(getattr(parts[0], field.name), np.ndarray)
    }
    singular = sum(part.singular for part in parts)
    return Stretch(first=parts[0].first, singular=singular, changes=changes, **rows)
