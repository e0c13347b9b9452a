# SPDX-License-Identifier: Apache-2.0
"""`masmc simulate`: the closed loop of a parameter file, computed without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
import sys
from typing import Any

import numpy as np
from tqdm import tqdm

from masmc_ros.errors import InputError
from masmc_ros.log.simulated import SimulationLog
from masmc_ros.log.writer import check_log_path
from masmc_ros.loop.simulation import Simulation
from masmc_ros.nodes.scenario import load_scenario, strays
from masmc_ros.report.labels import law_label
from masmc_ros.report.metrics import measure, second_half
from masmc_ros.report.table import text_table

_PROGRESS_FROM = 200_000
"""Ticks from which a run takes long enough to show its progress."""


def simulate(file: str, settings: Sequence[str], output: str | None, *, overwrite: bool) -> int:
    """Compute a run, log it if asked to, and print what it reached."""
    values = load_scenario(file, settings)
    for line in strays(file):
        print(line, file=sys.stderr)
    simulation = Simulation(values)
    log: AbstractContextManager[Any] = nullcontext()
    if output is not None:
        check_log_path(Path(output))
        if Path(output).exists() and not overwrite:
            raise InputError(f'{output}: is there already; add --overwrite to replace it')
        log = SimulationLog(Path(output), simulation, values, Path(file))
    ticks = (simulation.timing.last or 0) + 1
    errors, torques, singular = [], [], 0
    progress = tqdm(total=ticks, unit='tick', disable=None if ticks > _PROGRESS_FROM else True)
    with log as writer, progress:
        for stretch in simulation.run():
            if writer is not None:
                writer.write(stretch)
            errors.append(stretch.error)
            torques.append(stretch.torque)
            singular += stretch.singular
            progress.update(len(stretch.torque))
    times = np.arange(ticks, dtype=np.float64) * simulation.timing.period
    reached = measure(
        times,
        np.concatenate(errors),
        times,
        np.concatenate(torques),
        stretch.estimate[-1:],
        second_half(times),
    )
    print(text_table({law_label(values['controller']): reached}))
    if output is not None:
        print(f'log: {output}')
    if singular:
        print(
            f'warning: the arm was close to singular at {singular} of {ticks} ticks; motion '
            'along the lost direction is damped there',
            file=sys.stderr,
        )
    return 0
