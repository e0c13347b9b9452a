# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Many nodes and subscribers to be killed, forked from a process that has imported everything."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import multiprocessing
from multiprocessing.context import ForkServerProcess
import os
from pathlib import Path
import sys

from helpers.child_environment import child_environment, domain, domain_variables, ended
from helpers.processes import PATIENCE
from masmc_ros.nodes.middleware.rcl_setup import prepare_transport
import rclpy
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

_CONTEXT = multiprocessing.get_context('forkserver')
_NODES = ('plant', 'recorder', 'controller', 'trajectory')
_IMPORTED = ['helpers.subprocesses', *(f'masmc_ros.nodes.{name}.node' for name in _NODES)]


class Subprocesses:
    """Processes of one ROS domain."""

    def __init__(self, domain: int, folder: Path) -> None:
        self.domain = domain
        self._folder = folder
        self._started: list[tuple[ForkServerProcess, Path]] = []

    def start(self, name: str, *arguments: str) -> ForkServerProcess:
        """Start `masmc run NAME ARGUMENTS`, with its output in the test's folder."""
        return self._start(name, _run_node, 'run', name, *arguments)

    def listen(self, *topics: str) -> ForkServerProcess:
        """Start a subscriber to topics that is not a node of this package."""
        return self._start('listener', _listen, *topics)

    def _start(
        self, name: str, function: Callable[..., int], *arguments: str
    ) -> ForkServerProcess:
        # It has an effect only before the process to fork starts.
        _CONTEXT.set_forkserver_preload(_IMPORTED)
        output = self._folder / f'{len(self._started)}_{name}.out'
        environment = {**child_environment(), **domain_variables(self.domain)}
        process = _CONTEXT.Process(
            target=_run_in_fork, args=(function, arguments, environment, output), daemon=True
        )
        process.start()
        self._started.append((process, output))
        return process

    def print_output(self) -> None:
        """Print the output of all processes."""
        for _, output in self._started:
            text = output.read_text(encoding='utf-8', errors='replace') if output.exists() else ''
            print(f'--- {output.stem}', text, sep='\n')

    def end(self) -> None:
        """End all processes that still run."""
        for process, _ in self._started:
            process.kill()
            process.join(PATIENCE)


def _run_in_fork(
    function: Callable[..., int],
    arguments: Sequence[str],
    environment: Mapping[str, str],
    output: Path,
) -> None:
    """Run a function in this forked process as a command line does."""
    os.environ.update(environment)
    with output.open('wb') as stream:
        os.dup2(stream.fileno(), 1)
        os.dup2(stream.fileno(), 2)
    sys.exit(function(*arguments))


def _run_node(*arguments: str) -> int:
    from masmc_ros.cli.main import main

    return main(arguments)


def _listen(*topics: str) -> int:
    """
    Subscribe to topics.

    Over UDP as well: a process that is killed while it creates shared memory leaves it unfinished,
    and all later processes of this machine that use shared memory wait for it.
    """
    prepare_transport()
    rclpy.init()
    node = rclpy.create_node('listener')
    qos = QoSProfile(depth=10)
    for topic in topics:
        kind = JointState if topic == 'joint_states' else Float64MultiArray
        node.create_subscription(kind, topic, lambda _: None, qos, raw=True)
    rclpy.spin(node)
    return 0


@contextmanager
def subprocesses(folder: Path) -> Iterator[Subprocesses]:
    """Yield an object that starts nodes in a ROS domain that no other process uses."""
    with domain() as number, ended(Subprocesses(number, folder)) as started:
        yield started
