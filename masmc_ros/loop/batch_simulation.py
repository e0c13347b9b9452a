# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Simulation of many runs of one law at once, one run in each lane.

Each run is bitwise identical to the same run alone. Lanes may differ in numbers: gains, robots,
disturbances, initial states, noise and delays. Law, switching term, type of robot, period,
integration steps and path are equal in all lanes, because the loop is compiled for these.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

from masmc_ros.aliases import Array, Records
from masmc_ros.errors import InputError
from masmc_ros.jit.record import fill, lanes_of, take_over, uninitialised
from masmc_ros.law.command_interface import check_agreement, is_hybrid, takes_rates
from masmc_ros.law.law import Law
from masmc_ros.law.parts.joint_limits import CHOICE as JOINT_LIMITS
from masmc_ros.law.rates import RATES
from masmc_ros.law.reaching.reaching import shortcut_of
from masmc_ros.law.registry import LAW, load_for, SWITCHING_TERM
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import (
    closed_loop,
    plant_start,
    post_update,
    reduce_signals,
    reduced_loop,
)
from masmc_ros.loop.law_dry_run import check
from masmc_ros.loop.plant_parameters import MEASUREMENT_DELAY, PHYSICS, RIGID
from masmc_ros.loop.reduction import axes_of_points, reduced_signals
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulated_robot import (
    delay_line,
    has_effects,
    stamp_age,
    write_plant,
    write_plants,
    write_start,
)
from masmc_ros.loop.timing import Timing
from masmc_ros.params.declaration import MutableValues, Parameter, Values
from masmc_ros.reference.trajectory import path_values, Trajectory
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.robot import robot_of
import numpy as np
from numpy.typing import ArrayLike, NDArray

BLOCK = 2_000
"""Ticks in memory at a time, with all lanes."""

_MOST_VECTORISED = 8
"""Number of positions of the largest robot whose lanes vectorise; a shortcut pays for those."""

_OF_ALL = {
    'plant': ('control_period', 'duration', 'integrator_step', 'command_interface', 'physics'),
    'controller': ('law', 'switching', 'command_interface', JOINT_LIMITS.name),
}
"""Parameters that must be equal in all lanes, by node; so must those of the path."""


class ValuesOfFirst:
    """Values of the first run, which all lanes have; other runs write those that differ."""

    def __init__(self) -> None:
        """Initialise without a run."""
        self._values: dict[str, ArrayLike] = {}

    def write(self, record: Records, name: str, value: ArrayLike, lane: int | None) -> None:
        """Write a value into a lane unless it is that of the first run, whose lane is None."""
        if lane is None:
            self._values[name] = value
        # Equal numbers may have different bits: 0 and -0.
        known = self._values[name]
        is_of_first = value is known or (isinstance(value, int) and value == known)
        if lane is None or not is_of_first:
            fill(record, name, value, lane)


class BatchRecords:
    """Records of closed loops of one law before their first tick, one run in each lane."""

    def __init__(self, runs: Sequence[Scenario]) -> None:
        """
        Initialise one run per lane.

        Parameters
        ----------
        runs
            Scenario of each run.

        Raises
        ------
        InputError
            If the runs cannot be computed together, or the law is not compiled.

        """
        _check_alike(runs)
        lanes, first = len(runs), runs[0]
        control = first.controller
        robot = first.robot
        mechanism = robot.mechanism
        law = load_for(LAW.of(control), mechanism)
        if not isinstance(law, Law):
            raise InputError(
                f'law = {LAW.of(control)}: it is plain Python, expected a compiled law'
            )
        if takes_rates(control):
            law = RATES
        self.mechanism = mechanism
        self.timing = Timing.from_values(first.plant)
        if self.timing.last is None:
            raise InputError('duration = 0.0: expected a length > 0 s')
        self._trajectory = _shared_trajectory(first.trajectory, self.timing.period)
        # Robots of other lengths have another reach.
        self._lengths = {robot_of(first.trajectory).geometry.tobytes()} | {
            robot_of(run.trajectory).geometry.tobytes()
            for run in runs[1:]
            if run.trajectory != first.trajectory
        }
        compensated = records.is_compensated(control)
        limited = records.is_limited(control, mechanism)
        settings, read = _law_settings(
            mechanism,
            law,
            SWITCHING_TERM.of(control),
            lanes,
            hybrid=is_hybrid(control),
            compensated=compensated,
            limited=limited,
        )
        self._settings = settings.copy()
        self._learned = records.law_memory(
            mechanism, law, lanes, compensated=compensated, limited=limited
        )
        self._plant = records.plant_settings(
            mechanism, lanes, has_effects=any(has_effects(run.plant) for run in runs)
        )
        self._state = records.plant_memory(mechanism, lanes)
        self._now = records.signals(mechanism, lanes)
        base, period, write = first.plant, self.timing.period, ValuesOfFirst().write
        if PHYSICS.of(base) != RIGID:
            raise InputError(
                f'plant.physics = {PHYSICS.of(base)}: expected {RIGID} for runs in one batch; '
                'masmc simulate computes single runs with other physics'
            )
        write_plant(self._plant, robot, period, base, None, write)
        write_start(self._state, robot, base, None, write)
        check_agreement(base, control)
        self._write_control(first, read, None)
        others = dict(enumerate(runs[1:], start=1))
        plants = {lane: run.plant for lane, run in others.items()}
        alone = write_plants(self._plant, self._state, plants, base, period, write)
        for lane, run in others.items():
            is_other = run.controller is not control and run.controller != control
            if is_other or lane in alone:
                check_agreement(run.plant, run.controller)
            is_later = MEASUREMENT_DELAY.of(run.plant) != MEASUREMENT_DELAY.of(base)
            if is_other or (compensated and is_later):
                self._write_control(run, read, lane)
        self._law, self._control = law, control

    def _write_control(
        self,
        run: Scenario,
        read: tuple[tuple[Parameter, str], ...],
        lane: int | None,
    ) -> None:
        """Write the controller of a run, `read` are the parameters of its law, into a lane."""
        plant, control = run.plant, run.controller
        period, nominal = self.timing.period, robot_of(control)
        records.write_law(self._settings, nominal, period, control, lane)
        records.write_parameters(self._settings, read, control, lane)
        if records.is_compensated(control):
            fill(self._settings, 'stamp_age', stamp_age(MEASUREMENT_DELAY.of(plant), period), lane)
        fill(self._learned, 'estimate', records.nominal_theta(nominal, control), lane)

    def _reference(self, first: int, count: int) -> Array:
        """
        Return the reference (count, 3 * axes) of ticks `first` to `first + count - 1`.

        Raises InputError if a robot of a run cannot reach it.
        """
        for lengths in self._lengths:
            _check_reach(self._trajectory, lengths, first, count)
        return _samples(self._trajectory, first, count)

    def whole_reference(self) -> Array:
        """Return the reference (n, 3 * axes) of all ticks; InputError as `_reference`."""
        assert self.timing.last is not None
        ticks = self.timing.last + 1
        return np.concatenate([
            self._reference(first, min(BLOCK, ticks - first)) for first in range(0, ticks, BLOCK)
        ])


class BatchSimulation(BatchRecords):
    """Closed loops of one law, one in each lane."""

    def __init__(self, runs: Sequence[Scenario]) -> None:
        """Initialise one run per lane; see `BatchRecords`."""
        super().__init__(runs)
        post_update(self._settings, self._learned)
        self._delayed = delay_line(self._plant, self.mechanism)
        self._shortcut = self._with_shortcut(self._law, self._control)

    def _with_shortcut(self, law: Law, control: Values) -> Records | None:
        """Return the settings with the shortcut of the reaching term; None without use for it."""
        name = shortcut_of(SWITCHING_TERM.of(control)) if law.uses_switching else ''
        is_special = is_hybrid(control) or records.is_compensated(control)
        if is_special or records.is_limited(control, self.mechanism):
            name = ''
        lanes = lanes_of(self._now)
        if not name or lanes == 1 or self.mechanism.sizes['positions'] > _MOST_VECTORISED:
            return None
        settings = records.law_settings(self.mechanism, law, name, lanes)
        take_over(settings, self._settings)
        return settings

    def run(self, block: int = BLOCK) -> Iterator[NDArray[np.void]]:
        """
        Yield the signals of the runs from the first to the last tick, `block` ticks at a time.

        These are records (n) of `loop.signals.SIGNALS` by (component, lane). A diverging run
        continues with numbers that are not finite and does not affect the others.
        """
        assert self.timing.last is not None
        ticks = self.timing.last + 1
        plant_start(self._plant, self._state, self._delayed, self._now)
        for first in range(0, ticks, block):
            count = min(block, ticks - first)
            signals = uninitialised(count, self._now)
            closed_loop(*self._ticks(first, count), signals)
            yield signals

    def reduce(
        self, start: int, end: int, settling: NDArray[np.float64], block: int = BLOCK
    ) -> NDArray[np.void]:
        """
        Compute the runs and return their reduced signals, a record of `loop.reduction.REDUCED`.

        No other signals are kept. Runs that diverged end early if all of them did.

        Parameters
        ----------
        start, end
            First tick of the window of the metrics, and the tick after its last one.
        settling
            Band of the settling time as a part of the first distance, and its minimum in m.
        block
            Number of ticks per call of the kernel.

        """
        assert self.timing.last is not None
        ticks = self.timing.last + 1
        reduced = reduced_signals(self.mechanism, lanes_of(self._now))
        points = axes_of_points(self.mechanism)
        if lanes_of(self._now) == 1:
            # By the kernel of single runs, which most users have compiled already.
            for k, signals in enumerate(self.run(block)):
                reduce_signals(reduced, signals, points, settling, k * block, start, end)
                if reduced['lost_tick'][0, 0] >= 0:
                    break
            return reduced
        plant_start(self._plant, self._state, self._delayed, self._now)
        for first in range(0, ticks, block):
            count = min(block, ticks - first)
            reduced_loop(
                *self._ticks(first, count),
                self._shortcut,
                reduced,
                points,
                settling,
                start,
                end,
            )
            if (reduced['lost_tick'] >= 0).all():
                break
        return reduced

    def _ticks(
        self, first: int, count: int
    ) -> tuple[
        Records,
        Records,
        Array,
        Records,
        Records,
        Records,
        int,
        bool,
        Array,
    ]:
        """Return the arguments of a kernel for ticks `first` to `first + count - 1`."""
        assert self.timing.last is not None
        return (
            self._plant,
            self._state,
            self._delayed,
            self._settings,
            self._learned,
            self._now,
            first,
            first + count == self.timing.last + 1,
            self._reference(first, count),
        )

    @property
    def estimate(self) -> NDArray[np.float64]:
        """Return the estimate of the base inertial parameters in the last tick."""
        estimate: NDArray[np.float64] = self._now[0]['estimate']
        return estimate


_trajectories: dict[object, Trajectory] = {}

_samples = lru_cache(maxsize=64)(Trajectory.unchecked)
"""Samples of blocks, which all batches of a campaign share: 0.2 MB for each block."""


@lru_cache(maxsize=64)
def _check_reach(trajectory: Trajectory, lengths: bytes, first: int, count: int) -> None:
    """Raise InputError if a robot of some lengths cannot reach the samples of a block."""
    trajectory.check_reach(np.frombuffer(lengths), first, _samples(trajectory, first, count))


def _shared_trajectory(values: Values, period: float) -> Trajectory:
    """Return a trajectory, the same object for equal paths of one type of robot."""
    robot = robot_of(values)
    key = (*path_values(values).items(), period, robot.mechanism)
    known = _trajectories.get(key)
    if known is None:
        if len(_trajectories) > 3:
            _trajectories.clear()
        known = _trajectories[key] = Trajectory(values, period, robot)
    return known


@lru_cache(maxsize=16)
def _law_settings(
    mechanism: Mechanism,
    law: Law,
    switching: str,
    lanes: int,
    *,
    hybrid: bool,
    compensated: bool,
    limited: bool,
) -> tuple[Records, tuple[tuple[Parameter, str], ...]]:
    """Return empty settings of a checked law, and the parameters to write into them."""
    check(law, mechanism, switching)
    settings = records.law_settings(
        mechanism,
        law,
        switching,
        lanes,
        is_hybrid=hybrid,
        compensated=compensated,
        limited=limited,
    )
    return settings, records.read_by(settings, mechanism)


def of_all_lanes(run: Scenario) -> MutableValues:
    """Return the values of a run that are equal in all lanes, by NODE.parameter or property."""
    names = {**_OF_ALL, 'trajectory': tuple(path_values(run.trajectory))}
    values = {f'{node}.{name}': run[node][name] for node in names for name in names[node]}
    return values | {'compensation of latency': records.is_compensated(run.controller)}


def keys_of(runs: Sequence[Scenario]) -> list[tuple[object, ...]]:
    """Return the values of `of_all_lanes` for each run; runs mostly share their nodes."""
    known: dict[tuple[object, ...], tuple[object, ...]] = {}
    keys = []
    for run in runs:
        plant = run.plant
        shared = id(run.controller), id(run.trajectory), *map(plant.get, _OF_ALL['plant'])
        if shared not in known:
            known[shared] = tuple(of_all_lanes(run).values())
        keys.append(known[shared])
    return keys


def _check_alike(runs: Sequence[Scenario]) -> None:
    equal = of_all_lanes(runs[0])
    for key in dict.fromkeys(keys_of(runs)):
        for (name, expected), value in zip(equal.items(), key, strict=True):
            if value != expected:
                raise InputError(
                    f'{name} = {value}: expected {expected}, as in the other runs that are '
                    'computed with it'
                )
