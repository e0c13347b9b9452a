# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A long run at 1 kHz: memory and open files of every node, `python -m benchmarks.soak [SECONDS]`.

Ends with status 1 where a node ends by itself or not cleanly, keeps more than a little memory
after it has warmed up, or leaves files open. With `--hostile`, random requests and messages are
sent to all nodes meanwhile, and some nodes are killed: see `hostile_soak.py`.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import tempfile
import time

from benchmarks.live_nodes import end, memory, realtime_nodes

NODES = ('trajectory', 'controller', 'plant', 'recorder')
SAMPLES = 60
WARM = 0.25
"""Part of the run after which memory must be flat; queues and caches are filled by then."""

MOST_GROWTH = 0.05
"""Largest growth of memory after that, as a part of it."""


def _files(pid: int) -> int:
    return len(list(Path(f'/proc/{pid}/fd').iterdir()))


def soak(seconds: float) -> bool:
    """Run, print a line for each node, and return True if all is well."""
    sizes: dict[str, list[float]] = {node: [] for node in NODES}
    files: dict[str, list[int]] = {node: [] for node in NODES}
    with (
        tempfile.TemporaryDirectory() as folder,
        realtime_nodes(Path(folder), 0.001, *NODES) as processes,
    ):
        begin = time.monotonic()
        for sample in range(1, SAMPLES + 1):
            time.sleep(max(0.0, begin + seconds * sample / SAMPLES - time.monotonic()))
            for node, process in processes.items():
                if process.poll() is not None:
                    print(f'{node} ended by itself with status {process.returncode}')
                    return False
                sizes[node].append(memory(process.pid))
                files[node].append(_files(process.pid))
        statuses = end(processes)
        size = (Path(folder) / 'run.mcap').stat().st_size
    is_well = True
    first = int(SAMPLES * WARM)
    for node in NODES:
        before, after = sizes[node][first], sizes[node][-1]
        fine = (
            statuses[node] == 0
            and after <= before * (1.0 + MOST_GROWTH)
            and files[node][-1] <= files[node][first]
        )
        is_well &= fine
        print(
            f'{node:>10}: {before:.1f} MiB after {seconds * WARM:.0f} s, {after:.1f} MiB after '
            f'{seconds:.0f} s; {files[node][first]} and {files[node][-1]} open files; '
            f'status {statuses[node]}{"" if fine else "  <- not well"}'
        )
    print(f'{size / 2**20:.0f} MiB recorded')
    return is_well


def main() -> int:
    """Run what the command line says; return the exit status."""
    parser = argparse.ArgumentParser(prog='python -m benchmarks.soak', description='A long run.')
    parser.add_argument(
        'seconds',
        nargs='?',
        type=float,
        default=600.0,
        help='length of the run in s (%(default)s)',
    )
    parser.add_argument(
        '--hostile', action='store_true', help='send random input and kill nodes meanwhile'
    )
    hostile = parser.add_argument_group('with --hostile')
    hostile.add_argument(
        '--seed', type=int, default=None, help='seed of the random input (by default a new one)'
    )
    hostile.add_argument(
        '--period', type=float, default=0.002, help='control period in s (%(default)s)'
    )
    hostile.add_argument(
        '--wheel-speed',
        type=float,
        default=60.0,
        help='largest speed of a wheel in rad/s (%(default)s)',
    )
    hostile.add_argument(
        '--arm-speed',
        type=float,
        default=25.0,
        help='largest speed of a joint of the arm in rad/s (%(default)s)',
    )
    hostile.add_argument(
        '--laws',
        default='rasmc,smc',
        help='control laws to change among; each must be compiled once (%(default)s)',
    )
    options = parser.parse_args()
    if not options.hostile:
        return 0 if soak(options.seconds) else 1
    from benchmarks.hostile_soak import hostile_soak, Options

    seed = time.time_ns() % 2**31 if options.seed is None else options.seed
    is_well = hostile_soak(
        Options(
            seconds=options.seconds,
            seed=seed,
            period=options.period,
            wheel_speed=options.wheel_speed,
            arm_speed=options.arm_speed,
            laws=tuple(options.laws.split(',')),
        )
    )
    return 0 if is_well else 1


if __name__ == '__main__':
    sys.exit(main())
