# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Share of ticks with a torque limited by torque_limit or torque_rate_limit, by joint."""

from __future__ import annotations

from collections.abc import Sequence

from masmc_ros.loop.controller import Controller
import numpy as np


class Saturation:
    """Counts of ticks between two reports."""

    def __init__(self, joints: Sequence[str]) -> None:
        """Initialise the counts for joints of these names."""
        self._joints = joints
        self._ticks = self._limited = 0
        self._limited_by_joint = np.zeros(len(joints), np.int64)

    def add(self, controller: Controller) -> None:
        """Count a computed tick."""
        self._ticks += 1
        if controller.has_limits:
            is_limited = controller.torque != controller.raw_torque
            self._limited_by_joint += is_limited
            self._limited += bool(is_limited.any())

    def report(self) -> dict[str, str]:
        """Return the shares since the last report, in total and by joint; restart the counts."""
        ticks = max(self._ticks, 1)
        joints = [
            f'{joint} {count / ticks:.0%}'
            for joint, count in zip(self._joints, self._limited_by_joint.tolist(), strict=True)
            if count
        ]
        report = {
            'ticks with limited torque': f'{self._limited / ticks:.1%}',
            'joints with limited torque': ', '.join(joints) or 'none',
        }
        self._ticks = self._limited = 0
        self._limited_by_joint[:] = 0
        return report
