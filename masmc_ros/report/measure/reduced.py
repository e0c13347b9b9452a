# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Metrics of runs of campaigns, whose signals are not kept."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.law.command_interface import takes_rates
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.reduction import Reduction
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.timing import Timing
from masmc_ros.report.measure.metrics import Metrics, MetricSamples, RunSums, second_half
from masmc_ros.report.measure.tracking import BAND, FLOOR, settled_after
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.scenario.scenario import activation
import numpy as np

SETTLING = np.array([BAND, FLOOR])
"""Band of the settling time as a part of the first distance, and its minimum in m."""


class ReducedWindow(NamedTuple):
    """Window of the metrics of a run of known length: its second half."""

    timing: Timing
    times: Array
    """Time (n) of each tick in s."""
    start: float
    end: float
    """start <= t < end in s."""
    first: int
    after: int
    """First tick of the window, and the tick after its last one."""

    @classmethod
    def of(cls, timing: Timing) -> ReducedWindow:
        """Return the window of a control grid that ends."""
        assert timing.last is not None
        times = np.arange(timing.last + 1, dtype=np.float64) * timing.period
        start, end = second_half(times)
        within = np.flatnonzero((start <= times) & (times < end))
        # A run of one control period has no tick in its second half.
        first, after = (int(within[0]), int(within[-1]) + 1) if len(within) else (0, 0)
        return cls(timing, times, start, end, first, after)


def reduced_metrics(
    runs: Sequence[Scenario],
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
    window = ReducedWindow.of(simulation.timing)
    reduced = simulation.reduce(window.first, window.after, SETTLING)[0]
    has_torques = not takes_rates(runs[0].controller)
    return [
        metrics_of_lane(
            reduced,
            lane,
            window,
            simulation.mechanism,
            has_torques=has_torques,
            estimate=simulation.estimate[:, lane],
        )
        for lane in range(len(runs))
    ]


def simulated_metrics(run: Scenario) -> Metrics | float:
    """
    Return the metrics of a run whose plant has no lanes, bitwise those of `masmc simulate`.

    NaN if it diverged or fell. Raises InputError for an endless run.
    """
    simulation = Simulation(run, activation(run))
    if simulation.timing.last is None:
        raise InputError('duration = 0.0: expected a length > 0 s')
    try:
        blocks = [
            (block.error, block.torque, block.active, block.estimate[-1:], block.commands_rates)
            for block in simulation.run()
        ]
    except InputError:
        return math.nan
    errors, torques, active, estimates, takes_velocities = zip(*blocks, strict=True)
    mechanism = simulation.controller.mechanism
    return MetricSamples.of_ticks(
        np.concatenate(errors),
        np.zeros((0, len(mechanism.joints))) if takes_velocities[0] else np.concatenate(torques),
        simulation.timing.period,
        mechanism.points,
        active=np.concatenate(active),
        estimate=estimates[-1],
    ).metrics()


def metrics_of_lane(
    reduced: Reduction,
    lane: int,
    window: ReducedWindow,
    mechanism: Mechanism,
    *,
    has_torques: bool = True,
    estimate: Array | None = None,
) -> Metrics | float:
    """
    Return the metrics of a run from its reduced signals, or the time in s at which it diverged.

    Parameters
    ----------
    reduced
        Reduced signals after the last tick.
    lane
        Lane of the run.
    window
        Window of the metrics.
    mechanism
        Type of the robot.
    has_torques
        True if torques are commanded.
    estimate
        Last estimate (parameters) of the base inertial parameters; None without an estimate.

    """
    if reduced['lost_tick'][lane] >= 0:
        return window.timing.time(int(reduced['lost_tick'][lane]))
    last = len(window.times) - 1

    def settled(outside: int) -> float:
        time = float(window.times[outside + 1]) if outside < last else math.inf
        return settled_after(0.0, time, window.end)

    sums = RunSums(
        ticks=window.after - window.first,
        duration=window.end - window.start,
        square_sum=reduced['square_sum'][:, lane],
        largest_square=reduced['largest_square'][:, lane],
        settled=[settled(int(tick)) for tick in reduced['last_outside'][:, lane]],
        torque_square_sum=float(reduced['torque_square_sum'][lane]) if has_torques else None,
        torque_change_sum=float(reduced['torque_change_sum'][lane]) if has_torques else None,
        estimate=estimate,
    )
    joints = mechanism.sizes['joints'] if has_torques else 0
    return sums.metrics(mechanism.points, (window.start, window.end), joints)
