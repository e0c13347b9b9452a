# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Runs with known errors and torques, for tests of the report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import Run
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.robot.two_link.paper_robot import ROBOT
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PARAMETERS: dict[str, Any] = {
    **{parameter.name: parameter.default for parameter in ROBOT},
    'law': 'smc',
    'switching': 'tanh',
    'boundary_layer': 0.2,
    'observer_gain': 0.0,
}


def ticks(duration: float = 20.0, period: float = 0.01) -> Floats:
    """Return the times of a run in s, rounded as stamps are."""
    count = round(duration / period)
    return np.round(np.arange(count + 1) * period * 1e9) / 1e9


def series(times: Floats, values: Floats) -> Series:
    """Return values at times in s."""
    return Series(np.rint(times * 1e9).astype(np.int64), values)


def none(width: int) -> Series:
    """Return a series without any values."""
    return series(np.zeros(0), np.zeros((0, width)))


def telling(run: Run, **signals: tuple[Floats, Floats]) -> Run:
    """Return a run with additional signals of the controller, each as times and values."""
    more = {name: series(*samples) for name, samples in signals.items()}
    return replace(run, telemetry={**run.telemetry, **more})


def run_of(
    error: Floats,
    times: Floats,
    *,
    torque: Floats | None = None,
    path: str = 'run.mcap',
    **parameters: Any,
) -> Run:
    """Return a run with these errors (n, 4), the paper's reference and a robot at rest."""
    n = len(times)
    reference = np.zeros((n, 12))
    reference[:, 0] = 0.3 + 0.2 * times
    reference[:, 1] = 0.5 + 0.25 * np.sin(0.2 * np.pi * times)
    reference[:, 2] = 0.2 * times
    return Run(
        path=Path(path),
        times=times,
        position=np.tile([0.0, 0.0, np.pi / 2, 0.0, 0.0, np.pi / 4, -np.pi / 2], (n, 1)),
        velocity=np.zeros((n, 7)),
        applied_effort=np.zeros((n, 4)),
        torque=series(times, np.zeros((n, 4)) if torque is None else torque),
        cmd_vel=none(2),
        arm_rates=none(2),
        reference=reference,
        telemetry={'error': series(times, error)},
        parameters={'controller': {**PARAMETERS, **parameters}},
        changes=(),
        restarted=(),
        topics={},
        metadata={},
        attachments={},
    )


def paper_like(path: str = 'run.mcap', *, scale: float = 1.0, **parameters: Any) -> Run:
    """Return a run like the paper's: errors decay to oscillations of some mm, scaled."""
    t = ticks()
    decay = np.exp(-2.0 * t)
    error = np.stack(
        [
            -0.41 * decay + 0.006 * np.sin(1.5 * t),
            0.23 * decay + 0.005 * np.cos(1.5 * t),
            0.02 * np.sin(3.0 * t),
            0.116 * decay + 0.015 * np.sin(1.5 * t + 0.4),
        ],
        axis=1,
    )
    torque = scale * np.tile(2.0 + np.sin(t)[:, None], (1, 4))
    run = run_of(scale * error, t, path=path, torque=torque, **parameters)
    # The axle follows the reference; therefore plots draw the robot along the path.
    position = run.position.copy()
    assert run.reference is not None
    position[:, :2] = run.reference[:, 2:4]
    return replace(run, position=position)


def without_error(run: Run) -> Run:
    """Return a run whose log lacks the controller's own errors."""
    return replace(run, telemetry={})


def later(run: Run, late: float) -> Run:
    """Return a run with errors whose stamps are later by some seconds."""
    error = run.telemetry['error']
    return replace(
        run,
        times=run.times + late,
        torque=series(run.torque.times + late, run.torque.values),
        telemetry={'error': series(error.times + late, error.values)},
    )


def with_change(run: Run, time: float, node: str, **values: Any) -> Run:
    """Return a run in which a node's parameters change at `time` in s from the start."""
    stamp = round((float(run.times[0]) + time) * 1e9)
    known = dict(run.parameters.get(node.rpartition('/')[2], {}))
    for earlier in run.changes:
        if earlier.node.rpartition('/')[2] == node.rpartition('/')[2]:
            known.update(earlier.parameters)
    change = ParameterRecord(node, round(time * 100), stamp, {**known, **values}, tuple(values))
    return replace(run, changes=(*run.changes, change))
