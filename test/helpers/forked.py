# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Commands in processes of their own that need not import anything: forks of one that has.

Importing rclpy and Numba and finding compiled kernels takes a second of each process. Beyond
that they are processes as a command line starts them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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

PATIENCE = 180.0
"""Longest time in s that a command may take; machines may be slow and busy."""

_CONTEXT = multiprocessing.get_context('forkserver')
_IMPORTED = ['forked', 'masmc_ros.nodes.composed.node', 'masmc_ros.nodes.recorder.node', 'warm']
"""Those that cannot be imported, where there is no rclpy, are left out."""


class Forked:
    """`masmc ARGUMENTS` in a fork, with what a `subprocess.Popen` of it has."""

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
            target=_be,
            args=(self._arguments, dict(environment), out, err, folder or Path.cwd()),
            daemon=True,
        )
        self._process.start()

    @property
    def pid(self) -> int:
        """Its number among the processes."""
        assert self._process.pid is not None
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Its exit status, None while it runs, or minus the signal that ended it."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """Return its exit status, None while it runs."""
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end; return its exit status."""
        self._process.join(timeout)
        status = self._process.exitcode
        if status is None:
            raise subprocess.TimeoutExpired(self._arguments, timeout or 0.0)
        return status

    def send_signal(self, number: signal.Signals) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


@cache
def _start_server() -> None:
    """Start the process that is forked: it finds what this one finds."""
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


def _be(
    arguments: list[str], environment: Mapping[str, str], out: Path, err: Path, folder: Path
) -> None:
    """Be a process as a command line starts it."""
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


def completed(
    *arguments: str, folder: Path, environment: Mapping[str, str]
) -> subprocess.CompletedProcess[str]:
    """Run `masmc ARGUMENTS` in a folder to its end."""
    with tempfile.TemporaryDirectory() as place:
        out, err = Path(place) / 'out', Path(place) / 'err'
        process = Forked(arguments, environment, out, err, folder)
        try:
            status = process.wait(PATIENCE)
        finally:
            process.kill()
        texts = (path.read_text(encoding='utf-8', errors='replace') for path in (out, err))
        return subprocess.CompletedProcess(arguments, status, *texts)
