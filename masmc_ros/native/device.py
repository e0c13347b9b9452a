# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Runs of a campaign, and robots driven from outside, on an accelerator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from itertools import accumulate
from typing import Any
import weakref

from masmc_ros.aliases import AnyArray, Array, Flags, Integers, Records
from masmc_ros.campaign.runs import CPU
from masmc_ros.errors import InputError
from masmc_ros.jit.record import AT_RUN_TIME, lanes_of, places_of
from masmc_ros.law.command_interface import takes_rates
from masmc_ros.loop.batch_simulation import BatchRecords, BLOCK
from masmc_ros.loop.driven_robots import DrivenRobots, OF_STATE
from masmc_ros.loop.plant_parameters import PHYSICS, RIGID
from masmc_ros.loop.reduction import axes_of_points, reduced_signals
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulated_robot import (
    delay_line_shape,
    has_effects,
    NO_STATE,
    write_plants,
)
from masmc_ros.native.accelerator import Accelerator, DeviceMemoryError, named
from masmc_ros.params.declaration import Values
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.reduced import metrics_of_lane, ReducedWindow, SETTLING
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import robot_of
import numpy as np
from numpy.typing import NDArray

WORD = 8
"""Bytes of a number."""

_STAGED = 256
"""Number of robots that start in one launch; a processor prepares them for longer."""


class DeviceRuns:
    """
    Records of runs in the memory of a device, one run in each column, and their kernel.

    The caller holds the lock of the device. The memory is released with the object.
    """

    def __init__(
        self, device: Accelerator, records: Mapping[str, Records], line: tuple[int, int, int],
        constants: Sequence[AnyArray], window: tuple[int, int], staged: int = 0,
    ) -> None:  # fmt: skip
        """
        Initialise runs that have not started.

        Parameters
        ----------
        device
            Accelerator.
        records
            Records by name as for `thread_code`, with any number of lanes.
        line
            Shape of the delay line, whose last number is that of the runs.
        constants
            Reference (n, 3 * axes) of all ticks, `axes_of_points`, and band of the settling time.
        window
            First tick of the window of the metrics, and the tick after its last one.
        staged
            Number of runs of a separate memory from which runs start; 0: in their own columns.

        Raises
        ------
        DeviceMemoryError
            With the largest number of runs, if the free memory does not suffice.
        InputError
            If the law cannot leave Python.

        """
        self._device, self.lanes = device, line[2]
        self._records = {name: _of_one_lane(record) for name, record in records.items()}
        self._places, words = places_of(self._records)
        self._launch = _loaded(device, self._records)
        shared = [staged * words, *(values.size for values in constants)]
        sizes = [words, line[0] * line[1], 1, 1]
        most = (device.free_memory() // WORD - sum(shared)) // sum(sizes)
        if most < self.lanes:
            raise DeviceMemoryError(most)
        numbers = [*(size * self.lanes for size in sizes), *shared]
        first = device.allocate(WORD * sum(numbers))
        self.release = weakref.finalize(self, device.release, first)
        places = accumulate((WORD * number for number in numbers[:-1]), initial=first)
        self._words, self._line, self._numbers, self._ticks, own, *addresses = places
        self._staged = own if staged else self._words
        for address, values in zip(addresses, constants, strict=True):
            device.upload(address, np.ascontiguousarray(values))
        self._further = self._line, line[0], *addresses, *window

    def start(self, records: Mapping[str, Records]) -> None:
        """Upload the records of runs that start in the next launch."""
        for name, record in records.items():
            place = self._staged + WORD * self._places[name] * lanes_of(record)
            self._device.upload(place, _numbers_of(record))

    def compute(
        self, ticks: Integers, count: int, last: int = 0, numbers: Integers | None = None
    ) -> None:
        """
        Compute ticks of runs.

        Parameters
        ----------
        ticks
            First tick of each run; -1: it starts, -2: it is skipped.
        count
            Number of ticks.
        last
            Last tick of a closed loop, after which the robot does not move.
        numbers
            Numbers of the runs of `start`; None: all runs.

        """
        source = self._words if numbers is None else self._staged
        numbers = np.arange(self.lanes) if numbers is None else numbers
        self._device.upload(self._numbers, numbers)
        self._device.upload(self._ticks, ticks)
        self._launch(
            len(ticks), source, self._words, self.lanes, self._numbers, self._ticks, count, last,
            *self._further,
        )  # fmt: skip

    def _place(self, record: str, field: str) -> int:
        fields = self._records[record].dtype.fields
        assert fields is not None
        return self._words + self.lanes * (WORD * self._places[record] + fields[field][1])

    def write(self, record: str, field: str, values: AnyArray) -> None:
        """Write a field (components, runs) of a record."""
        self._device.upload(self._place(record, field), np.ascontiguousarray(values))

    def read(self, record: str, field: str) -> NDArray[Any]:
        """Return a field (components, runs), or (runs), of a record."""
        kind = self._records[record].dtype[field]
        values = np.empty((*kind.shape[:-1], self.lanes), kind.base)
        self._device.download(self._place(record, field), values)
        return values

    def reduced(self) -> dict[str, NDArray[Any]]:
        """Return the fields of the reduced signals."""
        names = self._records['reduced'].dtype.names or ()
        return {name: self.read('reduced', name) for name in names}

    def content(self) -> AnyArray:
        """Return a copy of all records, and of the delay line."""
        content = np.empty(self._numbers - self._words, np.uint8)
        self._device.download(self._words, content)
        return content

    def restore(self, content: AnyArray) -> None:
        """Continue from a `content` with the same number of runs and no longer delays."""
        self._device.upload(self._words, content)


class DeviceBatch(BatchRecords):
    """Closed loops of one law on a device, one run in each thread."""

    def metrics(
        self, device: Accelerator, is_stopped: Callable[[], bool] = lambda: False
    ) -> list[Metrics | float] | None:
        """
        Compute the runs; None if `is_stopped`, which is called between blocks, returned True.

        Metrics are those of `report.measure.reduced.reduced_metrics`. Raises DeviceMemoryError if
        the memory of the device does not suffice, InputError if the law cannot leave Python.
        """
        lanes, last = lanes_of(self._now), self.timing.last
        assert last is not None
        window, robot = ReducedWindow.of(self.timing), self.mechanism
        records = {
            'settings': self._settings, 'plant_settings': self._plant, 'memory': self._learned,
            'plant_memory': self._state, 'signals': self._now,
            'reduced': reduced_signals(robot, lanes),
        }  # fmt: skip
        line = delay_line_shape(self._plant, robot)
        constants = self.whole_reference(), axes_of_points(robot), SETTLING
        with device.entered():
            runs = DeviceRuns(device, records, line, constants, (window.first, window.after))
            runs.start(records)
            for first in range(-1, last + 1, BLOCK):
                if is_stopped():
                    return None
                runs.compute(np.full(lanes, first), BLOCK, last)
            reduced, estimate = runs.reduced(), runs.read('signals', 'estimate')
            runs.release()
        has_torques = not takes_rates(self._control)
        return [
            metrics_of_lane(
                reduced, lane, window, robot, has_torques=has_torques, estimate=estimate[:, lane]
            )
            for lane in range(lanes)
        ]


class DeviceRobots(DrivenRobots):
    """Driven robots on a device, one in each thread; its own records are those of one robot."""

    def __init__(
        self, open_device: Callable[[], Device], scenario: Scenario, lanes: int, *,
        path: Array, window: tuple[int, int], settling: Array,
    ) -> None:  # fmt: skip
        """
        Initialise the robots, which have not started.

        Parameters
        ----------
        open_device
            Function by `device_option`.
        scenario, lanes, path, window, settling
            As for `DrivenRobots`.

        Raises
        ------
        InputError
            If the device is missing, does not compute such robots, or has not enough memory.

        """
        open_device().check_plant(scenario.plant)
        super().__init__(scenario, 1, path=path, window=window, settling=settling)
        self._open, self._scenario = open_device, scenario
        self.tick, self._reduced = np.zeros(lanes, np.int64), dict[str, NDArray[Any]]()
        self._runs = self._opened()

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes with a copy of the memory of the device."""
        with self._device.entered():
            return {**super().__getstate__(), '_runs': self._runs.content()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Open the device and continue from a copy."""
        self.__dict__.update(state)
        self._runs = self._opened(state['_runs'])

    @property
    def _device(self) -> Accelerator:
        return self._open().accelerator

    def _opened(self, content: AnyArray | None = None) -> DeviceRuns:
        """Return the memory of all robots, with a `DeviceRuns.content`."""
        lanes, line = len(self.tick), (*self._delayed.shape[:2], len(self.tick))
        constants = self._path, self._points, self._settling
        with self._device.entered() as device:
            try:
                runs = DeviceRuns(device, _of(self), line, constants, self._window, _STAGED)
            except DeviceMemoryError as error:
                raise InputError(
                    f'{lanes} robots: device {device.name} has free memory for '
                    f'{max(0, *error.args)}; expected at most this number'
                ) from None
            if content is not None:
                runs.restore(content)
        return runs

    def start(self, runs: Mapping[int, Scenario]) -> None:
        """Start robots at tick 0; see `DrivenRobots.start`."""
        places = list(runs)
        for first in range(0, len(places), _STAGED):
            part = places[first:first + _STAGED]
            self._start(np.array(part), [runs[place] for place in part])

    def _start(self, places: Integers, runs: Sequence[Scenario]) -> None:
        new = DrivenRobots(
            self._scenario, len(runs), path=self._path, window=self._window,
            settling=self._settling,
        )  # fmt: skip
        plants = {place: run.plant for place, run in enumerate(runs)}
        write_plants(new._plant, new._memory, plants, self._scenario.plant, self._period)
        lengths = [robot_of(run.controller).geometry for run in runs]
        new._nominal['geometry'][0] = np.transpose(lengths)
        form = self._plant.dtype, len(self._delayed)
        if any(has_effects(run.plant) for run in runs):
            self._add_effects()
        self._lengthen(delay_line_shape(new._plant, self.mechanism)[0])
        if form != (self._plant.dtype, len(self._delayed)):
            with self._device.entered():
                content = self._runs.content()
                self._runs.release()
            self._runs = self._opened(content)
        with self._device.entered():
            self._runs.start(_of(new))
            self._runs.compute(np.full(len(runs), -1), 1, numbers=places)
            states = [self._runs.read('signals', name)[:, places] for name in OF_STATE]
        self.tick[places] = 0
        if not all(np.isfinite(state).all() for state in states):
            raise InputError(NO_STATE)

    def step(self, torque: Array, moves: Flags) -> None:
        """Hold torques for one control period; see `DrivenRobots.step`."""
        with self._device.entered():
            self._runs.write('signals', 'torque', torque.T)
            self._runs.compute(np.where(moves, self.tick, -2), 1)
        self.tick[moves] += 1
        self._reduced = {}

    def values(self, record: str, field: str) -> AnyArray:
        """Return a field (robots, components) of a record."""
        with self._device.entered():
            return self._runs.read(record, field).T

    def reduction(self) -> Mapping[str, NDArray[Any]]:
        """Return the fields of the reduced signals by (component, robot)."""
        if not self._reduced:
            with self._device.entered():
                self._reduced = self._runs.reduced()
        return self._reduced


class Device:
    """Accelerator that computes runs of campaigns, see `campaign.part.Device`."""

    def __init__(self, accelerator: Accelerator) -> None:
        """Initialise the device."""
        self.accelerator, self.most_runs = accelerator, accelerator.most_runs

    def metrics(
        self, runs: Sequence[Scenario], is_stopped: Callable[[], bool]
    ) -> list[Metrics | float] | None:
        """
        Return the metrics of runs, or None if stopped; see `DeviceBatch.metrics`.

        A batch that does not fit into the memory of the device is divided.
        """
        try:
            return DeviceBatch(runs).metrics(self.accelerator, is_stopped)
        except DeviceMemoryError as error:
            most = min(len(runs) // 2, *error.args)
        if most < 1:
            raise InputError(
                f'device {self.accelerator.name}: its memory does not suffice for one run; '
                'expected more free memory, a shorter run or shorter delays'
            )
        metrics: list[Metrics | float] = []
        for first in range(0, len(runs), most):
            part = self.metrics(runs[first:first + most], is_stopped)
            if part is None:
                return None
            metrics += part
        return metrics

    def check(self, run: Scenario) -> None:
        """Raise InputError if a run has invalid values, or if its robot cannot reach its path."""
        BatchRecords([run]).whole_reference()

    def check_plant(self, plant: Values) -> None:
        """Raise InputError for a robot or a plant that devices do not compute."""
        if AT_RUN_TIME in mechanism_from(plant).sizes:
            raise InputError(
                'robot.urdf: a GPU has no records of robots from URDF files; expected device cpu, '
                "or the paper's robot"
            )
        if PHYSICS.of(plant) != RIGID:
            raise InputError(
                f'plant.physics = {PHYSICS.of(plant)}: expected {RIGID}, or device cpu'
            )


def device_option(name: str) -> Callable[[], Device] | None:
    """
    Return the function that opens a device on the machine that computes; None for `cpu`.

    Names are those of `accelerator.named`. The function raises InputError without the device.
    """
    return None if name == CPU else partial(_opened, name)


@lru_cache(maxsize=8)
def _opened(name: str) -> Device:
    return Device(named(name))


def _of(robots: DrivenRobots) -> dict[str, Records]:
    """Return the records of driven robots for `gpu_code.thread_code`."""
    return {
        'nominal': robots._nominal, 'plant_settings': robots._plant, 'tracked': robots.tracked,
        'plant_memory': robots._memory, 'signals': robots.signals, 'reduced': robots.reduced,
    }  # fmt: skip


def _numbers_of(record: Records) -> AnyArray:
    """Return the bytes of the numbers of a record, without the tags after them."""
    return record.view(np.uint8)[:WORD * places_of({'': record})[1]]


def _of_one_lane(record: Records) -> Records:
    """Return an empty record with one lane instead of many."""
    kind, members = record.dtype, list[Any]()
    for name in kind.names or ():
        shape = kind[name].shape
        members.append((name, kind[name].base, (*shape[:-1], 1) if shape else ()))
    return np.zeros(1, np.dtype(members, align=True))


def _loaded(device: Accelerator, records: Mapping[str, Records]) -> Callable[..., None]:
    """Return the kernel for records of one lane on a device."""
    key = tuple(str(record.dtype.descr) for record in records.values())
    if key not in device.functions:
        from masmc_ros.native.gpu_code import thread_code  # the start of commands is faster

        desired = len(records['signals'][0]['reference'])
        try:
            device.functions[key] = device.load(thread_code(records, desired))
        except InputError as error:
            raise InputError(f'device {device.name}: {error}; or device cpu') from None
    return device.functions[key]
