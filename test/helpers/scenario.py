# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Closed-loop runs of the compiled kernel: in one call, in two calls, and tick by tick."""

from __future__ import annotations

from dataclasses import dataclass, field
import math
from typing import Any

from helpers.robots import Array, AXES, BASE_PARAMETERS, DEFAULT, Machine
from masmc_ros.jit.record import fill
from masmc_ros.law.registry import LAWS
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import closed_loop, control_tick, plant_start, plant_tick
from masmc_ros.loop.signals import inputs
from masmc_ros.loop.simulated_robot import delay_line
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.reference.trajectory import LineSine
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np

PAPER_LAWS = ('smc', 'rasmc')
"""Laws that are tested with each switching term."""

_GAINS = ('period', 'k_s1', 'k_s2', 'sigma', 'gamma', 'boundary_layer', 'observer_gain')


def axes(*values: float) -> Array:
    """Make an array of one number per axis."""
    return np.array(values, dtype=np.float64)


@dataclass(frozen=True)
class Scenario:
    """Robot, law, reference, disturbance and start of a run; defaults are the paper's."""

    law: str = 'rasmc'
    switching: str = 'tanh'
    observer_gain: float = 0.0
    boundary_layer: float = 0.2
    model_scale: float = 0.5
    robot: Machine = field(default_factory=lambda: Machine(DEFAULT))
    period: float = 1e-3
    steps: int = 2
    ticks: int = 20_001
    k_s1: Array = field(default_factory=lambda: np.full(AXES, 100.0))
    k_s2: Array = field(default_factory=lambda: np.full(AXES, 100.0))
    sigma: Array = field(default_factory=lambda: np.full(AXES, 2.0))
    gamma: Array = field(default_factory=lambda: np.ones(BASE_PARAMETERS))
    amplitude: Array = field(default_factory=lambda: axes(1.5, 1.5, 3.0, 3.0))
    frequency: Array = field(default_factory=lambda: axes(3.0, 3.0, 1.5, 1.5))
    phase: Array = field(default_factory=lambda: axes(0.0, math.pi / 2, 0.0, math.pi / 2))
    limit: Array = field(default_factory=lambda: np.zeros(AXES))
    pose: Array = field(default_factory=lambda: axes(0.0, 0.0, math.pi / 2))
    joints: Array = field(default_factory=lambda: axes(0.0, 0.0, math.pi / 4, -math.pi / 2))
    rates: Array = field(default_factory=lambda: np.zeros(AXES))
    line: Array = field(
        default_factory=lambda: np.array(
            [
                [0.3, 0.5, 0.0, 0.0],
                [0.2, 0.0, 0.2, 0.0],
                [0.0, 0.25, 0.0, 0.0],
                [0.0, 0.2 * math.pi, 0.0, 0.0],
                [0.0, 0.0, 0.0, 0.0],
            ]
        )
    )
    """Offset, slope, amplitude, frequency and phase of each task axis (5, 4)."""
    extra: tuple[tuple[str, object], ...] = ()
    """Further fields of the controller's SETTINGS: robust adaptation, limits."""
    measured: tuple[tuple[str, object], ...] = ()
    """Fields of the plant's PLANT_SETTINGS for inexact measurements."""

    @property
    def reference(self) -> Array:
        """Return x_d, xdot_d and xddot_d at every tick (n, 12)."""
        names = ('offset', 'slope', 'amplitude', 'frequency', 'phase')
        return LineSine(dict(zip(names, self.line, strict=True))).sample(
            np.arange(self.ticks) * self.period
        )


class Run:
    """Signals of a run, an attribute for each of SIGNALS; rows are ticks."""

    def __init__(self, signals: Any) -> None:
        """Initialise the run from the records of all ticks (n)."""
        self.singular = int(signals['singular'].sum())
        for name in signals.dtype.names:
            if name not in ('singular', 'age') and name.isidentifier():
                rows = np.ascontiguousarray(signals[name][:, :, 0])
                if name in _AFTER_THE_LAST:
                    # The last command is not applied; its effect is unknown.
                    unknown = np.full((1, rows.shape[1]), _AFTER_THE_LAST[name])
                    rows = np.vstack([rows, unknown])
                setattr(self, name, rows)


_AFTER_THE_LAST = {
    'true_position': np.nan,
    'true_velocity': np.nan,
    'position': np.nan,
    'velocity': np.nan,
    'applied': 0.0,
}


def law_records(scenario: Scenario, lanes: int = 1) -> tuple[Any, Any]:
    """Return the controller's settings and its memory at the start."""
    law = LAWS[scenario.law]
    settings = records.law_settings(TWO_LINK, law, scenario.switching, lanes)
    memory = records.law_memory(TWO_LINK, law, lanes)
    write_law(settings, memory, scenario)
    return settings, memory


def write_law(settings: Any, memory: Any, scenario: Scenario, lane: int | None = None) -> None:
    """Write a scenario's settings of the law into one lane or into all."""
    nominal = scenario.model_scale * np.array(scenario.robot.theta)
    fill(settings, 'geometry', scenario.robot.geometry, lane)
    fill(settings, 'nominal', nominal, lane)
    for name in _GAINS:
        fill(settings, name, getattr(scenario, name), lane)
    for name, value in scenario.extra:
        fill(settings, name, value, lane)
    fill(memory, 'estimate', nominal, lane)


def plant_records(scenario: Scenario, lanes: int = 1) -> tuple[Any, Any]:
    """Return the plant's settings and its memory at the start."""
    plant = records.plant_settings(TWO_LINK, lanes)
    memory = records.plant_memory(TWO_LINK, lanes)
    write_plant(plant, memory, scenario)
    return plant, memory


def write_plant(plant: Any, memory: Any, scenario: Scenario, lane: int | None = None) -> None:
    """Write a scenario's settings of the plant into one lane or into all."""
    fill(plant, 'geometry', scenario.robot.geometry, lane)
    fill(plant, 'theta', np.array(scenario.robot.theta), lane)
    for name in ('amplitude', 'frequency', 'phase', 'limit', 'period', 'steps'):
        fill(plant, name, getattr(scenario, name), lane)
    for name, value in scenario.measured:
        fill(plant, name, value, lane)
    fill(plant, 'is_exact', not scenario.measured, lane)
    s, c = sin_cos(scenario.pose[2])
    offset = scenario.robot.physical['com_offset']
    x, y = scenario.pose[0] - offset * c, scenario.pose[1] - offset * s
    fill(memory, 'position', [x, y, scenario.pose[2], *scenario.joints], lane)
    fill(memory, 'rates', scenario.rates, lane)


class Loop:
    """Run in progress."""

    def __init__(self, scenario: Scenario) -> None:
        """Initialise the run of a scenario at tick 0."""
        self.scenario = scenario
        self._plant, self._plant_memory = plant_records(scenario)
        self._delayed = delay_line(self._plant, TWO_LINK)
        self._settings, self._memory = law_records(scenario)
        self._tick_signals = records.signals(TWO_LINK)
        self._reference = scenario.reference
        self.signals = np.zeros(scenario.ticks, self._tick_signals.dtype)
        plant_start(self._plant, self._plant_memory, self._delayed, self._tick_signals)

    @property
    def run(self) -> Run:
        """Return the ticks computed so far."""
        return Run(self.signals)

    def run_ticks(self, first: int, last: int) -> None:
        """Compute ticks first ... last - 1 in one compiled call."""
        closed_loop(
            self._plant,
            self._plant_memory,
            self._delayed,
            self._settings,
            self._memory,
            self._tick_signals,
            first,
            last == self.scenario.ticks,
            self._reference[first:last],
            self.signals[first:last],
        )

    def tick(self, k: int) -> None:
        """Compute one tick as the nodes do: the controller first, then the plant."""
        self._tick_signals['reference'][0, :, 0] = self._reference[k]
        control_tick(self._settings, self._memory, self._tick_signals, *inputs(self._tick_signals))
        self.signals[k] = self._tick_signals[0]
        if k + 1 == self.scenario.ticks:
            return
        plant_tick(self._plant, self._plant_memory, self._delayed, k, self._tick_signals)


def whole(scenario: Scenario) -> Run:
    """Run in one compiled call."""
    loop = Loop(scenario)
    loop.run_ticks(0, scenario.ticks)
    return loop.run


def in_pieces(scenario: Scenario, cut: int) -> Run:
    """Run in two compiled calls."""
    loop = Loop(scenario)
    loop.run_ticks(0, cut)
    loop.run_ticks(cut, scenario.ticks)
    return loop.run


def tick_by_tick(scenario: Scenario) -> Run:
    """Run tick by tick from Python."""
    loop = Loop(scenario)
    for k in range(scenario.ticks):
        loop.tick(k)
    return loop.run
