# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameter files of identified robots and of exciting motions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from masmc_ros.identification.identify import Identified, Nominal
from masmc_ros.identification.latency_fit import LatencyFit
from masmc_ros.identification.nominal import consistent_values
from masmc_ros.law.parts.delay_fields import LONGEST
from masmc_ros.output_files import write_file
from masmc_ros.params.declaration import Values
from masmc_ros.params.file import parameter_file_text
from masmc_ros.robot.declaration import URDF
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.scenario.node_parameters import declared


def write_identified(
    path: Path, nominal: Nominal, identified: Identified, source: str
) -> list[Path]:
    """
    Write the parameters of a controller that assumes the identified robot.

    Latency and motor lag beyond the range of the controller are comments only.

    Parameters
    ----------
    path
        Parameter file to write. For a robot from a URDF, another URDF is written next to it.
    nominal
        Nominal robot.
    identified
        Results of the identification.
    source
        Name of the run, for a comment.

    Returns
    -------
        Paths of the written files.

    """
    values = consistent_values(nominal, identified.values)
    values['model_scale'] = 1.0
    files = [path]
    if URDF in values:
        description = path.with_suffix('.urdf').resolve()
        write_file(description, values[URDF].encode())
        values[URDF] = str(description)
        files.append(description)
    timing = {'latency': identified.timing.latency, 'motor_lag': identified.timing.lag}
    reason = unwritten_timing(identified.timing)
    if not reason:
        known = {parameter.name for parameter in declared('controller', mechanism_from(values))}
        values |= {name: timing[name].value for name in timing.keys() & known}
    # The task is that of the exciting motion: the file follows one with the path and its task.
    values.pop('robot.task', None)
    comments = [f'Robot identified by masmc identify from {source}.'] + [
        f'{name}: {1e3 * estimate.value:.3f} ms, standard error {1e3 * estimate.error:.2g} ms'
        for name, estimate in timing.items()
    ]
    comments += [reason] * bool(reason)
    write_parameters(path, {'controller': values}, comments)
    return files


def unwritten_timing(timing: LatencyFit) -> str:
    """
    Return why latency and motor lag are not written, '' if they are.

    Each of them is right only with the other, so both are written or none.
    """
    if max(timing.latency.value, timing.lag.value) <= LONGEST:
        return ''
    return (
        f'latency = {1e3 * timing.latency.value:.3f} ms, motor lag = '
        f'{1e3 * timing.lag.value:.3f} ms: not written; expected at most {1e3 * LONGEST:g} ms '
        'each, the range of the controller'
    )


def write_parameters(
    path: Path, nodes: Mapping[str, Values], comments: list[str]
) -> None:
    """
    Write a ROS 2 parameter file.

    Parameters
    ----------
    path
        File to write.
    nodes
        Values by node, or by EVERY for all nodes, and by name.
    comments
        Lines of comments at the start of the file.

    """
    write_file(path, parameter_file_text(nodes, comments).encode())
