# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc simulate`: the closed loop of a parameter file or of a log, computed without ROS."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
import hashlib
import math
from pathlib import Path
import shlex
import shutil
import sys
from typing import NamedTuple

from masmc_ros.aliases import Array, Flags
from masmc_ros.cli import arguments
from masmc_ros.cli.compile_notice import compile_notice
from masmc_ros.cli.run_course import Course
from masmc_ros.errors import InputError
from masmc_ros.files import check_absent, scenario_file, scenarios
from masmc_ros.log.bag import check_apart
from masmc_ros.log.read.reader import is_log, read_run, Run
from masmc_ros.loop.plant_parameters import INITIAL_JOINTS
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.signals import largest_slip
from masmc_ros.loop.simulation import Simulation, TimedSimulation
from masmc_ros.loop.tick_block import Change
from masmc_ros.reference.reference import SampledTrajectory
from masmc_ros.report.measure.labels import law_label
from masmc_ros.report.measure.metrics import chatter_notes, MetricSamples
from masmc_ros.report.measure.recomputed import logged_responses, Recomputed
from masmc_ros.report.measure.table import json_table, text_table
from masmc_ros.result_text import json_text, WIDTH
from masmc_ros.scenario.scenario import (
    activation,
    logged_scenario,
    logged_trajectory,
    lowest_limits,
    source_of,
)
import numpy as np
from tqdm import tqdm

_PROGRESS_FROM = 200_000
"""Ticks from which a run takes long enough to show its progress."""


class _Source(NamedTuple):
    """Run to compute, and the logged run to compare it with, if there is one."""

    scenario: Scenario
    changes: Sequence[Change]
    files: Mapping[str, bytes]
    run: Run | None = None
    samples: SampledTrajectory | None = None


class _ListScenarios(argparse.Action):
    """Option that lists the installed parameter files and ends the command."""

    def __call__(
        self, parser: argparse.ArgumentParser, options: argparse.Namespace, *_: object
    ) -> None:
        if options.json:
            print(json_text({'scenarios': scenarios()}))
        else:
            for name, path in scenarios().items():
                print(f'{name}  {path}')
        parser.exit()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Compute the closed loop of a parameter file or URDF, bitwise identical to the nodes; or'
        ' compute the run of a log again, and compare.'
    )
    arguments.add_file(parser, ', a URDF, or the log of a run')
    text = 'list the installed parameter files; --json before it prints JSON'
    parser.add_argument('--list', action=_ListScenarios, nargs=0, help=text)
    arguments.add_settings(parser)
    arguments.add_path(parser)
    parser.add_argument('--output', metavar='RUN.mcap', help='log the run into this file')
    arguments.add_overwrite(parser)
    arguments.add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Compute a run, log it with `--output`, and print its metrics.

    The run of a log is computed with its changes of gains, resets and activations, and compared
    with the log. The run of a parameter file is active from its first tick.
    """
    path = None if options.output is None else Path(options.output)
    log: AbstractContextManager[SimulationLog | None] = nullcontext()
    if path is not None:
        _check_output(path, options.file, overwrite=options.overwrite)
    source = _source(options.file, options.set)
    responses = None if source.run is None else logged_responses(source.run, source.scenario)
    if responses is None:
        simulation = Simulation(source.scenario, source.changes, source.samples)
    else:
        simulation = TimedSimulation(source.scenario, source.changes, source.samples, responses)
    mechanism = simulation.plant.mechanism
    limits = np.array(lowest_limits(source.scenario))
    start = np.array(INITIAL_JOINTS.of(source.scenario.plant))
    for note in (*mechanism.notes, *mechanism.start_warnings(start, limits.tolist())):
        print(f'warning: {note}', file=sys.stderr)
    if simulation.trajectory.note:
        print(simulation.trajectory.note, file=sys.stderr)
    if path is not None:
        # Imported here: a run without a log does not need the packages that write MCAP.
        from masmc_ros.log.write.simulated import SimulationLog

        log = SimulationLog(path, simulation, source.scenario, source.files)
    ticks = (simulation.timing.last or 0) + 1
    comparison = None if source.run is None else Recomputed(source.run, responses)
    errors: list[Array] = []
    # If velocities are commanded, there are no torques.
    torques: list[Array] = [np.zeros((0, len(mechanism.joints)))]
    active: list[Flags] = []
    singular, ended, slip = 0, 0, 0.0
    digest = hashlib.sha256()
    course = Course(mechanism, limits, ticks, simulation.timing.period)
    ends = np.zeros(len(mechanism.joints), dtype=np.bool_)
    progress = tqdm(total=ticks, unit='tick', disable=None if ticks > _PROGRESS_FROM else True)
    label = law_label(source.scenario.controller)
    notice = compile_notice(f'{label} for {mechanism.name}')
    with log as writer, progress, notice:
        for block in simulation.run():
            if writer is not None:
                writer.write(block)
                if not errors and ticks > _PROGRESS_FROM:
                    _print_size(options.output, writer.size / len(block), ticks)
            if comparison is not None:
                comparison.compare(block, simulation.timing)
            if options.json:
                digest.update(block.signals.tobytes())
            errors.append(block.error)
            active.append(block.active)
            if not block.commands_rates:
                torques.append(block.torque)
            course.add(block)
            slip = max(slip, largest_slip(block.contact))
            is_singular = block.singular[:, 0] != 0
            at_end = mechanism.at_range_ends(block.position[is_singular, -len(ends):])
            ends |= at_end.any(axis=0)
            ended += int(at_end.any(axis=1).sum())
            singular += int(is_singular.sum())
            progress.update(len(block))
    samples = MetricSamples.of_ticks(
        np.concatenate(errors),
        np.concatenate(torques),
        simulation.timing.period,
        mechanism.points,
        active=np.concatenate(active),
        estimate=block.estimate[-1:],
    )
    if any(change.values for change in source.changes):
        label = f'{label}, changed'
    metrics = {label: samples.metrics()}
    chatter = chatter_notes(
        samples.torque, samples.torques(), source.scenario.values, mechanism.joints
    )
    has_contact = len(simulation.plant.contact) > 0
    limited = simulation.controller.limited_ticks
    if options.json:
        print(json_text({
            **json_table(metrics),
            'ticks': ticks,
            'singular_ticks': singular - ended,
            'range_end_ticks': ended,
            'joint_limited_ticks': limited,
            **course.counts(),
            'fastest_slip': slip if has_contact else None,
            'chatter': chatter[0] if chatter else None,
            'signals_sha256': digest.hexdigest(),
            'recomputed': None if comparison is None else comparison.counts(),
            'log': path,
        }))
    else:
        print(text_table(metrics, WIDTH))
        if comparison is not None:
            print(comparison.verdict(is_changed=bool(options.set)))
        if path is not None:
            print(f'log: {path}')
        if has_contact:
            print(f'fastest slip of a wheel: {1000.0 * slip:.3g} mm/s')
        if sys.stdout is not None and sys.stdout.isatty():
            print(f'next: {_next_step(options.file, path)}')
    if limited:
        print(
            f'warning: joint limits changed the torque at {limited} of {ticks} ticks',
            file=sys.stderr,
        )
    if ended:
        print(
            f'warning: {mechanism.range_ends_text(ends)} at {ended} of {ticks} ticks; motion for'
            ' the task stops there',
            file=sys.stderr,
        )
    if singular > ended:
        print(
            f'warning: {mechanism.lost} was close to singular at {singular - ended} of {ticks}'
            ' ticks;'
            ' motion along the lost direction is damped there',
            file=sys.stderr,
        )
    for text in (*course.warnings(), *chatter):
        print(f'warning: {text}', file=sys.stderr)
    return 0


def _next_step(file: str, log: Path | None) -> str:
    """Return the command that shows the run, for a person at a terminal."""
    if log is not None:
        return f'masmc report {shlex.quote(str(log))}, or masmc view for an animation'
    if is_log(Path(file)):
        return f'masmc report {shlex.quote(file)}'
    return f'masmc play {shlex.quote(file)}, or --output run.mcap for masmc report run.mcap'


def _check_output(path: Path, file: str, *, overwrite: bool) -> None:
    """Raise InputError for a file that cannot or must not be written, before reading."""
    from masmc_ros.log.write.writer import check_log_path

    check_log_path(path)
    check_apart([path], [file])
    check_absent(path, overwrite=overwrite)


def _print_size(path: str, per_tick: float, ticks: int) -> None:
    """Print the expected size of a log; InputError if the disk has less space."""
    expected = per_tick * ticks
    free = shutil.disk_usage(Path(path).parent).free
    text = f'{path}: {ticks} ticks take about {_size_text(expected)}'
    if expected > free:
        raise InputError(
            f'{text}; the disk has only {_size_text(free)} left; use a shorter duration, or fewer'
            ' messages (controller.telemetry_decimation, plant.tf_decimation)'
        )
    print(text, file=sys.stderr)


def _size_text(size: float) -> str:
    steps = min(4, int(math.log(max(size, 1.0), 1000)))
    return f'{size / 1000**steps:.0f} {("B", "kB", "MB", "GB", "TB")[steps]}'


def _source(file: str, settings: Sequence[str]) -> _Source:
    if is_log(Path(file)):
        logged = read_run(file)
        samples = logged_trajectory(logged, settings)
        return _Source(*logged_scenario(logged, settings), logged.attachments, logged, samples)
    file = scenario_file(file)
    source = source_of(file, settings)
    scenario = source.scenario()
    arguments.print_choices(source)
    for line in source.strays():
        print(line, file=sys.stderr)
    name = file if source.defaults is None else str(Path(file).with_suffix('.yaml'))
    return _Source(scenario, activation(scenario), {name: source.text})
