# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes that a command starts as processes in a private ROS domain, and that end with it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import fcntl
import os
from pathlib import Path
import random
import socket
import subprocess

from masmc_ros.child_process import module_command
from masmc_ros.errors import UserError
from masmc_ros.nodes.process.ending import child_environment
from masmc_ros.user_folder import runtime_folder

_DOMAINS = range(1, 102)
"""Domains whose ports lie below those that the system assigns automatically."""


@contextmanager
def private_domain() -> Iterator[dict[str, str]]:
    """
    Yield the environment variables of a domain that no other run uses.

    Raises UserError if all are in use.
    """
    used = os.environ.get('ROS_DOMAIN_ID', '0')
    candidates = [domain for domain in _DOMAINS if str(domain) != used]
    random.shuffle(candidates)
    with locked_domain(candidates) as domain:
        yield {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


@contextmanager
def locked_domain(candidates: Iterable[int]) -> Iterator[int]:
    """
    Yield the first unused domain that no other process of this user has locked.

    Raises UserError if all are in use.
    """
    folder = runtime_folder()
    for domain in candidates:
        path = folder / f'domain_{domain}.lock'
        try:
            lock = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        except OSError:
            continue  # for example a link
        try:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            if not _is_used(domain):
                yield domain
                return
        finally:
            os.close(lock)
    raise UserError('no free ROS domain on this machine; end other runs of masmc demo')


def _is_used(domain: int) -> bool:
    """Return True if a process of any user has the port of the first node of a domain."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', 7410 + 250 * domain))
        except OSError:
            return True
    return False


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
