# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Simulated robots under torques from outside of the package, one robot in each lane.

The kernels of the plant compute all lanes at one tick. Robots that started at different times are
at different ticks: each of these ticks is then computed in a copy of the records, from which its
lanes are copied back. A robot is bitwise identical to the same robot alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from masmc_ros.aliases import AnyArray, Array, Flags, Function, Records
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import bound
from masmc_ros.jit.record import copy_lane, fill, lanes_of, take_over
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import plant_start, plant_tick, reduce_signals, track_reference
from masmc_ros.loop.reduction import axes_of_points, reduced_signals, Reduction
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulated_robot import (
    delay_line,
    has_effects,
    NO_STATE,
    write_plant,
    write_start,
)
from masmc_ros.loop.timing import CONTROL_PERIOD
from masmc_ros.robot.robot import robot_of
import numpy as np
from numpy.typing import NDArray

State = tuple[NDArray[Any], ...]

OF_STATE = ('position', 'velocity', 'true_position', 'true_velocity')
"""Signals that are finite at the start."""


class DrivenRobots:
    """
    Robots of one type that follow one path, one in each lane.

    Attributes
    ----------
    signals, tracked, reduced
        Records (1) of `SIGNALS`, `TRACKED` and `REDUCED`, each lane at its current tick.
    tick
        (lanes) current tick of each robot.

    """

    def __init__(
        self,
        scenario: Scenario,
        lanes: int,
        *,
        path: Array,
        window: tuple[int, int],
        settling: Array,
    ) -> None:
        """
        Initialise the robots, which have not started.

        Parameters
        ----------
        scenario
            Scenario for lanes without a robot.
        lanes
            Number of robots.
        path
            Reference of each tick (ticks, 3 * axes); a robot makes at most `ticks` - 1 steps.
        window, settling
            Window and band of the reduced signals, see `loop.reduction.reduce_tick`.

        """
        robot = scenario.robot
        mechanism = self.mechanism = robot.mechanism
        self._period, self._path = CONTROL_PERIOD.of(scenario.plant), path
        self._window, self._settling = window, settling
        self._points = axes_of_points(mechanism)
        self._plant = records.plant_settings(
            mechanism, lanes, has_effects=has_effects(scenario.plant)
        )
        self._nominal = records.plant_settings(mechanism, lanes)
        self._memory = records.plant_memory(mechanism, lanes)
        write_plant(self._plant, robot, self._period, scenario.plant)
        fill(self._nominal, 'geometry', robot.geometry)
        write_start(self._memory, robot, scenario.plant)
        self._delayed = delay_line(self._plant, mechanism)
        self.signals = records.signals(mechanism, lanes)
        self.tracked = records.tracked(mechanism, lanes)
        self.reduced = reduced_signals(mechanism, lanes)
        self.tick = np.zeros(lanes, np.int64)
        self._new = _copy(self._state)
        self._bound: dict[Function, Function] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes without bound kernels, which are bound again."""
        return {**self.__dict__, '_bound': {}}

    @property
    def _state(self) -> State:
        """Return the arrays that a tick changes; lanes are their last axis."""
        return self._memory, self._delayed, self.signals, self.tracked, self.reduced

    def start(self, runs: Mapping[int, Scenario]) -> None:
        """
        Start robots at tick 0 in their initial states.

        Parameters
        ----------
        runs
            Scenario of each lane that starts. Control period,
            integration steps and path are those of all lanes.

        Raises
        ------
        InputError
            If there is no such robot, or its initial state is not finite.

        """
        self._write_settings(runs)
        started = np.zeros(len(self.tick), bool)
        started[list(runs)] = True
        state = _copy(self._state)
        memory, delayed, signals, tracked, _ = state
        for before, record in zip(self._new, state, strict=True):
            if record is not delayed:
                record[...] = before
        for lane, run in runs.items():
            write_start(memory, run.robot, run.plant, lane)
        self._call(plant_start, self._plant, memory, delayed, signals)
        for lane in runs:
            if not _is_finite(signals, lane):
                raise InputError(NO_STATE)
        self._track(0, signals, tracked)
        _copy_lanes(state, self._state, started)
        self.tick[started] = 0

    def _write_settings(self, runs: Mapping[int, Scenario]) -> None:
        """Write the settings of robots that start."""
        if any(has_effects(run.plant) for run in runs.values()):
            self._add_effects()
        for lane, run in runs.items():
            robot = run.robot
            write_plant(self._plant, robot, self._period, run.plant, lane)
            fill(self._nominal, 'geometry', robot_of(run.controller).geometry, lane)
        self._lengthen(len(delay_line(self._plant, self.mechanism)))

    def _lengthen(self, rows: int) -> None:
        """Lengthen the buffer of delayed values to a number of rows."""
        # Rows are counted from the start, so a longer buffer keeps them.
        missing = rows - len(self._delayed)
        if missing > 0:
            self._delayed = np.pad(self._delayed, ((0, missing), (0, 0), (0, 0)))

    def _add_effects(self) -> None:
        """Select the code with effects of motors and joints for all lanes."""
        plant = records.plant_settings(self.mechanism, lanes_of(self._plant), has_effects=True)
        if plant.dtype != self._plant.dtype:
            take_over(plant, self._plant)
            self._plant = plant
            self._bound.clear()

    def values(self, record: str, field: str) -> AnyArray:
        """Return a field (lanes, components) of `signals`, `tracked` or `reduced`."""
        values: AnyArray = getattr(self, record)[field][0].T
        return values

    def reduction(self) -> Reduction:
        """Return the reduced signals (component, lane) by name."""
        return self.reduced[0]

    def step(self, torque: Array, moves: Flags) -> None:
        """
        Hold torques for one control period.

        Parameters
        ----------
        torque
            Commanded torques (lanes, joints) in N·m.
        moves
            (lanes) robots that take the step. The others are in no valid state until they start.

        """
        self.signals['torque'][0] = torque.T
        ticks = np.unique(self.tick[moves])
        if len(ticks) == 1:
            self._tick(int(ticks[0]), self._state)
        else:
            before = _copy(self._state)
            for tick in ticks:
                state = _copy(before)
                self._tick(int(tick), state)
                _copy_lanes(state, self._state, moves & (self.tick == tick))
        self.tick[moves] += 1

    def _tick(self, tick: int, state: State) -> None:
        memory, delayed, signals, tracked, reduced = state
        window = self._points, self._settling, tick, *self._window
        self._call(reduce_signals, reduced, signals, *window)
        self._call(plant_tick, self._plant, memory, delayed, tick, signals)
        self._track(tick + 1, signals, tracked)

    def _track(self, tick: int, signals: Records, tracked: Records) -> None:
        arguments = self._plant, self._nominal, signals, self._path[tick], tracked
        self._call(track_reference, *arguments)

    def _call(self, kernel: Function, *arguments: object) -> None:
        """Call a kernel without a check of the types, which are the same at every call."""
        if kernel not in self._bound:
            self._bound[kernel] = bound(kernel, *arguments)
        self._bound[kernel](*arguments)


def _copy(state: State) -> State:
    return tuple(array.copy() for array in state)


def _copy_lanes(source: State, target: State, lanes: Flags) -> None:
    for new, old in zip(source, target, strict=True):
        if old.dtype.names is None:
            old[..., lanes] = new[..., lanes]
        else:
            copy_lane(new, old, lanes)


def _is_finite(signals: Records, lane: int) -> bool:
    return all(np.isfinite(signals[name][0, :, lane]).all() for name in OF_STATE)
