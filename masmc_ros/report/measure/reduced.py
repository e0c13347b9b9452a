# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Metrics of runs that are computed in lanes and keep no signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math

from masmc_ros.law.command_interface import takes_rates
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.params.declaration import Values
from masmc_ros.report.measure.metrics import Metrics, Reached, second_half
from masmc_ros.report.measure.settling import BAND, FLOOR, settled_after
import numpy as np

_SETTLING = np.array([BAND, FLOOR])


def reduced_metrics(
    runs: Sequence[Mapping[str, Values]],
) -> list[Metrics | float]:
    """
    Compute runs in lanes and return the metrics of each.

    Parameters
    ----------
    runs
        Checked values of every node, for each run; see `BatchSimulation`.

    Returns
    -------
        The metrics of a run that stayed finite, bitwise those of `masmc simulate`. Of a run that
        diverged the time in s of the first signal that is not finite.

    """
    simulation = BatchSimulation(runs)
    timing, points = simulation.timing, simulation.mechanism.points
    assert timing.last is not None
    times = np.arange(timing.last + 1, dtype=np.float64) * timing.period
    start, end = window = second_half(times)
    within = np.flatnonzero((start <= times) & (times < end))
    reduced = simulation.reduce(int(within[0]), int(within[-1]) + 1, _SETTLING)[0]
    ticks, last = len(within), timing.last
    has_torques = not takes_rates(runs[0]['controller'])

    def reached(point: int, lane: int) -> Reached:
        outside = int(reduced['last_outside'][point, lane])
        settled = float(times[outside + 1]) if outside < last else math.inf
        return Reached(
            rms=math.sqrt(float(reduced['square_sum'][point, lane]) / ticks),
            largest=math.sqrt(float(reduced['largest_square'][point, lane])),
            settling=settled_after(0.0, settled, end),
        )

    def metrics(lane: int) -> Metrics | float:
        if reduced['lost_tick'][lane] >= 0:
            return timing.time(int(reduced['lost_tick'][lane]))
        efforts: dict[str, float] = {}
        if has_torques:
            square, change = reduced['torque_square_sum'][lane], reduced['torque_change_sum'][lane]
            efforts['torque_rms'] = math.sqrt(float(square) / ticks)
            efforts['torque_variation'] = float(change) / (end - start)
        return Metrics(
            *window,
            {point: reached(i, lane) for i, point in enumerate(points)},
            simulation.mechanism.sizes['joints'] if has_torques else 0,
            **efforts,
            estimate_norm=float(np.linalg.norm(simulation.estimate[:, lane])),
        )

    return [metrics(lane) for lane in range(len(runs))]
