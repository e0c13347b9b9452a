# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Runs of a campaign on an accelerator, as many at once as fill it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import lru_cache, partial
from typing import Any

from masmc_ros.aliases import AnyArray, Records
from masmc_ros.campaign.part import CPU, OpenDevice
from masmc_ros.errors import InputError
from masmc_ros.jit.record import AT_RUN_TIME, lanes_of
from masmc_ros.law.command_interface import takes_rates
from masmc_ros.loop.batch_simulation import BatchRecords, BLOCK
from masmc_ros.loop.plant_parameters import RIGID
from masmc_ros.loop.reduction import axes_of_points, reduced_signals
from masmc_ros.loop.simulated_robot import delay_line_shape
from masmc_ros.native.accelerator import Accelerator, DeviceMemoryError, named
from masmc_ros.native.gpu_code import places_of, thread_code, words_of
from masmc_ros.params.declaration import Values
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.reduced import metrics_of_lane, ReducedWindow, SETTLING
from masmc_ros.robot.mechanisms import mechanism_from
import numpy as np

WORD = 8
"""Bytes of a number."""


class DeviceBatch(BatchRecords):
    """Closed loops of one law on a device, one run in each thread."""

    def __init__(self, runs: Sequence[Mapping[str, Values]]) -> None:
        """Initialise one run per thread; see `BatchRecords`."""
        super().__init__(runs)
        self._reduced = reduced_signals(self.mechanism, len(runs))
        self._has_torques = not takes_rates(runs[0]['controller'])
        self._records = {
            'settings': self._settings, 'memory': self._learned, 'plant_settings': self._plant,
            'plant_memory': self._state, 'signals': self._now, 'reduced': self._reduced,
        }  # fmt: skip

    def metrics(
        self, device: Accelerator, is_stopped: Callable[[], bool] = lambda: False
    ) -> list[Metrics | float] | None:
        """
        Compute the runs; None if `is_stopped`, which is called between blocks, returned True.

        Metrics are those of `report.measure.reduced.reduced_metrics`. Raises DeviceMemoryError if
        the memory of the device does not suffice, InputError if the law cannot leave Python.
        """
        window = ReducedWindow.of(self.timing)
        with device.lock:
            device.enter()
            launch = _loaded(device, self._records)
            results = self._computed(device, launch, window, is_stopped)
        if results is None:
            return None
        reduced, signals = results
        return [
            metrics_of_lane(
                reduced[0],
                lane,
                window,
                self.mechanism,
                has_torques=self._has_torques,
                estimate=signals[0]['estimate'][:, lane],
            )
            for lane in range(lanes_of(self._now))
        ]

    def _computed(
        self,
        device: Accelerator,
        launch: Callable[..., None],
        window: ReducedWindow,
        is_stopped: Callable[[], bool],
    ) -> tuple[Records, Records] | None:
        """Return the reduced signals, and the signals of the last tick; None if stopped."""
        last, lanes = self.timing.last, lanes_of(self._now)
        assert last is not None
        reference = self.whole_reference()
        places, words = places_of(self._records)
        delayed = delay_line_shape(self._plant, self.mechanism)
        with ExitStack() as stack:

            def allocated(size: int, values: AnyArray | None = None) -> int:
                address = device.allocate(size)
                stack.callback(device.release, address)
                if values is not None:
                    device.upload(address, values)
                return address

            numbers = allocated(WORD * words * lanes)
            line = allocated(WORD * int(np.prod(delayed)))
            desired, points, settling = (
                allocated(values.nbytes, np.ascontiguousarray(values))
                for values in (reference, axes_of_points(self.mechanism), SETTLING)
            )
            for name, record in self._records.items():
                device.upload(numbers + WORD * places[name] * lanes, _words(record))
            for first in range(0, last + 1, BLOCK):
                if is_stopped():
                    return None
                count = min(BLOCK, last + 1 - first)
                launch(
                    lanes, numbers, line, desired + first * reference[0].nbytes, points, settling,
                    lanes, delayed[0], first, count, last, window.first, window.after,
                )  # fmt: skip
            reduced, signals = self._reduced.copy(), self._now.copy()
            for name, record in (('reduced', reduced), ('signals', signals)):
                device.download(numbers + WORD * places[name] * lanes, _words(record))
        return reduced, signals


class Device:
    """Accelerator that computes runs of campaigns, see `campaign.part.Device`."""

    def __init__(self, accelerator: Accelerator) -> None:
        """Initialise the device."""
        self._accelerator = accelerator
        self.most_runs = accelerator.most_runs

    def metrics(
        self, runs: Sequence[Mapping[str, Values]], is_stopped: Callable[[], bool]
    ) -> list[Metrics | float] | None:
        """
        Return the metrics of runs, or None if stopped; see `DeviceBatch.metrics`.

        A batch that does not fit into the memory of the device is divided.
        """
        try:
            return DeviceBatch(runs).metrics(self._accelerator, is_stopped)
        except DeviceMemoryError:
            half = len(runs) // 2
        if not half:
            raise InputError(
                f'device {self._accelerator.name}: its memory does not suffice for one run; '
                'expected more free memory, a shorter run or shorter delays'
            )
        metrics: list[Metrics | float] = []
        for part in (runs[:half], runs[half:]):
            results = self.metrics(part, is_stopped)
            if results is None:
                return None
            metrics += results
        return metrics

    def check(self, run: Mapping[str, Values]) -> None:
        """Raise InputError if a run has invalid values, or if its robot cannot reach its path."""
        BatchRecords([run]).whole_reference()

    def check_plant(self, plant: Values) -> None:
        """Raise InputError for a robot or a plant that devices do not compute."""
        if AT_RUN_TIME in mechanism_from(plant).sizes:
            raise InputError(
                'robot.urdf: a GPU has no records of robots from URDF files; expected device cpu, '
                "or the paper's robot"
            )
        if plant['physics'] != RIGID:
            raise InputError(
                f'plant.physics = {plant["physics"]}: expected {RIGID}, or device cpu'
            )


def device_option(name: str) -> OpenDevice | None:
    """
    Return the function that opens a device on the machine that computes; None for `cpu`.

    Names are those of `accelerator.named`. The function raises InputError without the device.
    """
    return None if name == CPU else partial(_opened, name)


@lru_cache(maxsize=8)
def _opened(name: str) -> Device:
    return Device(named(name))


def _words(record: Records) -> AnyArray:
    """Return the bytes of the numbers of a record, without the tags after them."""
    return record.view(np.uint8)[:WORD * words_of(record) * lanes_of(record)]


def _loaded(device: Accelerator, records: Mapping[str, Records]) -> Callable[..., None]:
    """Return the kernel for records of any number of lanes on a device."""
    of_a_run = {name: np.zeros(1, _of_one_lane(record.dtype)) for name, record in records.items()}
    key = tuple(str(record.dtype.descr) for record in of_a_run.values())
    if key not in device.functions:
        desired = len(records['signals'][0]['reference'])
        try:
            device.functions[key] = device.load(thread_code(of_a_run, desired))
        except InputError as error:
            raise InputError(f'device {device.name}: {error}; or device cpu') from None
    return device.functions[key]


def _of_one_lane(kind: np.dtype[Any]) -> np.dtype[Any]:
    """Return the type of a record with one lane instead of many."""
    assert kind.fields is not None
    members: list[Any] = []
    for name in kind.names or ():
        member = kind.fields[name][0]
        shape = (*member.shape[:-1], 1) if member.shape else ()
        members.append((name, member.base, shape))
    return np.dtype(members, align=True)
