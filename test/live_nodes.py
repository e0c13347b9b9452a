# SPDX-License-Identifier: Apache-2.0
"""Real nodes in real processes, in a ROS domain of their own, always ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from mcap.reader import make_reader
from nav_msgs.msg import Odometry
import rclpy
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from masmc_ros.cli.private_domain import private_domain
from masmc_ros.log.stamps import header_stamp
from masmc_ros.nodes.qos import subscribe_with_past

ROOT = Path(__file__).resolve().parent.parent
PAPER = ROOT / 'config' / 'paper.yaml'
NODES = ('trajectory', 'controller', 'plant')
PATIENCE = 90.0
"""Longest time in s that anything may take; these machines may be slow and busy."""


class Nodes:
    """Processes of one domain, their output kept in files of a folder."""

    def __init__(self, domain: dict[str, str], folder: Path) -> None:
        self.domain = domain
        self._folder = folder
        self._processes: list[tuple[str, subprocess.Popen[bytes], Path]] = []

    def start(self, name: str, *arguments: str) -> subprocess.Popen[bytes]:
        """Start a node with ROS arguments."""
        output = self._folder / f'{len(self._processes)}_{name}.txt'
        with output.open('wb') as out:
            process = subprocess.Popen(
                [sys.executable, '-m', 'masmc_ros.cli.main', 'run', name, *arguments],
                stdout=out,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path), **self.domain},
            )
        self._processes.append((name, process, output))
        return process

    def output(self) -> str:
        """Return what all processes have printed so far."""
        return '\n'.join(
            f'--- {name}\n{path.read_text(errors="replace")}' for name, _, path in self._processes
        )

    def wait(self) -> dict[str, int]:
        """Wait for all processes; return the exit status of the last one of each name."""
        limit = time.monotonic() + PATIENCE
        for name, process, _ in self._processes:
            try:
                process.wait(max(0.1, limit - time.monotonic()))
            except subprocess.TimeoutExpired:
                raise AssertionError(f'{name} does not end\n{self.output()}') from None
        return {name: process.returncode for name, process, _ in self._processes}

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to all processes."""
        for _, process, _ in self._processes:
            process.send_signal(number)

    def end(self) -> None:
        """End what still runs."""
        for _, process, _ in self._processes:
            if process.poll() is None:
                process.kill()
            process.wait()


@contextmanager
def nodes(folder: Path) -> Iterator[Nodes]:
    """Yield a place to start nodes in; whatever happens, none is left behind."""
    with private_domain() as domain:
        started = Nodes(domain, folder)
        try:
            yield started
        finally:
            started.end()


@contextmanager
def observer(
    domain: dict[str, str],
) -> Iterator[tuple[Node, Callable[[Callable[[], bool]], None]]]:
    """Yield a node of this process and a function that spins until something holds."""
    previous = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE')
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    context = Context()
    rclpy.init(
        context=context,
        domain_id=int(domain['ROS_DOMAIN_ID']),
        signal_handler_options=SignalHandlerOptions.NO,
    )
    executor = EventsExecutor(context=context)
    node = rclpy.create_node('observer', context=context)
    added: list[bool] = []

    def spin_until(holds: Callable[[], bool]) -> None:
        if not added:
            # This executor does not see what a node it has already is given outside of a
            # callback, so that the node comes last.
            added.append(executor.add_node(node))
        limit = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < limit, 'it never came'
            executor.spin_once(0.05)

    try:
        yield node, spin_until
    finally:
        if added:
            executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
        context.try_shutdown()
        if previous is None:
            del os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE']
        else:
            os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = previous


def watch_time(node: Node, topic: str = 'odom') -> list[int]:
    """Return a list whose last entry is the stamp of the latest odometry in ns."""
    stamps = [-1]

    def note(raw: bytes) -> None:
        stamps.append(header_stamp(raw))

    subscribe_with_past(node, Odometry, topic, note, depth=1000)
    return stamps


def ros_arguments(file: Path, **settings: object) -> list[str]:
    """Return ROS arguments: a parameter file, and settings NODE__parameter=value."""
    arguments = ['--ros-args', '--params-file', str(file)]
    for name, value in settings.items():
        arguments += ['-p', f'{name.replace("__", ":")}:={value}']
    return arguments


def messages(log: Path) -> dict[str, list[bytes]]:
    """Return a log's messages by topic without namespace, in the order of the file."""
    found: dict[str, list[bytes]] = {}
    with log.open('rb') as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            found.setdefault(channel.topic.removeprefix('/left').lstrip('/'), []).append(
                message.data
            )
    return found
