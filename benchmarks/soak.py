# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Long run at 1 kHz with memory and open files of nodes: `python -m benchmarks.soak [SECONDS]`.

The exit status is 1 if a node ends unexpectedly or with an error. Growing memory after the warm-up
and open files at the end also cause it. With `--hostile` a client sends random requests and
messages to all nodes, and some nodes are killed: see `hostile_soak.py`. With `--fight` clients
compete for the reference: see `fighting_clients.py`.
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
"""Share of the run after which memory must be constant; queues and caches are filled then."""

LARGEST_GROWTH = 0.05
"""Largest growth of memory after that time, as a share of it."""


def _files(pid: int) -> int:
    return len(list(Path(f'/proc/{pid}/fd').iterdir()))


def soak(seconds: float) -> bool:
    """Run, print a line for every node, and return True on success."""
    sizes: dict[str, list[float]] = {node: [] for node in NODES}
    files: dict[str, list[int]] = {node: [] for node in NODES}
    with (
        tempfile.TemporaryDirectory() as folder,
        realtime_nodes(Path(folder), 0.001, *NODES) as processes,
    ):
        start = time.monotonic()
        for sample in range(1, SAMPLES + 1):
            time.sleep(max(0.0, start + seconds * sample / SAMPLES - time.monotonic()))
            for node, process in processes.items():
                if process.poll() is not None:
                    print(f'{node} ended unexpectedly with status {process.returncode}')
                    return False
                sizes[node].append(memory(process.pid))
                files[node].append(_files(process.pid))
        statuses = end(processes)
        size = (Path(folder) / 'run.mcap').stat().st_size
    is_well = True
    first = int(SAMPLES * WARM)
    for node in NODES:
        before, after = sizes[node][first], sizes[node][-1]
        is_node_well = (
            statuses[node] == 0
            and after <= before * (1.0 + LARGEST_GROWTH)
            and files[node][-1] <= files[node][first]
        )
        is_well &= is_node_well
        print(
            f'{node:>10}: {before:.1f} MiB after {seconds * WARM:.0f} s, {after:.1f} MiB after '
            f'{seconds:.0f} s; {files[node][first]} and {files[node][-1]} open files; '
            f'status {statuses[node]}{"" if is_node_well else "  <- not well"}'
        )
    print(f'{size / 2**20:.0f} MiB recorded')
    return is_well


def main() -> int:
    """Run with the options of the command line; return the exit status."""
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
    parser.add_argument(
        '--fight', action='store_true', help='let clients compete for the reference meanwhile'
    )
    random = parser.add_argument_group('with --hostile or --fight')
    random.add_argument(
        '--seed', type=int, default=None, help='seed of the random input (by default a new one)'
    )
    random.add_argument(
        '--period', type=float, default=None,
        help='control period in s (0.002, with --fight 0.005)',
    )
    hostile = parser.add_argument_group('with --hostile')
    hostile.add_argument(
        '--wheel-speed',
        type=float,
        default=75.0,
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
    seed = time.time_ns() % 2**31 if options.seed is None else options.seed
    if options.fight:
        from benchmarks.fighting_clients import fight

        return 0 if fight(options.seconds, seed, options.period or 0.005) else 1
    if not options.hostile:
        return 0 if soak(options.seconds) else 1
    from benchmarks.hostile_soak import hostile_soak, Options

    is_well = hostile_soak(
        Options(
            seconds=options.seconds,
            seed=seed,
            period=options.period or 0.002,
            wheel_speed=options.wheel_speed,
            arm_speed=options.arm_speed,
            laws=tuple(options.laws.split(',')),
        )
    )
    return 0 if is_well else 1


if __name__ == '__main__':
    sys.exit(main())
