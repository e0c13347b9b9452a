# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Real-time nodes in separate processes, in a private domain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys
from types import MappingProxyType

from masmc_ros.cli.node_processes import private_domain
from masmc_ros.files import shared_file
from masmc_ros.nodes.process.ending import child_environment

TIMEOUT = 30.0


@contextmanager
def realtime_nodes(
    folder: Path,
    period: float,
    *nodes: str,
    file: str = 'paper.yaml',
    settings: Mapping[str, object] = MappingProxyType({}),
) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """
    Yield the processes of an endless run; this process joins their domain meanwhile.

    `settings` are parameters of the file in config/ by names like `plant.friction`.
    """
    wait_for = ', '.join(node for node in nodes if node != 'plant')
    arguments = ['--ros-args', '--params-file', str(shared_file('config', file))]
    for setting in (
        'pacing:=realtime',
        'duration:=0.0',
        f'control_period:={period}',
        f'plant:wait_for:=[{wait_for}]',
        f'recorder:output:={folder / "run.mcap"}',
        *(f'{name.replace(".", ":", 1)}:={value}' for name, value in settings.items()),
    ):
        arguments += ['-p', setting]
    with private_domain() as domain:
        os.environ.update(domain)
        processes = {
            node: subprocess.Popen(
                [sys.executable, '-m', 'masmc_ros.cli.main', 'run', node, *arguments],
                env={**os.environ, **child_environment()},
            )
            for node in nodes
        }
        try:
            yield processes
        finally:
            for process in processes.values():
                process.kill()
                process.wait()


def memory(pid: int) -> float:
    """Return the resident memory of a process in MiB."""
    for line in Path(f'/proc/{pid}/status').read_text(encoding='ascii').splitlines():
        if line.startswith('VmRSS:'):
            return int(line.split()[1]) / 1024.0
    return 0.0


def end(processes: dict[str, subprocess.Popen[bytes]]) -> dict[str, int]:
    """Request all processes to end and return their exit statuses."""
    for process in processes.values():
        process.send_signal(signal.SIGINT)
    return {node: process.wait(TIMEOUT) for node, process in processes.items()}
