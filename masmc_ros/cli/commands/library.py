# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc library`: a controller as a static library for programs without Python."""

from __future__ import annotations

import argparse
from pathlib import Path
import re

from masmc_ros.cli.arguments import add_file, add_json, add_output, add_overwrite, add_settings
from masmc_ros.files import scenario_file
from masmc_ros.native.targets import TARGETS
from masmc_ros.result_text import with_sizes
from masmc_ros.scenario.scenario import load_scenario

_DEFAULT = tuple(TARGETS)[:1]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Write the controller and the simulated robot of a parameter file as a static library'
        ' with a C header and an example. They compute the bits of masmc simulate without Python.'
    )
    add_file(parser)
    add_settings(parser)
    add_output(parser, 'library')
    text = 'beginning of all names in C (the name of the file)'
    parser.add_argument('--name', default='', help=text)
    text = f'processor: {", ".join(TARGETS)} ({_DEFAULT[0]}); repeatable'
    parser.add_argument(
        '--target', action='append', choices=tuple(TARGETS), metavar='TARGET', help=text
    )
    text = 'add the package of a controller for ros2_control, in the folder NAME_controller'
    parser.add_argument('--ros2-control', action='store_true', help=text)
    add_overwrite(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Write the library, and print its files."""
    file = scenario_file(options.file)
    name = options.name or re.sub(r'\W', '_', Path(file).stem, flags=re.ASCII)
    scenario = load_scenario(file, options.set)
    # Imported here: the compiler takes time.
    from masmc_ros.native.library import write_library
    from masmc_ros.native.ros2_control import package_name

    targets = {target: TARGETS[target] for target in options.target or _DEFAULT}
    folder = Path(options.output)
    paths = write_library(
        folder, name, scenario, targets, overwrite=options.overwrite,
        ros2_control=options.ros2_control,
    )  # fmt: skip
    print(with_sizes(paths, as_json=options.json))
    if not options.json:
        print(f'Try it: make -C {folder} && cd {folder} && ./example')
        if options.ros2_control:
            package = package_name(name)
            print(
                f'Copy {folder / package} into the src folder of a workspace, then'
                f' colcon build --packages-select {package}'
            )
    return 0
