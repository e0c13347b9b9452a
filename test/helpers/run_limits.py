# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Margins of runs to limits of speed, position and torque: `run_limits.py FILE SETTING…`."""

from __future__ import annotations

from collections.abc import Sequence
import sys
from typing import Any, NamedTuple

from masmc_ros.loop.controller_events import ACTIVATED
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import Change
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray


class Limits(NamedTuple):
    """Extreme values of a whole run."""

    speed: float
    """Largest speed of a joint as a multiple of its limit."""
    beyond: float
    """Largest distance of a joint beyond its range in rad or m, negative within the range."""
    torque: float
    """Largest torque as a multiple of the controller's limit; 0 without limits."""
    error: NDArray[np.float64]
    """RMS of the distance of the first three axes over the second half of the run, m."""


def limits_of(file: str, settings: Sequence[str], *, approaches: bool = False) -> Limits:
    """Run a scenario, optionally with an approach to a path that starts elsewhere."""
    changes: tuple[Change, ...] = ()
    if approaches:
        settings = (*settings, 'controller.active_on_start=false')
        changes = (Change(0, {}, ACTIVATED),)
    values = load_scenario(file, settings)
    mechanism = mechanism_from(values['plant'])
    parts = list(Simulation(values, changes).run())

    def of_run(name: str) -> Any:
        return np.concatenate([getattr(part, name) for part in parts])

    base = len(mechanism.base)
    position, rates = (of_run(f'true_{name}')[:, base:] for name in ('position', 'velocity'))
    lower, upper = np.array(mechanism.position_limits).T
    limit = np.array(values['controller']['torque_limit'])
    error = of_run('error')
    error = error[len(error) // 2:, :3]
    return Limits(
        float((np.abs(rates) / mechanism.speed_limits).max()),
        float(np.maximum(lower - position, position - upper).max()),
        float((np.abs(of_run('torque')) / np.where(limit > 0.0, limit, np.inf)).max()),
        np.sqrt((error**2).sum(axis=1).mean()),
    )


if __name__ == '__main__':
    print(*limits_of(sys.argv[1], sys.argv[2:]))
