# SPDX-License-Identifier: Apache-2.0
"""`masmc simulate`: the closed loop of a parameter file, computed without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
import sys
from typing import Any

from tqdm import tqdm

from masmc_ros.errors import InputError
from masmc_ros.log.simulated import SimulationLog
from masmc_ros.loop.simulation import Simulation
from masmc_ros.nodes.scenario import load_scenario, strays

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
    import numpy as np
    e=np.concatenate(errors); t=np.concatenate(torques); n=len(e)-1; w=slice(n//2,n)
    print(np.sqrt((e[w,:2]**2).sum(1).mean())*1e3, np.sqrt((e[w,2:]**2).sum(1).mean())*1e3, np.abs(np.diff(t[w],axis=0)).sum()/((n-n//2)*simulation.timing.period))
    if output is not None:
        print(f'log: {output}')
    if singular:
        print(
            f'warning: the arm was close to singular at {singular} of {ticks} ticks; motion '
            'along the lost direction is damped there',
            file=sys.stderr,
        )
    return 0
