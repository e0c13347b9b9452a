# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Received reference of the controller: its checks, and its last position after its end."""

from __future__ import annotations

from collections.abc import Callable

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.loop.fault_rules import is_overdue
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.reference.windows import ReferenceWindows
from masmc_ros.robot.robot import Robot
import numpy as np


class ReferenceGate:
    """
    Reference within the reach of a robot, and the time since its end.

    Attributes
    ----------
    windows
        Received samples.

    """

    def __init__(self, robot: Robot, on_notice: Callable[[str], object]) -> None:
        """Initialise without a reference; `on_notice` receives a text if a source is replaced."""
        self._robot = robot
        self.windows = ReferenceWindows(len(robot.mechanism.axes), on_notice)
        self._held_since: float | None = None

    def add(self, window: ReferenceWindow, stamp: int | None) -> None:
        """
        Add a window of samples, or a set-point; `stamp` in ns is that of the last state.

        Raises
        ------
        InputError
            If it is not finite, has a wrong size or is out of reach, or if it is a set-point
            while a trajectory runs.

        """
        samples = window.samples.reshape(len(window.samples), -1)
        self._check_reach(samples)
        if window.stamp_ns is None:
            self.windows.set_point(samples[0], stamp)
        else:
            self.windows.add(window.stamp_ns, window.period, samples)

    def at(self, stamp: int) -> Array | None:
        """Return the sample (3 axes) at a stamp in ns; None without one."""
        reference = self.windows.at(stamp)
        if reference is not None:
            self._held_since = None
        return reference

    def held_after(self, stamp: int, now: float) -> Array | None:
        """Return the last position (3 axes) before a stamp in ns; its end is `now` at first."""
        reference = self.windows.held_after(stamp)
        if reference is not None and self._held_since is None:
            self._held_since = now
        return reference

    def restart_timeout(self) -> None:
        """Let the timeout of a reference that has ended start with the next activation."""
        self._held_since = None

    def is_overdue(self, now: float, timeout: float) -> bool:
        """Return True if the last position is held for more than a timeout, both in s."""
        return self._held_since is not None and is_overdue(now, self._held_since, timeout)

    def _check_reach(self, samples: Array) -> None:
        """Raise InputError for a position that the mechanism cannot reach."""
        mechanism, axes = self._robot.mechanism, len(self._robot.mechanism.axes)
        if samples.shape[1] < axes or not np.isfinite(samples).all():
            return
        unreachable = mechanism.formulas.out_of_reach(
            self._robot.geometry, np.ascontiguousarray(samples[:, :axes])
        )
        if unreachable is not None:
            sample, reason = unreachable
            raise InputError(f'reference: sample {sample} cannot be reached: {reason}')
