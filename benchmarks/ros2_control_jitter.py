# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Jitter of a generated controller: `python -m benchmarks.ros2_control_jitter [SECONDS]`.

The figures are lateness and duration of `update` at 1 kHz, next to busy loops. The harness of the
tests calls it from clock_nanosleep, as the controller manager does.
Each run is repeated with SCHED_FIFO if `chrt` may set it. benchmarks/real_time.py has the same
figures of the Python node.
"""

from __future__ import annotations

import os
from pathlib import Path
import re
import subprocess
import sys
from tempfile import TemporaryDirectory

from benchmarks.busy import busy
from masmc_ros.native.library import write_library
from masmc_ros.native.targets import TARGETS
from masmc_ros.scenario.scenario import load_scenario
import numpy as np

ROOT = Path(__file__).parents[1]
SOURCES = ROOT / 'test' / 'native' / 'ros2_control'
PAPER = str(ROOT / 'config' / 'paper.yaml')
DURATION = 'duration=2.0'
HEADER = r'#include "((?!paper).*\.hpp)"'
"""Headers of ROS 2 that the generated sources include."""

FIFO = ('chrt', '--fifo', '80')


def built(folder: Path, scenario: str = PAPER) -> Path:
    """
    Write a package into a folder, and return the harness, compiled with stand-in headers.

    `scenario` is a parameter file; the name of the package is paper_controller.
    """
    target = f'{os.uname().machine}-linux-gnu'
    targets = {target: TARGETS[target]}
    write_library(
        folder, 'paper', load_scenario(scenario, (DURATION,)), targets,
        overwrite=True, ros2_control=True,
    )  # fmt: skip
    package = folder / 'paper_controller'
    sources = [package / 'src/controller.cpp', package / 'include/paper_controller/controller.hpp']
    for source in sources:
        for name in re.findall(HEADER, source.read_text('utf-8')):
            stand_in = folder / 'include' / name
            stand_in.parent.mkdir(parents=True, exist_ok=True)
            stand_in.write_text('#include "stand_in.hpp"\n', 'utf-8')
    includes = (folder / 'include', SOURCES, package / 'include', package / 'library')
    subprocess.run(
        [
            'c++', '-std=c++17', '-O2', '-Wall', '-Wextra', '-Werror',
            *(f'-I{include}' for include in includes),
            '-o', folder / 'harness', SOURCES / 'harness.cpp', sources[0],
            package / 'library' / target / 'libpaper.a', '-ldl',
        ],
        check=True,
    )  # fmt: skip
    return folder / 'harness'


def main() -> None:
    """Measure and print the distributions."""
    seconds = sys.argv[1] if len(sys.argv) > 1 else '20'
    may_fifo = subprocess.run([*FIFO, 'true'], capture_output=True).returncode == 0
    with TemporaryDirectory() as name:
        harness = built(Path(name))
        path = Path(name) / 'paper_controller' / 'path' / 'reference.bin'
        print(f'{"":34}  lateness in µs: median, 99 %, 99.9 %, largest; duration: median, 99.9 %')
        for loops in (0, 1, 2 * len(os.sched_getaffinity(0))):
            for prefix in ((), FIFO) if may_fifo else ((),):
                command = [*prefix, harness, 'jitter', path, seconds]
                with busy(loops):
                    run = subprocess.run(command, capture_output=True, check=True)
                late, spent = np.frombuffer(run.stdout, np.int64).reshape(-1, 2).T / 1e3
                figures = [*np.percentile(late, (50, 99, 99.9, 100)),
                           *np.percentile(spent, (50, 99.9))]  # fmt: skip
                label = f'{loops} busy loops, {"SCHED_FIFO" if prefix else "default priority"}'
                print(f'{label:34}  {"  ".join(f"{figure:8.1f}" for figure in figures)}')
    if not may_fifo:
        print('chrt may not set SCHED_FIFO here')


if __name__ == '__main__':
    main()
