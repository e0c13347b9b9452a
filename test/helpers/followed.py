# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Closed loop in virtual time whose reference continues with paths, as the trajectory node's."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

from helpers.core_loop import CoreLoop
from masmc_ros.errors import InputError
from masmc_ros.nodes.trajectory.path_messages import PathRequest
from masmc_ros.nodes.trajectory.received_paths import ReceivedPaths
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Followed(CoreLoop):
    """Closed loop whose reference continues with paths."""

    def __init__(self, values: dict[str, dict[str, Any]]) -> None:
        """Initialise the loop from checked values by node."""
        super().__init__(values)
        robot = self.controller.robot
        self.paths = ReceivedPaths(self.trajectory, robot, self.timing, values['trajectory'])
        # The trajectory of the parameters is part of the paths.
        self.trajectory = self.paths  # type: ignore[assignment]  # only `sample` is used
        self.used: list[Array] = []
        self.reached: list[Array] = []
        self.speeds: list[Array] = []
        self.torques: list[Array] = []

    def take(self, request: PathRequest) -> None:
        """Start a path a lead after the current tick, and send its samples; may raise."""
        self.paths.wait(request, unsent=self._sent, tick=self.tick, origin_ns=0)
        deadline = time.monotonic() + 60.0
        while self.paths.is_loading:
            assert time.monotonic() < deadline
            time.sleep(0.001)
        first = self.paths.start(self.tick, self.plant.position.copy())
        assert first is not None
        self._sent = first
        self.send_reference()

    def follow(self, seconds: float) -> None:
        """Advance, and keep the samples of the reference that were used."""
        for _ in range(round(seconds / self.period)):
            self.step()
            windows, stamp = self.core.reference.windows, self.timing.stamp(self.tick - 1)
            self.used.append(np.array(windows.at(stamp)))
            self.reached.append(self.plant.true_position.copy())
            self.speeds.append(self.plant.true_velocity.copy())
            assert self.torque is not None
            self.torques.append(self.torque)

    def take_random(
        self, count: int, drawn: Callable[[], PathRequest], draw: Generator, longest: float
    ) -> int:
        """
        Follow `count` drawn paths; return the number of rejected ones.

        Each is followed for up to `longest` s.
        """
        rejected = 0
        for number in range(count):
            try:
                self.take(drawn())
            except InputError as error:
                rejected += 1
                assert '\n' not in str(error)
            self.follow(draw.uniform(0.1, longest))
            assert self.state == 'active', (number, self.reports[-3:])
        return rejected

    def errors(self) -> Array:
        """Return the task errors (n - 1, axes); check that the reference has no jump or NaN."""
        samples = np.array(self.used)
        assert np.isfinite(samples).all()
        x, velocity, _ = np.split(samples, 3, axis=1)
        step = np.diff(x, axis=0) - 0.5 * self.period * (velocity[1:] + velocity[:-1])
        assert np.abs(step).max() < 1e-5
        # A position is that after the period.
        reached = self.controller.robot.task_positions(np.array(self.reached))
        return np.asarray(reached[:-1] - x[1:])
