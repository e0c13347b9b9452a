# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Commands in separate processes, forked from a process that has imported everything.

Importing rclpy and Numba and loading compiled kernels takes one second per process. Apart from
that, these processes equal those that a command line starts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import contextlib
import faulthandler
from functools import cache
import multiprocessing
from multiprocessing import forkserver
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile

SERVED = {'play': 'viser'}
"""Nodes that listen on a port, with the optional module of each."""

PATIENCE = 180.0
"""Maximum duration of a command in s, on a slow and busy machine."""

COMPILING = 900.0
"""
Maximum time in s until a node or command without cached code of a tree robot has compiled it.

It compiles for a minute or two, and several times as long while other tests compile.
"""

_CONTEXT = multiprocessing.get_context('forkserver')
_IMPORTED = [
    'helpers.command_process',
    'masmc_ros.nodes.composed.node',
    'masmc_ros.nodes.recorder.node',
    'helpers.precompile',
]
"""Modules to import before the fork; without rclpy those that need it are skipped."""


class CommandProcess:
    """`masmc ARGUMENTS` in a forked process, with the interface of `subprocess.Popen`."""

    def __init__(
        self,
        arguments: Sequence[str],
        environment: Mapping[str, str],
        out: Path,
        err: Path,
        folder: Path | None = None,
    ) -> None:
        for path in (out, err):
            path.touch()
        _start_server()
        self._arguments = list(arguments)
        self._process = _CONTEXT.Process(
            target=_run_in_fork,
            args=(self._arguments, dict(environment), out, err, folder or Path.cwd()),
            daemon=True,
        )
        self._process.start()

    @property
    def pid(self) -> int:
        """Process id."""
        assert self._process.pid is not None
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Exit status, None while it runs, or minus the signal that ended it."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """Return the exit status, None while it runs."""
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end of the process; return its exit status."""
        self._process.join(timeout)
        status = self._process.exitcode
        if status is None:
            raise subprocess.TimeoutExpired(self._arguments, timeout or 0.0)
        return status

    def send_signal(self, number: signal.Signals) -> None:
        """Send a signal, unless the process has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill the process."""
        self.send_signal(signal.SIGKILL)


@cache
def _start_server() -> None:
    """Start the process to fork, with this process's import path."""
    _CONTEXT.set_forkserver_preload(_IMPORTED)
    before = os.environ.get('PYTHONPATH')
    os.environ['PYTHONPATH'] = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
    try:
        forkserver.ensure_running()
    finally:
        if before is None:
            del os.environ['PYTHONPATH']
        else:
            os.environ['PYTHONPATH'] = before


def _run_in_fork(
    arguments: list[str], environment: Mapping[str, str], out: Path, err: Path, folder: Path
) -> None:
    """Run a command in this forked process as a command line does."""
    from masmc_ros.cli.main import main

    for number, path in ((1, out), (2, err)):
        with path.open('wb') as stream:
            os.dup2(stream.fileno(), number)
    faulthandler.enable(sys.__stderr__)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    sys.argv = ['masmc', *arguments]
    sys.exit(main(arguments))


def busy(pid: int) -> float:
    """Return the time in s that the threads of a process have computed or waited to compute."""
    total = 0
    for thread in Path(f'/proc/{pid}/task').iterdir():
        # A thread may end meanwhile.
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            total += sum(map(int, (thread / 'schedstat').read_text().split()[:2]))
    return 1e-9 * total


def run_command(
    *arguments: str, folder: Path, environment: Mapping[str, str], patience: float = PATIENCE
) -> subprocess.CompletedProcess[str]:
    """Run `masmc ARGUMENTS` in a folder to its end; TimeoutExpired after `patience` s."""
    with tempfile.TemporaryDirectory() as outputs:
        out, err = Path(outputs) / 'out', Path(outputs) / 'err'
        process = CommandProcess(arguments, environment, out, err, folder)
        try:
            status = process.wait(patience)
        finally:
            process.kill()
        texts = (path.read_text(encoding='utf-8', errors='replace') for path in (out, err))
        return subprocess.CompletedProcess(arguments, status, *texts)
