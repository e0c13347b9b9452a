# SPDX-License-Identifier: Apache-2.0
"""`masmc simulate` as a whole process, its log written, against starting Python with NumPy."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys
import tempfile
import time

from masmc_ros.share import shared_file


def seconds(command: list[str]) -> float:
    """Return how long a command takes."""
    begin = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


def main(rounds: int = 5) -> None:
    """Print medians."""
    with tempfile.TemporaryDirectory() as folder:
        simulate = [
            *(sys.executable, '-m', 'masmc_ros.cli.main', 'simulate'),
            *(str(shared_file('config', 'paper.yaml')), '--overwrite'),
            *('--output', str(Path(folder) / 'run.mcap')),
        ]
        seconds(simulate)
        whole = sorted(seconds(simulate) for _ in range(rounds))[rounds // 2]
    start = sorted(
        seconds([sys.executable, '-c', 'import numpy, numba']) for _ in range(rounds)
    )[rounds // 2]
    print(
        f'masmc simulate config/paper.yaml --output run.mcap: {whole:.2f} s as a process '
        f'({whole / start:.1f} times importing NumPy and Numba)'
    )


if __name__ == '__main__':
    main()
