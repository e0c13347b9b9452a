# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc preview`: margins of a path to the limits of the robot, before it is followed."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from textwrap import fill
from typing import Any

from masmc_ros.aliases import Array
from masmc_ros.cli import arguments
from masmc_ros.cli.arguments import print_choices
from masmc_ros.cli.compile_notice import compile_notice
from masmc_ros.errors import InputError
from masmc_ros.files import check_absent, scenario_file, write_file
from masmc_ros.log.bag import check_apart
from masmc_ros.reference.path_file import csv_text
from masmc_ros.report.draw.path_figures import preview_figure
from masmc_ros.report.draw.style import figure_file, FORMATS, paper_style
from masmc_ros.report.measure.path_preview import (
    fastest_samples,
    PathError,
    Preview,
    preview,
    sufficient_slowdown,
)
from masmc_ros.result_text import aligned, json_text, WIDTH
from masmc_ros.scenario.scenario import source_of
import numpy as np


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Check a path before the robot follows it: reach, singularities, ranges, speeds,'
        ' accelerations and torques of the nominal robot, and the slow-down that suffices. Exit'
        ' status 1 if a limit is exceeded.'
    )
    arguments.add_file(parser, ', or a URDF')
    arguments.add_settings(parser)
    arguments.add_path(parser)
    parser.add_argument(
        '--output', metavar='FILE.png', help=f'figure, with the suffix {", ".join(FORMATS)}'
    )
    parser.add_argument(
        '--fastest', metavar='FILE.csv',
        help='write the path with the fastest timing within speeds and --acceleration (toppra)',
    )  # fmt: skip
    parser.add_argument(
        '--acceleration', type=arguments.positive, default=1.0, metavar='A',
        help='largest acceleration of the joints for --fastest, rad/s² or m/s² (%(default)s)',
    )  # fmt: skip
    arguments.add_overwrite(parser)
    arguments.add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Print the margins; return 1 if a limit is exceeded."""
    file = scenario_file(options.file)
    picture = None if options.output is None else Path(options.output)
    if picture is not None and picture.suffix[1:] not in FORMATS:
        raise InputError(
            f'--output {picture}: expected a name that ends with .{", .".join(FORMATS)}'
        )
    timed = None if options.fastest is None else Path(options.fastest)
    if timed is not None and timed.suffix != '.csv':
        raise InputError(f'--fastest {timed}: expected a name that ends with .csv')
    for path in filter(None, (picture, timed)):
        check_apart([path], [file])
        check_absent(path, overwrite=options.overwrite)
    source = source_of(file, options.set)
    scenario = source.scenario()
    print_choices(source)
    seen, slowdown = None, None
    with compile_notice('the preview'):
        try:
            seen = preview(scenario)
        except PathError as error:
            violations = [str(error)]
        else:
            violations = seen.violations()
            slowdown = sufficient_slowdown(scenario, seen) if violations else None
    fastest = None
    if timed is not None and seen is not None:
        times, samples = fastest_samples(seen, options.acceleration)
        write_file(timed, csv_text(seen.mechanism, times, samples).encode())
        fastest = {'duration': float(times[-1]), 'file': timed}
    if picture is not None and seen is not None:
        with paper_style():
            write_file(picture, figure_file(preview_figure(seen), picture.suffix[1:]))
    result = {
        'start': None if seen is None else float(seen.times[0]),
        'end': None if seen is None else float(seen.times[-1]),
        'joints': [] if seen is None else _joints(seen),
        'points': [] if seen is None else _points(seen),
        'singular_ticks': None if seen is None else int(seen.is_singular.sum()),
        'note': '' if seen is None else seen.note,
        'violations': violations,
        'slowdown': slowdown,
        'figure': None if seen is None else picture,
        'fastest': fastest,
    }
    print(json_text(result) if options.json else _text(result))
    return 1 if violations else 0


def _at(seen: Preview, values: Array) -> float:
    """Return the time in s of the largest of values (n)."""
    return float(seen.times[int(np.argmax(values))])


def _points(seen: Preview) -> list[dict[str, Any]]:
    """Return the largest distance of each point from its path, and its time in s."""
    return [
        {
            'symbol': point.symbol,
            'unit': point.unit,
            'error': float(seen.distance(point).max()),
            'error_at': _at(seen, seen.distance(point)),
        }
        for point in seen.mechanism.points
    ]


def _joints(seen: Preview) -> list[dict[str, Any]]:
    """Return the smallest margins and largest values of each joint, and their times in s."""
    speeds = seen.mechanism.speed_limits
    rows = []
    for k, joint in enumerate(seen.mechanism.joints):
        margin = seen.range_margin[:, k]
        speed, change, torque = (
            np.abs(values[:, k]) for values in (seen.velocity, seen.acceleration, seen.torque)
        )
        rows.append({
            'name': joint.name,
            'unit': joint.unit,
            'torque_unit': joint.effort_unit,
            'range_margin': _finite(float(margin.min())),
            'range_margin_at': _at(seen, -margin),
            'speed': float(speed.max()),
            'speed_limit': _finite(speeds[k]),
            'speed_at': _at(seen, speed),
            'acceleration': float(change.max()),
            'acceleration_at': _at(seen, change),
            'torque': float(torque.max()),
            'torque_limit': _finite(float(seen.torque_limits[k])),
            'torque_at': _at(seen, torque),
        })
    return rows


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _text(result: dict[str, Any]) -> str:
    lines = [result['note']] if result['note'] else []
    lines += [f'exceeded: {text}' for text in result['violations']] or ['within all limits']
    table: list[str] = []
    if result['joints']:
        table = _table(result)
        errors = ', '.join(
            f'{point["symbol"]} {1e3 * point["error"]:.3g} m{point["unit"]} at '
            f'{point["error_at"]:.3g} s'
            for point in result['points']
        )
        lines.insert(0, f'largest distance from the path: {errors}')
        if result['violations']:
            slowdown = result['slowdown']
            lines.append(
                'no slow-down that was tried suffices; change the path'
                if slowdown is None
                else f'slow-down that suffices: {slowdown:g} times the duration'
            )
    if result['figure'] is not None:
        lines.append(f'figure: {result["figure"]}')
    if result['fastest'] is not None:
        lines.append(
            f'fastest timing: {result["fastest"]["duration"]:.4g} s in {result["fastest"]["file"]}'
        )
    return '\n'.join([
        *table,
        *(fill(line, WIDTH, subsequent_indent='  ', break_on_hyphens=False) for line in lines),
    ])


def _table(result: dict[str, Any]) -> list[str]:
    """Return the lines of the table of the joints, with an empty one at its end."""
    rows = [['joint', 'to range end', 'speed', 'acceleration', 'torque']]
    for joint in result['joints']:
        unit = joint['unit']
        units = {
            'speed': f'{unit}/s',
            'acceleration': f'{unit}/s²',
            'torque': joint['torque_unit'],
        }
        margin = '-'
        if joint['range_margin'] is not None:
            margin = f'{joint["range_margin"]:.3g} {unit} ({joint["range_margin_at"]:.3g} s)'
        used = (_used(joint, quantity, of_value) for quantity, of_value in units.items())
        rows.append([joint['name'], margin, *used])
    return [
        f'nominal robot on the path from {result["start"]:.3g} s to {result["end"]:.3g} s; '
        'largest values',
        '',
        *aligned(rows, range(len(rows[0])), rule=1, width=WIDTH),
        '',
    ]


def _used(joint: dict[str, Any], quantity: str, unit: str) -> str:
    """Return the largest value of a quantity, as a part of its limit if there is one."""
    value, limit = joint[quantity], joint.get(f'{quantity}_limit')
    time = f'({joint[f"{quantity}_at"]:.3g} s)'
    if limit is None:
        return f'{value:.3g} {unit} {time}'
    return f'{100.0 * value / limit:.3g} % of {limit:.3g} {unit} {time}'
