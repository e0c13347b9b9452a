# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Nodes in separate processes, and a node of the test process.

Every test has a separate ROS domain on this machine. Every wait has a timeout, and all
processes end with their test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import time
from typing import Any
from unittest.mock import patch

from helpers.child_environment import child_environment, domain, domain_variables, ended
from helpers.command_process import CommandProcess, PATIENCE
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.rcl_setup import prepare_transport
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

ROOT = Path(__file__).resolve().parents[2]
PAPER = ROOT / 'config' / 'paper.yaml'
NODES = ('trajectory', 'controller', 'plant', 'recorder')

BOUNDED = dict.fromkeys(
    ('plant__torque_limit', 'controller__torque_limit'), '[6.0, 6.0, 20.0, 10.0]'
)
"""Settings with which a run in real time cannot diverge, even if commands are very late.

On a busy machine a node can be delayed repeatedly, for many ticks.
"""

_RESPONSE = 5.0
"""Time in s after which a service is called again."""

_LAST_WORDS = 5.0
"""Maximum time in s until an aborted process has printed its stack."""

_MIDDLEWARE = re.compile(r'RTPS_\w+ .*Error|open_and_lock_file|the middleware does not let go')
"""Lines about shared memory that killed processes left behind, and about Fast DDS hanging."""


class NodeProcess:
    """Process of a node, with its standard output and error in files."""

    def __init__(
        self, name: str, process: subprocess.Popen[bytes] | CommandProcess, out: Path, err: Path
    ) -> None:
        self.name = name
        self.process = process
        self._out, self._err = out, err

    def stdout(self) -> str:
        """Return the standard output so far."""
        return self._out.read_text(encoding='utf-8', errors='replace')

    def stderr(self) -> list[str]:
        """Return the complete lines of standard error so far, without the middleware's."""
        text = self._err.read_text(encoding='utf-8', errors='replace')
        complete = text[: text.rfind('\n') + 1]
        return [line for line in complete.splitlines() if line and not _MIDDLEWARE.search(line)]

    def logged(self, severity: str, part: str = '') -> list[str]:
        """Return the log lines of a severity that contain `part`."""
        return [
            line for line in self.stderr() if line.startswith(f'[{severity}]') and part in line
        ]

    def complaints(self) -> list[str]:
        """Return the lines of standard error that are not log lines."""
        return [line for line in self.stderr() if not line.startswith('[')]

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the process."""
        self.process.send_signal(number)

    def abort(self) -> None:
        """Abort the process; faulthandler prints its stack to standard error."""
        if self.process.poll() is None:
            self.signal(signal.SIGCONT)
            self.signal(signal.SIGABRT)
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(_LAST_WORDS)

    def wait(self, limit: float | None = None) -> int:
        """Wait until a time of the monotonic clock for the end; return the exit status."""
        timeout = PATIENCE if limit is None else max(0.1, limit - time.monotonic())
        return self.process.wait(timeout)


class Processes:
    """
    All processes of a ROS domain.

    They are forked, or with `fresh` started as by a command line.
    """

    def __init__(self, domain: int, folder: Path, *, fresh: bool = False) -> None:
        self.domain = domain
        self._folder = folder
        self._fresh = fresh
        self._started: list[NodeProcess] = []

    def start(
        self, name: str, *arguments: str, environment: Mapping[str, str] | None = None
    ) -> NodeProcess:
        """Start `masmc run NAME ARGUMENTS`, with its output in the test's folder."""
        stem = f'{len(self._started)}_{name}'
        out, err = self._folder / f'{stem}.out', self._folder / f'{stem}.err'
        command = ['run', name, *arguments]
        variables = {**child_environment(), **domain_variables(self.domain), **(environment or {})}
        process: subprocess.Popen[bytes] | CommandProcess
        # Environment variables may affect imports, which precede a fork.
        if self._fresh or environment:
            with out.open('wb') as to_out, err.open('wb') as to_err:
                process = subprocess.Popen(
                    [sys.executable, '-m', 'masmc_ros.cli.main', *command],
                    stdin=subprocess.DEVNULL,
                    stdout=to_out,
                    stderr=to_err,
                    env=variables,
                )
        else:
            process = CommandProcess(command, variables, out, err)
        self._started.append(NodeProcess(name, process, out, err))
        return self._started[-1]

    def start_all(
        self,
        *arguments: str,
        nodes: tuple[str, ...] = NODES,
        environment: Mapping[str, str] | None = None,
    ) -> dict[str, NodeProcess]:
        """Start nodes with the same arguments, each in a separate process."""
        return {name: self.start(name, *arguments, environment=environment) for name in nodes}

    def wait(self) -> dict[str, int]:
        """Wait for all processes; return the exit status of the last process of each name."""
        limit = time.monotonic() + PATIENCE
        for node in self._started:
            try:
                node.wait(limit)
            except subprocess.TimeoutExpired:
                raise AssertionError(f'{node.name} does not end') from None
        return {node.name: node.process.returncode for node in self._started}

    def output(self) -> str:
        """Return the output of all processes."""
        return '\n'.join(
            '\n'.join((f'--- {node.name}', node.stdout(), *node.stderr()))
            for node in self._started
        )

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to all processes."""
        for node in self._started:
            node.signal(number)

    def print_output(self) -> None:
        """Abort all processes, and print their output and stacks."""
        for node in self._started:
            node.abort()
        print(self.output())

    def end(self) -> None:
        """Kill all processes that still run."""
        for node in self._started:
            if node.process.poll() is None:
                node.process.kill()
            node.process.wait()


class Peer:
    """Node of the test process; its executor spins only while the test waits."""

    def __init__(self, node: Node, executor: SingleThreadedExecutor) -> None:
        self.node = node
        self._executor = executor
        self._clients: dict[tuple[type, str], Any] = {}
        self._known: set[tuple[type, str]] = set()

    def until(
        self,
        holds: Callable[[], Any],
        awaited: str | Callable[[], str] = 'condition of the test',
        patience: float = PATIENCE,
    ) -> Any:
        """
        Spin until `holds` returns a true value; return it. AssertionError after `patience` s.

        `awaited` describes the condition, or returns a description at the time of the failure.
        """
        limit = time.monotonic() + patience
        while not (value := holds()):
            if time.monotonic() > limit:
                text = awaited() if callable(awaited) else awaited
                raise AssertionError(f'timeout: {text}')
            self._executor.spin_once(timeout_sec=0.02)
        return value

    def watch_time(self, topic: str = 'odom') -> list[int]:
        """Return a list whose last entry is the stamp of the latest odometry in ns, or -1."""
        stamps = [-1]
        self.subscribe(Odometry, topic, lambda raw: stamps.append(header_stamp(raw)), raw=True)
        return stamps

    def wait_for_subscribers(self, publisher: Any, count: int = 1) -> None:
        """Wait until at least `count` subscriptions are matched with a publisher."""
        topic = publisher.topic_name
        self.until(lambda: publisher.get_subscription_count() >= count, f'subscribers of {topic}')

    def collect(
        self, message_type: Any, topic: str, *, raw: bool = False, past: bool = True
    ) -> list[Any]:
        """Return a list to which every message of a topic is appended."""
        messages: list[Any] = []
        self.subscribe(message_type, topic, messages.append, raw=raw, past=past)
        return messages

    def subscribe(
        self,
        message_type: Any,
        topic: str,
        callback: Callable[[Any], None],
        *,
        raw: bool = False,
        past: bool = True,
    ) -> Subscription:
        """Subscribe reliably with a deep queue; `past` requests earlier messages as well."""
        return self.node.create_subscription(
            message_type, topic, callback, _qos(latched=past), raw=raw
        )

    def publisher(self, message_type: Any, topic: str, *, latched: bool = False) -> Any:
        """Create a reliable publisher: volatile, as rclpy's default, or latched."""
        return self.node.create_publisher(message_type, topic, _qos(latched=latched))

    def call(self, service_type: Any, name: str, request: Any, *, again: bool = True) -> Any:
        """
        Call a service and return its response.

        The middleware drops the response to a client that the server has not discovered within
        0.1 s. Such a call is repeated with `again`. For requests that must not be repeated,
        the call is made after the server has discovered the client.
        """
        find = self.client if again else self.known_client
        client = find(service_type, name)
        self.until(client.service_is_ready, f'service {name}')
        futures = [client.call_async(request)]
        limit = time.monotonic() + _RESPONSE

        def answered() -> Any:
            nonlocal limit
            if again and time.monotonic() > limit:
                limit = time.monotonic() + _RESPONSE
                futures.append(client.call_async(request))
            return next((f for f in futures if f.done()), None)

        return self.until(answered, f'response of {name}').result()

    def change(self, node: str, **values: Any) -> None:
        """Change parameters of a node atomically; the change must be successful."""
        new = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=new)
        name = f'{node}/set_parameters_atomically'
        assert self.call(SetParametersAtomically, name, request).result.successful

    def client(self, service_type: Any, name: str) -> Any:
        """Return the client of a service, the same one for every call."""
        key = (service_type, name)
        if key not in self._clients:
            self._clients[key] = self.node.create_client(service_type, name)
        return self._clients[key]

    def known_client(self, service_type: Any, name: str) -> Any:
        """
        Return a client that the node of a service has discovered: no response is dropped.

        A participant announces its endpoints in their order. Therefore a node that has responded
        to a client knows all earlier clients. The node must not be replaced by another later.
        """
        client = self.client(service_type, name)
        if (service_type, name) not in self._known:
            getter = f'{name.rpartition("/")[0]}/get_parameters'
            later = self.node.create_client(GetParameters, getter)
            self._clients[GetParameters, getter] = later
            self.call(GetParameters, getter, GetParameters.Request())
            self._known.add((service_type, name))
        return client


def _qos(*, latched: bool) -> QoSProfile:
    durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=5000, reliability=ReliabilityPolicy.RELIABLE, durability=durability)


@contextmanager
def processes(folder: Path, *, fresh: bool = False) -> Iterator[Processes]:
    """
    Yield an object that starts nodes in a ROS domain that no other process uses.

    The processes end with the test; their output is printed if the test fails.
    """
    with domain() as number, ended(Processes(number, folder, fresh=fresh)) as started:
        yield started


@contextmanager
def peer(domain: int, name: str = 'peer', namespace: str = '/') -> Iterator[Peer]:
    """Yield a node of this process in a domain."""
    context = Context()
    with patch.dict(os.environ, domain_variables(domain)):
        # Over shared memory, it would wait forever for a process that was killed while starting.
        prepare_transport()
        rclpy.init(
            context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO
        )
        node = Node(name, context=context, namespace=namespace)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield Peer(node, executor)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


def ros_arguments(file: Path | None = PAPER, **settings: object) -> list[str]:
    """Return ROS arguments: a parameter file, and settings NAME=value or NODE__name=value."""
    arguments = ['--ros-args']
    if file is not None:
        arguments += ['--params-file', str(file)]
    for name, value in settings.items():
        arguments += ['-p', f'{name.replace("__", ":")}:={value}']
    return arguments


def shortened(folder: Path, duration: float, source: Path = PAPER, **values: str) -> Path:
    """Return a copy of a parameter file with another duration and other scalar values."""
    text = source.read_text(encoding='utf-8')
    for name, value in {'duration': str(float(duration)), **values}.items():
        text, count = re.subn(rf'(?m)^(\s*{name}:).*$', lambda m, v=value: f'{m[1]} {v}', text)
        assert count == 1, name
    file = folder / f'{source.stem}_shortened.yaml'
    file.write_text(text, encoding='utf-8')
    return file
