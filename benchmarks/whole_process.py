# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc simulate` as a whole process, against starting Python with NumPy and Numba."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import subprocess
import sys
import tempfile
import time

from benchmarks.measure import beside, Measure
from masmc_ros.share import shared_file


def seconds(command: list[str]) -> float:
    """Return how long a command takes."""
    begin = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


def measures(rounds: int = 5) -> Iterator[Measure]:
    """Yield medians."""
    begin = [sys.executable, '-c', 'import numpy, numba']
    reference = Measure('import numpy, numba', _median(begin, rounds), 's')
    yield reference
    simulate = [
        *(sys.executable, '-m', 'masmc_ros.cli.main', 'simulate'),
        str(shared_file('config', 'paper.yaml')),
    ]
    yield beside('masmc simulate', _median(simulate, rounds), 's', reference)
    with tempfile.TemporaryDirectory() as folder:
        simulate += ['--overwrite', '--output', str(Path(folder) / 'run.mcap')]
        yield beside('masmc simulate --output', _median(simulate, rounds), 's', reference)


def _median(command: list[str], rounds: int) -> float:
    seconds(command)  # once to no consequence: what it needs is compiled and cached
    return sorted(seconds(command) for _ in range(rounds))[rounds // 2]
