# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Detection of torques that are held for longer than a boundary layer tolerates."""

from __future__ import annotations

import math

from masmc_ros.aliases import Array
from masmc_ros.control.actions import Throttle
from masmc_ros.law.parts.model import MODEL_SCALE
from masmc_ros.law.reaching.reaching import BOUNDARY_LAYER, K_S1, K_S2
from masmc_ros.law.registry import SWITCHING_TERM
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.layer_bound import least_task_inertia, longest_hold, thinnest_layer
import numpy as np

_LAYERED = ('saturation', 'tanh', 'sigmoid')

_QUIET = 5.0
"""Time in s between two lines."""


class LayerWatch:
    """Comparison of the longest hold of a torque with the limit of the law."""

    def __init__(self, controller: Controller) -> None:
        """Initialise with the controller, and compile the kernels."""
        self._controller = controller
        self._throttle = Throttle(_QUIET)
        self._longest = 0
        self._least_inertia(controller.nominal, np.ones(len(controller.mechanism.positions)))

    def _least_inertia(self, theta: Array, position: Array) -> float:
        robot = self._controller.robot
        return least_task_inertia(robot.mechanism, theta, robot.geometry, position)

    def restart(self) -> None:
        """Discard the longest hold, after a change of the law."""
        self._longest = 0

    def check(self, periods: int, position: Array, now: float) -> str | None:
        """
        Return a warning if the last torque was held for too long, otherwise None.

        Only a hold that is longer than all previous ones takes computing time.

        Parameters
        ----------
        periods
            Number of periods for which the torque was held.
        position
            State (positions) of the robot.
        now
            Time in s.

        """
        if periods <= self._longest:
            return None
        warning = self._warning(periods * self._controller.period, position)
        if warning is not None and not self._throttle.is_due('hold', now):
            return None
        self._longest = periods
        return warning

    def _warning(self, hold: float, position: Array) -> str | None:
        controller, values = self._controller, self._controller.values
        if not controller.uses_switching or SWITCHING_TERM.of(values) not in _LAYERED:
            return None
        unscaled = (1.0 - MODEL_SCALE.of(values)) * controller.robot.theta
        theta = controller.nominal + unscaled
        inertia = self._least_inertia(theta, position)
        k_s1, k_s2, layer = max(K_S1.of(values)), max(K_S2.of(values)), BOUNDARY_LAYER.of(values)
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
            f'a torque was held for {1e3 * hold:.3g} ms; {SWITCHING_TERM.of(values)} with '
            f'boundary_layer {layer:g} is stable up to {1e3 * longest:.2g} ms: use a faster '
            f'machine, {thicker}switching implicit'
        )
