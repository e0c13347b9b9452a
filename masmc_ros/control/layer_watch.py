# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Detection of torques that are held for longer than a boundary layer tolerates."""

from __future__ import annotations

import math
from typing import Any

from masmc_ros.loop.controller import Controller
from masmc_ros.loop.layer_bound import least_task_inertia, longest_hold, thinnest_layer
from masmc_ros.throttle import Throttle
import numpy as np

_LAYERED = ('saturation', 'tanh', 'sigmoid')

_QUIET = 5.0
"""Time in s between two lines."""


class LayerWatch:
    """Looks at the law where a torque is held for longer than any before."""

    def __init__(self, controller: Controller) -> None:
        """Take the controller."""
        self._controller = controller
        self._throttle = Throttle(_QUIET)
        self._most = 0
        # To no consequence: what it takes is compiled here.
        self._least_inertia(controller.nominal, np.ones(len(controller.mechanism.positions)))

    def _least_inertia(self, theta: Any, position: Any) -> float:
        robot = self._controller.robot
        return least_task_inertia(robot.mechanism, theta, robot.geometry, position)

    def begin(self) -> None:
        """Restart: the law has changed."""
        self._most = 0

    def held(self, periods: int, position: Any, now: float) -> str | None:
        """
        Note that the last torque was held for so many periods; return a warning if too long.

        `position` is where the robot is at a time `now` in s. Only the longest so far costs time.
        """
        if periods <= self._most:
            return None
        line = self._warning(periods * self._controller.period, position)
        if line is None:
            self._most = periods
        elif self._throttle.is_due('hold', now):
            self._most = periods
            return line
        return None

    def _warning(self, hold: float, position: Any) -> str | None:
        controller, values = self._controller, self._controller.values
        if not controller.uses_switching or values['switching'] not in _LAYERED:
            return None
        theta = controller.nominal / values['model_scale']
        inertia = self._least_inertia(theta, position)
        k_s1, k_s2, layer = max(values['k_s1']), max(values['k_s2']), values['boundary_layer']
        longest = longest_hold(inertia, k_s1, k_s2, layer)
        if hold <= longest:
            return None
        thinnest = thinnest_layer(inertia, k_s1, k_s2, hold)
        thicker = ''
        if math.isfinite(thinnest):
            thicker = (
                f'boundary_layer > {thinnest:.2g} (K_s2 / (2 lambda_min(H_x) / T - K_s1) with '
                'this T), or '
            )
        return (
            f'a torque was held for {1e3 * hold:.3g} ms; {values["switching"]} with '
            f'boundary_layer {layer:g} is stable up to {1e3 * longest:.2g} ms: expected a machine '
            f'that keeps up, {thicker}switching implicit'
        )
