# SPDX-License-Identifier: Apache-2.0
"""The parameters that a log says its run started with."""

from __future__ import annotations

from typing import Any

from masmc_ros.log.reader import Run
from masmc_ros.robot.parameters import ROBOT, Robot


def run_robot(run: Run) -> Robot | None:
    """Return the robot that moved, None where the log does not describe it.

    A simulated plant has the real lengths; the other nodes have what they believe.
    """
    parameters = run.parameters
    for node in ('plant', 'controller', 'trajectory'):
        values = parameters.get(node, {})
        if all(_is_number(values.get(p.name)) for p in ROBOT):
            return Robot.from_values({p.name: values[p.name] for p in ROBOT})
    return None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
