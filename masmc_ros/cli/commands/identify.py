# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc identify`: latency, friction and inertial parameters of a robot from a logged run."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from masmc_ros.cli.arguments import add_json, add_overwrite
from masmc_ros.errors import InputError
from masmc_ros.files import check_absent
from masmc_ros.log.read.reader import read_run
from masmc_ros.result_text import aligned, json_text, WIDTH
from masmc_ros.robot.declaration import Coordinate

if TYPE_CHECKING:
    from masmc_ros.identification.identify import Identified
    from masmc_ros.identification.latency_fit import LatencyFit
    from masmc_ros.identification.payload import Load

_FARTHEST = 0.5
"""Standard error of a centre of mass in m from which the motion did not determine it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Identify latency, motor lag, friction and inertial parameters of a robot from the states'
        ' and commanded torques of a run.'
    )
    parser.add_argument('log', metavar='RUN.mcap', help='logged run with commanded torques')
    text = 'parameter file of the nominal robot (default: that of the controller in the log)'
    parser.add_argument('--nominal', metavar='FILE', help=text)
    text = 'another run, whose torques are compared with those of the identified robot'
    parser.add_argument('--check', metavar='RUN.mcap', help=text)
    text = 'write a parameter file for the controller, and a URDF next to it if it has one'
    parser.add_argument('--output', metavar='FILE.yaml', help=text)
    add_overwrite(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Identify the robot of a run, print the results, and write a parameter file."""
    output = None if options.output is None else Path(options.output)
    if output is not None:
        if output.suffix not in ('.yaml', '.yml'):
            raise InputError(f'--output {output}: expected a file *.yaml')
        check_absent(output, overwrite=options.overwrite)
        check_absent(output.with_suffix('.urdf'), overwrite=options.overwrite)
    # Imported here: the compiler and the solvers take time.
    from masmc_ros.files import scenario_file
    from masmc_ros.identification.identify import (
        base_parameters,
        identify,
        measured,
        relative_error,
        unexcited,
    )
    from masmc_ros.identification.parameter_file import (
        nominal_of,
        nominal_of_run,
        unwritten_timing,
        write_identified,
    )
    from masmc_ros.identification.payload import payload_of
    from masmc_ros.identification.samples import samples_of
    from masmc_ros.scenario.scenario import load_scenario

    logged = read_run(options.log)
    samples = samples_of(logged)
    if options.nominal is None:
        nominal = nominal_of_run(logged)
    else:
        nominal = nominal_of(load_scenario(scenario_file(options.nominal)).controller)
    joints = logged.mechanism.joints
    if len(joints) != len(nominal.robot.mechanism.joints):
        raise InputError(
            f'{options.nominal}: a robot of {len(nominal.robot.mechanism.joints)} joints; '
            f'expected {len(joints)}, as in {options.log}'
        )
    equations = measured(nominal.robot, samples, options.log)
    result = identify(nominal, equations)
    timing, unwritten = result.timing, unwritten_timing(result.timing)
    base = base_parameters(nominal.robot, result.scale)
    weak = [direction.text for direction in unexcited(result, base)]
    payload = payload_of(nominal, nominal.robot.payload_factors, equations, result)
    load = payload.load if payload.is_significant else None
    missing: list[float] | None = None
    if options.check is not None:
        other = measured(nominal.robot, samples_of(read_run(options.check)), options.check)
        acting = other.torque(timing.latency.value, timing.lag.value)
        missing = relative_error(acting, other.predicted(result.values)).tolist()
    files: Sequence[Path] = ()
    try:
        if output is not None:
            files = write_identified(output, nominal, result, options.log)
    finally:
        # The results are not lost if they cannot be written, such as on a full disk.
        if options.json:
            print(json_text({
                'parameters': _parameter_rows(result),
                'joints': [
                    {
                        'name': joint.name,
                        'nominal_unexplained': result.nominal_residual[i],
                        'unexplained': result.residual[i],
                        'check_unexplained': None if missing is None else missing[i],
                    }
                    for i, joint in enumerate(joints)
                ],
                'timing': {
                    name: {**estimate._asdict(), 'unit': 's'}
                    for name, estimate in timing._asdict().items()
                },
                'timing_unwritten': unwritten or None,
                'effective_parameters': base.shape[1],
                'excited_parameters': base.shape[1] - len(weak),
                'not_excited': weak,
                'payload': None if load is None else {
                    **load._asdict(),
                    'unexplained': payload.residual.max(),
                },
                'files': files,
            }))
        else:
            print('\n'.join([*_parameters(result), '', *_joints(joints, result), '']))
            _print_timing(timing, unwritten)
            print(
                f'{base.shape[1]} of {len(result.values)} combinations of parameters have an'
                f' effect on a motion; this one excited {base.shape[1] - len(weak)}'
            )
            for direction in weak:
                print(fill(f'not excited: {direction}', WIDTH, subsequent_indent='  '))
            if load is not None:
                _print_payload(load, payload.residual.max())
            if missing is not None:
                _print_check(options.check, joints, missing)
    if files and not options.json:
        print(f'written: {", ".join(map(str, files))}')
    return 0


def _print_timing(timing: LatencyFit, unwritten: str) -> None:
    """Print latency and motor lag, and why they are not written."""
    for name, estimate in zip(('latency', 'motor lag', 'sum of both'), timing, strict=True):
        print(f'{name}: {1e3 * estimate.value:.3f} ± {1e3 * estimate.error:.2g} ms')
    if unwritten:
        print(fill(unwritten, WIDTH, subsequent_indent='  '))


def _print_payload(load: Load, residual: float) -> None:
    """Print a payload, and the part of the torques that it does not explain."""
    place = ', '.join(
        f'{x:.3f} ± {error:.2g}' if error < _FARTHEST else 'unknown'
        for x, error in zip(load.centre, load.centre_error, strict=True)
    )
    print(fill(
        f'payload, if only the last link differs from the nominal robot: {load.mass:.3f} ± '
        f'{load.mass_error:.2g} kg at [{place}] m in its frame; unexplained torque '
        f'{100.0 * residual:.2g} %', WIDTH, subsequent_indent='  ',
    ))


def _print_check(log: str, joints: Sequence[Coordinate], missing: Sequence[float]) -> None:
    """Print the parts of the torques of another run that the identified robot does not explain."""
    parts = ', '.join(
        f'{joint.name} {100.0 * error:.2g} %'
        for joint, error in zip(joints, missing, strict=True)
    )
    print(fill(f'torques of {log}, RMS error: {parts}', WIDTH, subsequent_indent='  '))


def _parameter_rows(result: Identified) -> list[dict[str, object]]:
    """Return the parameters for JSON."""
    return [
        {
            'name': name,
            'unit': result.units[i],
            'nominal': result.nominal[i],
            'identified': result.values[i],
            'standard_error': result.errors[i],
            'is_excited': result.is_excited[i],
        }
        for i, name in enumerate(result.names)
    ]


def _parameters(result: Identified) -> list[str]:
    """Return the table of the parameters."""
    rows = [['parameter', 'nominal', 'identified', 'std. error', 'unit', 'excited']]
    for i, name in enumerate(result.names):
        numbers = (result.nominal[i], result.values[i])
        rows.append([
            name,
            *(f'{number:.5g}' for number in numbers),
            f'{result.errors[i]:.2g}',
            result.units[i],
            'yes' if result.is_excited[i] else 'no',
        ])
    return aligned(rows, {0, 4, 5}, rule=1)


def _joints(joints: Sequence[Coordinate], result: Identified) -> list[str]:
    """Return the table of the torques that the robots do not explain."""
    rows = [['unexplained torque', 'nominal (%)', 'identified (%)']]
    for i, joint in enumerate(joints):
        numbers = (result.nominal_residual[i], result.residual[i])
        rows.append([joint.name, *(f'{100.0 * number:.3g}' for number in numbers)])
    return aligned(rows, {0}, rule=1)
