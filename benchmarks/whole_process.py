# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Duration of the process `masmc simulate`, compared with an import of NumPy and Numba."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import subprocess
import sys
import tempfile
import time

from benchmarks.measure import compared, Measure
from masmc_ros.files import shared_file


def seconds(command: list[str]) -> float:
    """Return the duration of a command in s."""
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def measures(rounds: int = 5) -> Iterator[Measure]:
    """Yield median durations."""
    imports = [sys.executable, '-c', 'import numpy, numba']
    reference = Measure('import numpy, numba', _median(imports, rounds), 's')
    yield reference
    simulate = [
        *(sys.executable, '-m', 'masmc_ros.cli.main', 'simulate'),
        str(shared_file('config', 'paper.yaml')),
    ]
    yield compared('masmc simulate', _median(simulate, rounds), 's', reference)
    with tempfile.TemporaryDirectory() as folder:
        simulate += ['--overwrite', '--output', str(Path(folder) / 'run.mcap')]
        yield compared('masmc simulate --output', _median(simulate, rounds), 's', reference)


def _median(command: list[str], rounds: int) -> float:
    seconds(command)  # not measured: this run compiles and fills the caches
    return sorted(seconds(command) for _ in range(rounds))[rounds // 2]
