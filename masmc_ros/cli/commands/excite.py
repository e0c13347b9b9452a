# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc excite`: a motion that excites the parameters of a robot."""

from __future__ import annotations

import argparse
from pathlib import Path

from masmc_ros.cli import arguments
from masmc_ros.errors import InputError
from masmc_ros.files import check_absent, scenario_file
from masmc_ros.result_text import aligned, json_text
from masmc_ros.scenario.scenario import source_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Write a scenario in which all joints move so that masmc identify can determine their'
        ' parameters, within the limits of position, speed and torque.'
    )
    arguments.add_file(parser)
    arguments.add_settings(parser)
    text = 'parameter file to write'
    parser.add_argument('--output', metavar='FILE.yaml', required=True, help=text)
    text = 'duration of the motion in s (%(default)s)'
    parser.add_argument('--duration', type=float, default=30.0, help=text)
    text = 'largest deviation of a joint from its start in rad or m (%(default)s)'
    parser.add_argument('--amplitude', type=float, default=0.5, help=text)
    arguments.add_seed(parser, 'the search')
    arguments.add_overwrite(parser)
    arguments.add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Write the motion, and print its largest deviations and speeds."""
    output = Path(options.output)
    if output.suffix not in ('.yaml', '.yml'):
        raise InputError(f'--output {output}: expected a file *.yaml')
    check_absent(output, overwrite=options.overwrite)
    if not options.amplitude > 0.0:
        raise InputError(f'--amplitude {options.amplitude:g}: expected a number > 0')
    file = scenario_file(options.file)
    source = source_of(file, options.set)
    arguments.print_choices(source)
    scenario = source.scenario()
    # Imported here: the compiler takes time.
    from masmc_ros.identification.excitation import write_exciting

    excitation = write_exciting(
        output,
        scenario,
        options.file,
        duration=options.duration,
        amplitude=options.amplitude,
        seed=options.seed,
    )
    joints = scenario.mechanism.joints
    if options.json:
        motion = zip(joints, excitation.deviation, excitation.speed, strict=True)
        names = ('name', 'unit', 'largest_deviation', 'largest_speed')
        print(json_text({
            'joints': [
                dict(zip(names, (joint.name, joint.unit, *largest), strict=True))
                for joint, *largest in motion
            ],
            'condition_number': excitation.condition,
            'output': output,
        }))
        return 0
    rows = [['joint', 'largest deviation', 'largest speed']]
    for i, joint in enumerate(joints):
        rows.append([
            joint.name,
            f'{excitation.deviation[i]:.3g} {joint.unit}',
            f'{excitation.speed[i]:.3g} {joint.unit}/s',
        ])
    print('\n'.join(aligned(rows, {0}, rule=1)))
    print(f'condition number of the base parameters: {excitation.condition:.4g}')
    print(f'written: {output}; record a run of it, and pass the log to masmc identify')
    return 0
