# SPDX-License-Identifier: Apache-2.0
"""Closed-loop runs of the compiled kernel, called as arrays: whole, in pieces, tick by tick."""

from __future__ import annotations

from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np
from robots import Array, DEFAULT, Machine

from masmc_ros.control.laws.update import BUILT_IN
from masmc_ros.control.reaching import SWITCHING
from masmc_ros.loop.closed_loop import closed_loop
from masmc_ros.loop.control_tick import control_tick
from masmc_ros.loop.controller_records import MEMORY, SETTINGS
from masmc_ros.loop.plant_records import PLANT_MEMORY, PLANT_SETTINGS
from masmc_ros.loop.plant_tick import plant_start, plant_tick
from masmc_ros.reference.trajectory import LineSine
from masmc_ros.robot import AXES, BASE_PARAMETERS

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
    """Further fields of the controller's SETTINGS: what lets adaptation last, limits."""
    measured: tuple[tuple[str, object], ...] = ()
    """Fields of the plant's PLANT_SETTINGS by which it is not measured exactly."""

    @property
    def reference(self) -> Array:
        """Return x_d, xdot_d and xddot_d at every tick (n, 12)."""
        names = ('offset', 'slope', 'amplitude', 'frequency', 'phase')
        return LineSine(dict(zip(names, self.line, strict=True))).sample(
            np.arange(self.ticks) * self.period
        )


@dataclass
class Run:
    """What a run leaves behind; rows are ticks."""

    true_position: Array
    true_velocity: Array
    position: Array
    velocity: Array
    applied: Array
    raw_torque: Array
    torque: Array
    error: Array
    surface: Array
    estimate: Array
    singular: int = 0


def records(scenario: Scenario) -> tuple[Any, Any]:
    """Return the controller's settings and its memory at the start."""
    settings, memory = np.zeros(1, SETTINGS), np.zeros(1, MEMORY)
    settings['geometry'] = scenario.robot.geometry
    settings['nominal'] = scenario.model_scale * np.array(scenario.robot.theta)
    settings['law'] = BUILT_IN.index(scenario.law)
    settings['switching'] = SWITCHING.index(scenario.switching)
    for name in _GAINS:
        settings[name] = getattr(scenario, name)
    for name, value in scenario.extra:
        settings[name] = value
    settings['has_limits'] = settings['torque_limit'].any() | settings['torque_rate_limit'].any()
    memory['estimate'], memory['predicted'] = settings['nominal'], np.nan
    return settings, memory


def plant_record(scenario: Scenario) -> Any:
    """Return the plant's record."""
    plant = np.zeros(1, PLANT_SETTINGS)
    plant['geometry'], plant['theta'] = scenario.robot.geometry, scenario.robot.theta
    for name in ('amplitude', 'frequency', 'phase', 'limit', 'period', 'steps'):
        plant[name] = getattr(scenario, name)
    for name, value in scenario.measured:
        plant[name] = value
    plant['is_exact'] = not scenario.measured
    return plant


class Loop:
    """A run in progress."""

    def __init__(self, scenario: Scenario) -> None:
        """Start at tick 0."""
        self.scenario = scenario
        self._plant, self._plant_memory = plant_record(scenario), np.zeros(1, PLANT_MEMORY)
        self._delayed = np.zeros((int(self._plant['delay'][0]) + 1, 14))
        self._settings, self._memory = records(scenario)
        n = scenario.ticks
        self._reference = scenario.reference
        position, velocity, *true = (np.full((n + 1, 7), np.nan) for _ in range(4))
        self.run = Run(
            *([position, velocity] if self._plant['is_exact'] else true),
            position,
            velocity,
            np.zeros((n + 1, AXES)),
            *(np.full((n, AXES), np.nan) for _ in range(4)),
            np.full((n, BASE_PARAMETERS), np.nan),
        )
        plant_start(
            self._plant,
            self._plant_memory,
            self._delayed,
            scenario.robot.physical['com_offset'],
            scenario.pose,
            scenario.joints,
            scenario.rates,
            self.run.position[0],
            self.run.velocity[0],
        )
        self.run.true_position[0] = self._plant_memory['position'][0]
        self.run.true_velocity[0] = self._plant_memory['velocity'][0]

    def stretch(self, first: int, last: int) -> None:
        """Compute ticks first ... last - 1 in one compiled call."""
        s, r = self.scenario, self.run
        r.singular += closed_loop(
            self._plant,
            self._plant_memory,
            self._delayed,
            self._settings,
            self._memory,
            first,
            last == s.ticks,
            self._reference[first:last],
            r.true_position[first : last + 1],
            r.true_velocity[first : last + 1],
            r.position[first : last + 1],
            r.velocity[first : last + 1],
            r.applied[first : last + 1],
            r.raw_torque[first:last],
            r.torque[first:last],
            np.empty((0, AXES)),
            r.error[first:last],
            r.surface[first:last],
            r.estimate[first:last],
        )

    def tick(self, k: int) -> None:
        """Compute one tick as the nodes do: the controller's, then the plant's."""
        s, r = self.scenario, self.run
        r.estimate[k] = self._memory['estimate'][0]
        r.singular += control_tick(
            self._settings,
            self._memory,
            r.position[k],
            r.velocity[k],
            self._reference[k],
            r.raw_torque[k],
            r.torque[k],
            r.error[k],
            r.surface[k],
        )
        if k + 1 == s.ticks:
            return
        plant_tick(
            self._plant,
            self._plant_memory,
            self._delayed,
            k,
            r.torque[k],
            r.position[k + 1],
            r.velocity[k + 1],
            r.applied[k + 1],
        )
        r.true_position[k + 1] = self._plant_memory['position'][0]
        r.true_velocity[k + 1] = self._plant_memory['velocity'][0]


def whole(scenario: Scenario) -> Run:
    """Run in one compiled call."""
    loop = Loop(scenario)
    loop.stretch(0, scenario.ticks)
    return loop.run


def in_pieces(scenario: Scenario, cut: int) -> Run:
    """Run in two compiled calls."""
    loop = Loop(scenario)
    loop.stretch(0, cut)
    loop.stretch(cut, scenario.ticks)
    return loop.run


def tick_by_tick(scenario: Scenario) -> Run:
    """Run tick by tick from Python."""
    loop = Loop(scenario)
    for k in range(scenario.ticks):
        loop.tick(k)
    return loop.run
