# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Share of ticks with a torque limited by torque_limit or torque_rate_limit, by joint."""

from __future__ import annotations

from collections.abc import Sequence

from masmc_ros.loop.controller import Controller
import numpy as np


class Saturation:
    """Counts ticks from report to report."""

    def __init__(self, joints: Sequence[str]) -> None:
        """Start with none, of joints of these names."""
        self._joints = joints
        self._ticks = self._cut = 0
        self._of_joints = np.zeros(len(joints), np.int64)

    def add(self, controller: Controller) -> None:
        """Note a tick that was computed."""
        self._ticks += 1
        if controller.has_limits:
            is_cut = controller.torque != controller.raw_torque
            self._of_joints += is_cut
            self._cut += bool(is_cut.any())

    def report(self) -> dict[str, str]:
        """
        Return the share of ticks that were cut since the last report, and start over.

        In addition the joints, each with its own share.
        """
        ticks = max(self._ticks, 1)
        joints = [
            f'{joint} {count / ticks:.0%}'
            for joint, count in zip(self._joints, self._of_joints.tolist(), strict=True)
            if count
        ]
        report = {
            'ticks with limited torque': f'{self._cut / ticks:.1%}',
            'joints with limited torque': ', '.join(joints) or 'none',
        }
        self._ticks = self._cut = 0
        self._of_joints[:] = 0
        return report
