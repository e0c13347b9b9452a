# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ticks of a simulated run at the limits of torques, and outside of the ranges of joints."""

from __future__ import annotations

from masmc_ros.aliases import Array, Flags
from masmc_ros.loop.tick_block import TickBlock
from masmc_ros.robot.declaration import listed, Mechanism
import numpy as np

_AT_LIMIT = 0.999
"""Part of a torque limit from which a torque counts as limited."""

_SHARE = 0.1
"""Part of the second half of the ticks from which torques at their limits are a warning."""

_OUTSIDE = 1.0e-2
"""Distance in rad or m outside of a range from which it is a warning."""


_SHORTEST = 0.2
"""Shortest second half of a run in s for a warning about torques."""


class Course:
    """Counter of such ticks."""

    def __init__(
        self, mechanism: Mechanism, limits: Array, ticks: int, period: float
    ) -> None:
        """
        Initialise the counter.

        Parameters
        ----------
        mechanism
            Type of the robot.
        limits
            Torque limits (joints) in N·m or N; 0: no limit.
        ticks
            Number of ticks of the run.
        period
            Control period in s.

        """
        self._ticks, self._half, self._tick = ticks, ticks // 2, 0
        self._is_long = (ticks - self._half) * period >= _SHORTEST
        self._joints = mechanism.joints
        self._limits = np.where(limits > 0.0, limits, np.inf)
        ranges = np.array(mechanism.position_limits).reshape(-1, 2)
        self._lower, self._upper = ranges.T
        self._limited = np.zeros(len(limits), dtype=np.int64)
        self._left = np.zeros(len(limits), dtype=np.int64)
        self._farthest = np.zeros(len(limits))
        self._limited_ticks = self._left_ticks = 0

    def add(self, block: TickBlock) -> None:
        """Count the ticks of a block."""
        at = block.position[:, -len(self._joints):]
        outside = np.maximum(self._lower - at, at - self._upper)
        has_left = outside > _OUTSIDE
        self._left += has_left.sum(axis=0)
        self._left_ticks += int(has_left.any(axis=1).sum())
        if len(outside):
            self._farthest = np.maximum(self._farthest, outside.max(axis=0))
        if not block.commands_rates:
            is_limited = np.abs(block.torque) >= _AT_LIMIT * self._limits
            # A run that starts away from its path is limited at first.
            self._limited += is_limited[max(0, self._half - self._tick):].sum(axis=0)
            self._limited_ticks += int(is_limited.any(axis=1).sum())

        self._tick += len(block.position)

    def counts(self) -> dict[str, int]:
        """Return the numbers of ticks with a torque at its limit, and outside of a range."""
        return {'limited_ticks': self._limited_ticks, 'outside_ticks': self._left_ticks}

    def warnings(self) -> list[str]:
        """Return a text for each reason."""
        texts, ticks = [], self._ticks
        limited = self._names(self._limited > _SHARE * (ticks - self._half))
        if limited and self._is_long:
            texts.append(
                f'torque of {listed(limited)} at the limit at {self._limited_ticks} of {ticks}'
                ' ticks; expected a start that the limits hold, a slower path, or a higher'
                ' torque_limit of controller and plant'
            )
        if self._left_ticks:
            left = [
                f'{joint.name} by up to {far:.3g} {joint.unit}'
                for joint, far, count in zip(
                    self._joints, self._farthest, self._left, strict=True
                )
                if count
            ]
            texts.append(
                f'outside of its range at {self._left_ticks} of {ticks} ticks: {listed(left)}'
            )
        return texts

    def _names(self, which: Flags) -> list[str]:
        return [j.name for j, is_named in zip(self._joints, which, strict=True) if is_named]
