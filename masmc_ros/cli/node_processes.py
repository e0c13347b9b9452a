# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes that a command starts as separate processes, and that end with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import subprocess

from masmc_ros.child_process import module_command
from masmc_ros.errors import UserError
from masmc_ros.nodes.process.ending import child_environment

_END = 15.0
"""Longest time in s until a node has ended."""


class NodeProcesses:
    """Processes of nodes with their output in files."""

    def __init__(self, domain: Mapping[str, str], folder: Path) -> None:
        """
        Initialise without a process.

        Parameters
        ----------
        domain
            Environment variables of the ROS domain.
        folder
            Folder of the files NODE.log.

        """
        self._domain, self._folder = domain, folder
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, arguments: Sequence[str]) -> None:
        """Start a node."""
        with self._log(name).open('wb') as out:
            self._processes[name] = subprocess.Popen(
                module_command('masmc_ros.cli.main', 'run', name, *arguments),
                stdout=out,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                env={**os.environ, **self._domain, **child_environment()},
                start_new_session=True,
            )

    def output(self, name: str) -> str:
        """Return the output of a node so far."""
        return self._log(name).read_text(encoding='utf-8', errors='replace')

    def is_any_running(self) -> bool:
        """Return True if a node has not ended."""
        return any(process.poll() is None for process in self._processes.values())

    def is_running(self, name: str) -> bool:
        """Return True if this node has not ended."""
        return self._processes[name].poll() is None

    def has_any_failed(self) -> bool:
        """Return True if a node has ended with an error."""
        return any(process.poll() not in (None, 0) for process in self._processes.values())

    def end(self) -> None:
        """End all nodes."""
        for process in self._processes.values():
            if process.poll() is None:
                process.terminate()
        for process in self._processes.values():
            try:
                process.wait(_END)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def check(self) -> None:
        """Raise UserError with the last line of a node that ended with an error."""
        for name, process in self._processes.items():
            if process.returncode != 0:
                last = (self.output(name).strip().splitlines() or ['no output'])[-1]
                raise UserError(f'{name} ended with status {process.returncode}: {last}')

    def _log(self, name: str) -> Path:
        return self._folder / f'{name}.log'


@contextmanager
def node_processes(domain: Mapping[str, str], folder: Path) -> Iterator[NodeProcesses]:
    """
    Yield processes of nodes, which end with the context.

    Raises UserError afterwards if a node has ended with an error.
    """
    nodes = NodeProcesses(domain, folder)
    try:
        yield nodes
    finally:
        nodes.end()
    nodes.check()
