# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc compare`: laws on the same scenario and seeds, and their limits."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from masmc_ros.campaign.runs import scenario_of
from masmc_ros.cli import arguments
from masmc_ros.cli.arguments import print_choices
from masmc_ros.compare import contenders, results
from masmc_ros.compare.law_comparison import by_error, compared, comparison_of
from masmc_ros.compare.tables import as_json, page, text
from masmc_ros.errors import InputError, require_rclpy
from masmc_ros.files import check_folder, make_folder, scenario_file, write_file
from masmc_ros.result_text import WIDTH
from masmc_ros.scenario.scenario import source_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Run laws on the same scenario and seeds: ranked by error, with effort and chattering,'
        ' also with noise, delay, 100 Hz, a wrong model and limits.'
    )
    arguments.add_file(parser)
    parser.add_argument(
        '--laws',
        default='all',
        metavar='LAW,...',
        help='LAW or LAW:SWITCHING, separated by commas; or all (%(default)s)',
    )
    parser.add_argument(
        contenders.OPTION,
        action='append',
        default=[],
        metavar='FILE.py:NAME',
        help='controller from elsewhere: a function of (state, reference) that returns torques,'
        f' or a class of such objects; or {contenders.TOPICS}NAME, a node that answers states on'
        ' ROS topics; repeatable',
    )
    parser.add_argument(
        results.OPTION,
        action='append',
        default=[],
        metavar=results.FILE,
        help='results of another comparison with the same conditions; repeatable',
    )
    parser.add_argument(
        '--trials',
        default='all',
        metavar='TRIAL,...',
        help='trials in addition to the unmodified scenario (%(default)s); laws: periods of 1, 2'
        ' and 10 ms, with and without limits and disturbance estimate; hardware: latency, motor'
        ' lag, encoders, stiction and further properties of real robots',
    )
    parser.add_argument(
        '--seeds',
        type=arguments.count,
        default=1,
        metavar='N',
        help='runs of each: seed 0 is the scenario, others draw robot, disturbance and noise '
        '(%(default)s)',
    )
    arguments.add_settings(parser)
    arguments.add_path(parser)
    arguments.add_output(parser, 'compare')
    arguments.add_workers(parser)
    arguments.add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Compute the runs of all laws in all trials, print the tables and write them."""
    file = scenario_file(options.file)
    print_choices(source_of(file, options.set))
    with _controllers(options, file) as controllers:
        return _compare(options, file, controllers)


@contextmanager
def _controllers(
    options: argparse.Namespace, file: str
) -> Iterator[dict[str, contenders.Controller]]:
    """Yield the controllers from elsewhere by name; one may be a node."""
    of_files = [text for text in options.controller if not text.startswith(contenders.TOPICS)]
    controllers = contenders.loaded_controllers(of_files)
    nodes = [text for text in options.controller if text.startswith(contenders.TOPICS)]
    if not nodes:
        yield controllers
        return
    name = nodes[0].removeprefix(contenders.TOPICS)
    if len(nodes) > 1 or not name.isidentifier() or name in controllers:
        given = ' '.join(f"{contenders.OPTION} '{text}'" for text in nodes)
        raise InputError(f'{given}: expected one {contenders.TOPICS}NAME with a name of its own')
    require_rclpy()
    from masmc_ros.nodes.topic_controller import topic_controller

    robot = scenario_of(file, options.set).plant
    with topic_controller(name, robot) as controller:
        yield {**controllers, name: controller}


def _compare(
    options: argparse.Namespace, file: str, controllers: dict[str, contenders.Controller]
) -> int:
    comparison = comparison_of(
        file, options.set, options.laws, options.trials, options.seeds, controllers
    )
    trials, points = comparison.trials, comparison.mechanism.points
    folder = Path(options.output)
    check_folder(folder)
    added = {name: results.loaded(name, comparison) for name in options.add}
    ranked = compared(comparison, threads=options.threads, scheduler=options.scheduler)
    own = results.as_json(comparison, ranked) + '\n'
    for name, entries in added.items():
        ranked = results.joined(name, entries, ranked)
    ranked = by_error(ranked, trials[0].name)
    data = as_json(ranked, trials) + '\n'
    contents = {
        'compare.html': page(ranked, trials, points, Path(file).name),
        'compare.txt': text(ranked, trials, points),
        'compare.json': data,
        results.FILE: own,
    }
    try:
        make_folder(folder)
        for name, content in contents.items():
            write_file(folder / name, content.encode())
    finally:
        # The results are not lost if they cannot be written, such as on a full disk.
        print(data if options.json else text(ranked, trials, points, WIDTH) + '\n', end='')
    if not options.json:
        print(f'report: {folder}/ ({", ".join(contents)})')
    return 0
