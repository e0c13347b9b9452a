# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc simulate`: the closed loop of a parameter file or of a log, computed without ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
import math
from pathlib import Path
import shutil
import sys
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import is_log, read_run, Run
from masmc_ros.log.recover.overlap import check_apart
from masmc_ros.loop.signals import largest_slip
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.stretch import Change, Stretch
from masmc_ros.params.scenario import activation, load_scenario, logged_scenario, strays
from masmc_ros.report.measure.labels import law_label
from masmc_ros.report.measure.metrics import measure, second_half
from masmc_ros.report.measure.recomputed import Recomputed
from masmc_ros.report.measure.table import text_table
from masmc_ros.share import scenario_file
import numpy as np
from tqdm import tqdm

_PROGRESS_FROM = 200_000
"""Ticks from which a run takes long enough to show its progress."""


class _Source(NamedTuple):
    """Run to compute, and the logged run to compare it with, if there is one."""

    values: Mapping[str, Any]
    changes: Sequence[Change]
    files: Mapping[str, bytes]
    run: Run | None


def simulate(file: str, settings: Sequence[str], output: str | None, *, overwrite: bool) -> int:
    """
    Compute a run, log it if asked to, and print what it reached.

    The run of a log is computed again, with the changes of gains, resets and activations on
    its way, and compared with what the log says. A file's run is active from its first tick.
    """
    path = Path(output or '')
    if output is not None:
        _check_output(path, file, overwrite=overwrite)
    source = _source(file, settings)
    simulation = Simulation(source.values, source.changes)
    log: AbstractContextManager[Any] = nullcontext()
    if output is not None:
        # Who writes no log need not have what writes MCAP.
        from masmc_ros.log.write.simulated import SimulationLog

        log = SimulationLog(path, simulation, source.values, source.files)
    ticks = (simulation.timing.last or 0) + 1
    again = Recomputed(source.run) if source.run is not None else None
    errors: list[Any] = []
    torques: list[Any] = []
    active: list[Any] = []
    singular, slip = 0, 0.0
    progress = tqdm(total=ticks, unit='tick', disable=None if ticks > _PROGRESS_FROM else True)
    with log as writer, progress:
        for stretch in simulation.run():
            if writer is not None:
                writer.write(stretch)
                if not errors and ticks > _PROGRESS_FROM:
                    _tell_size(path, writer.size / len(stretch), ticks)
            if again is not None:
                again.compare(stretch, simulation.timing)
            errors.append(stretch.error)
            active.append(stretch.active)
            if not stretch.commands_rates:
                torques.append(stretch.torque)
            slip = max(slip, largest_slip(stretch.contact))
            singular += int(stretch.singular.sum())
            progress.update(len(stretch))
    _print_table(source, simulation, errors, torques, active, stretch)
    if again is not None:
        print(again.verdict(set_anew=bool(settings)))
    if output is not None:
        print(f'log: {output}')
    if len(simulation.plant.contact):
        print(f'fastest slip of a wheel: {1000.0 * slip:.3g} mm/s')
    if singular:
        print(
            f'warning: {simulation.plant.mechanism.lost} was close to singular at {singular} of '
            f'{ticks} ticks; motion '
            'along the lost direction is damped there',
            file=sys.stderr,
        )
    return 0


def _check_output(path: Path, file: str, *, overwrite: bool) -> None:
    """Raise InputError for a file that cannot or must not be written, before reading."""
    from masmc_ros.log.write.writer import check_log_path

    check_log_path(path)
    check_apart([path], [file])
    if path.exists() and not overwrite:
        raise InputError(f'{path}: is there already; add --overwrite to replace it')


def _tell_size(path: Path, per_tick: float, ticks: int) -> None:
    """Say how much a long run will write; InputError where the disk has not so much left."""
    expected = per_tick * ticks
    free = shutil.disk_usage(path.parent).free
    text = f'{path}: {ticks} ticks take about {_size_text(expected)}'
    if expected > free:
        raise InputError(
            f'{text}, of which the disk has {_size_text(free)} left; expected a shorter duration,'
            ' or fewer messages (controller.telemetry_decimation, plant.tf_decimation)'
        )
    print(text, file=sys.stderr)


def _size_text(size: float) -> str:
    steps = min(4, int(math.log(max(size, 1.0), 1000)))
    return f'{size / 1000**steps:.0f} {("B", "kB", "MB", "GB", "TB")[steps]}'


def _source(file: str, settings: Sequence[str]) -> _Source:
    if is_log(Path(file)):
        run = read_run(file)
        values, changes = logged_scenario(run, settings)
        return _Source(values, changes, run.attachments, run)
    file = scenario_file(file)
    values = load_scenario(file, settings)
    for line in strays(file, settings):
        print(line, file=sys.stderr)
    return _Source(values, activation(values), {file: Path(file).read_bytes()}, None)


def _print_table(
    source: _Source,
    simulation: Simulation,
    errors: Sequence[Any],
    torques: Sequence[Any],
    active: Sequence[Any],
    last: Stretch,
) -> None:
    error = np.concatenate(errors)
    times = np.arange(len(error), dtype=np.float64) * simulation.timing.period
    computed = np.concatenate(active)
    # Where rates were commanded there are no torques.
    torque = np.concatenate([np.zeros((0, len(simulation.plant.mechanism.joints))), *torques])
    reached = measure(
        times[computed],
        error[computed],
        times[: len(torque)],
        torque,
        last.estimate[-1:],
        second_half(times),
        points=simulation.plant.mechanism.points,
    )
    label = law_label(source.values['controller'])
    is_changed = any(change.values for change in source.changes)
    print(text_table({f'{label}, changed' if is_changed else label: reached}))
