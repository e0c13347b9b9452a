# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Real-time run of nodes under random input, with nodes that are killed and restarted.

Plant, trajectory, controller and recorder are real processes. A client sends random requests to
all their services and random messages to all their topics. It also changes parameters, and
enables, stops and clears the controller. Between bursts of input the robot follows its path. The
run fails if a node ends unexpectedly, if a torque or a speed exceeds its limit, or if the memory
of a node grows.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import dataclass, field
import math
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any

from benchmarks.hostile import RandomInput
from benchmarks.hostile_client import HostileClient
from benchmarks.live_nodes import memory
from lifecycle_msgs.msg import Transition
from masmc_ros.cli.node_processes import private_domain
from masmc_ros.errors import InputError
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import text_of
from masmc_ros.messages.parameter_record import record_of
from masmc_ros.nodes.middleware.rcl_setup import prepare_transport
from masmc_ros.nodes.process.ending import child_environment
import rclpy
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

NODES = ('trajectory', 'controller', 'plant', 'recorder')
KILLED = ('trajectory', 'controller', 'recorder')
"""Nodes that are killed; the plant represents the robot."""

LIMITS = (6.0, 6.0, 20.0, 10.0)
"""Torque limits in N·m with which the paper's robot cannot diverge for any command delay."""

_FIXED = ('torque_limit', 'boundary_layer', 'latency', 'motor_lag', 'runaway_detection')
"""
Parameters that no valid request changes.

A thinner layer needs a shorter control period, and a latency that the robot does not have is
unstable. Without detection of a run-away, such a robot has no limit of speed.
"""

_SWITCHING = ('saturation', 'tanh', 'sigmoid')
"""Switching terms that are stable at the control period; `sign` has no layer."""

_TRACE = 12
"""Number of seconds whose speeds are printed on failure."""

_SPEED_LIMITS = ', '.join(
    f'{joint} {speed}'
    for joint, speed in (
        ('wheel_right_joint', 40.0),
        ('wheel_left_joint', 40.0),
        ('arm_joint_1', 15.0),
        ('arm_joint_2', 15.0),
    )
)
"""Speed limits of the joints; above 1.2 times these limits a run-away is detected."""

_QUEUE = 4.0
"""Size of the recorder's queue in MB; its contents are not a leak."""

_START = 90.0
_END = 30.0
_TOLERANCE = 1e-9
_ACTION_PERIOD = 0.01
"""Time in s between two actions."""

_REPAIR = 0.5
"""Time in s after which the robot is set in motion again."""

_BURST, _PAUSE = 6.0, 4.0
"""Alternating times in s with and without random input; without it the robot follows its path."""

_DISCOVERY_PERIOD = 2.0
"""Time in s between two discoveries of services and topics."""

_KILL = 0.04
_LAST_KILL = 0.6
"""Shares of the run: between two kills, and after which no node is killed."""

_WARM = 0.25
"""Share of the run after which the memory of a node without restart must be constant."""

_WARM_AGAIN = 0.15
"""Share of the run after which the memory of a restarted node must be constant."""

_GROWTH = 0.05
_GROWTH_MIB = 10.0
_SAMPLE = 1.0


class RunError(Exception):
    """A failed run; the text states the reason."""


@dataclass(frozen=True)
class Options:
    """
    Settings of a hostile run.

    Attributes
    ----------
    seconds
        length of the run.
    seed
        seed of all random choices.
    period
        control period in s.
    wheel_speed
        largest speed of a wheel in rad/s. A run-away is a fault from 48 rad/s on, and 6 N·m add
        27 rad/s in the 0.1 s that the plant waits for a late command.
    arm_speed
        largest speed of a joint of the arm in rad/s.
    laws
        laws between which the controller changes; other laws would have to be compiled.

    """

    seconds: float
    seed: int
    period: float = 0.002
    wheel_speed: float = 75.0
    arm_speed: float = 25.0
    laws: tuple[str, ...] = ('rasmc', 'smc')


@dataclass
class NodeRun:
    """A node: its process, its memory in MiB, and its numbers of starts and kills."""

    process: subprocess.Popen[bytes]
    started: float
    output: Path
    starts: int = 1
    kills: int = 0
    baseline: float = math.nan
    present: float = 0.0
    largest: float = 0.0
    files: list[Path] = field(default_factory=list)


class Watch:
    """
    Comparison of states and commands with their limits.

    Attributes
    ----------
    states
        number of states.
    commands
        number of commands of the controller.
    torque
        largest torque as a share of its limit, applied or commanded.
    wheel
        largest speed of a wheel in rad/s.
    arm
        largest speed of a joint of the arm in rad/s.
    wrong
        first value beyond a limit; empty if no value is.
    state
        the latest state of the controller, such as `active`.

    """

    def __init__(self, node: Node, options: Options, is_foreign: Callable[[bytes], bool]) -> None:
        """Subscribe to states and commands; `is_foreign` returns True for messages of no node."""
        self._options = options
        self._is_foreign = is_foreign
        self._state, self._command = JointStateCdr(), EffortCdr()
        self._wheels = [i for i, name in enumerate(self._state.names) if 'wheel' in name]
        self._arm = [i for i, name in enumerate(self._state.names) if 'arm' in name]
        self._limits: deque[tuple[float, ...]] = deque([LIMITS], maxlen=3)
        self.states = self.commands = 0
        self.torque = self.wheel = self.arm = 0.0
        self.active = 0
        self.wrong = ''
        self.state = ''
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        deep = QoSProfile(depth=1000)
        for kind, topic, take, qos in (
            (JointState, 'joint_states', self._on_state, deep),
            (Float64MultiArray, 'effort_commands', self._on_command, deep),
            (String, 'controller/parameters', self._on_parameters, latched),
            (String, 'controller/state', self._on_controller_state, latched),
        ):
            node.create_subscription(kind, topic, self._checked(take), qos, raw=True)

    def _checked(self, take: Callable[[bytes], None]) -> Callable[[bytes], None]:
        def take_own(raw: bytes) -> None:
            if not self._is_foreign(raw):
                take(raw)

        return take_own

    def _on_state(self, raw: bytes) -> None:
        state = self._state
        if not state.load(raw):
            return
        self.states += 1
        self.active += self.state == 'active'
        torques = state.effort[-len(LIMITS):]
        self._compare('torque', torques, LIMITS, 'N·m applied')
        speed = abs(state.velocity)
        self.wheel = max(self.wheel, *speed[self._wheels].tolist())
        self.arm = max(self.arm, *speed[self._arm].tolist())
        # A number that is not finite is beyond every limit.
        if not self.wheel <= self._options.wheel_speed:
            self._note(f'a wheel turns at {self.wheel} rad/s')
        if not self.arm <= self._options.arm_speed:
            self._note(f'a joint of the arm turns at {self.arm} rad/s')

    def _on_command(self, raw: bytes) -> None:
        if not self._command.load(raw):
            self._note(f'not a command of finite numbers: {raw.hex()}')
            return
        self.commands += 1
        limits = tuple(map(max, *self._limits)) if len(self._limits) > 1 else self._limits[0]
        self._compare('command', self._command.data, limits, 'N·m commanded')

    def _compare(self, name: str, torques: Any, limits: tuple[float, ...], unit: str) -> None:
        for torque, limit in zip(torques.tolist(), limits, strict=True):
            part = abs(torque) / limit if limit else 0.0
            self.torque = max(self.torque, part)
            if not part <= 1.0 + _TOLERANCE:
                self._note(f'{torque} {unit}; expected at most {limit}')

    def _on_parameters(self, raw: bytes) -> None:
        with suppress(InputError):
            limits = record_of(raw).parameters.get('torque_limit', LIMITS)
            many = limits if isinstance(limits, list) else [limits] * len(LIMITS)
            # 0 disables the limit.
            self._limits.append(tuple(float(limit) or math.inf for limit in many))

    def _on_controller_state(self, raw: bytes) -> None:
        with suppress(InputError):
            self.state = text_of(raw)

    def text(self) -> str:
        """Return the current speeds and torques, and the state of the controller."""
        speed, torques = self._state.velocity.tolist(), self._state.effort[-len(LIMITS):].tolist()
        return (
            f'wheels {[round(speed[i], 1) for i in self._wheels]} '
            f'arm {[round(speed[i], 1) for i in self._arm]} rad/s, '
            f'torques {[round(torque, 1) for torque in torques]} N·m, {self.state[:60]}'
        )

    def _note(self, text: str) -> None:
        self.wrong = self.wrong or text


class HostileRun:
    """A hostile run with its processes, its client and its last actions."""

    def __init__(self, folder: Path, environment: Mapping[str, str], options: Options) -> None:
        """Initialise a run without processes."""
        self._folder = folder
        self._environment = environment
        self.options = options
        self.nodes: dict[str, NodeRun] = {}
        self.actions: deque[tuple[float, str]] = deque(maxlen=20)
        self.changes: dict[str, tuple[float, str]] = {}
        self.trace: deque[str] = deque(maxlen=_TRACE)
        self.counts: dict[str, int] = {}
        self._source = RandomInput(options.seed, is_tame=True)
        self._restarts: list[tuple[float, str]] = []
        self._start_time = math.inf
        """Monotonic time in s at which the nodes were ready."""

    # Processes.

    def start(self, name: str) -> None:
        """Start or restart a node."""
        known = self.nodes.get(name)
        number = known.starts if known else 0
        output = self._folder / f'{name}_{number}.txt'
        arguments = ['--ros-args']
        limits = ', '.join(map(str, LIMITS))
        for setting in (
            'pacing:=realtime',
            'duration:=0.0',
            f'control_period:={self.options.period}',
            'plant:wait_for:=[]',
            f'plant:torque_limit:=[{limits}]',
            f'controller:torque_limit:=[{limits}]',
            f'controller:robot.speed_limits:=[{_SPEED_LIMITS}]',
            'trajectory:start_time:=-1.0',
            f'recorder:queue_size:={_QUEUE}',
            f'recorder:output:={self._folder / f"run_{number}.mcap"}',
        ):
            arguments += ['-p', setting]
        with output.open('wb') as stream:
            process = subprocess.Popen(
                [sys.executable, '-m', 'masmc_ros.cli.main', 'run', name, *arguments],
                env={**os.environ, **self._environment, **child_environment()},
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
            )
        if known is None:
            self.nodes[name] = NodeRun(process, time.monotonic(), output)
        else:
            known.process, known.started, known.output = process, time.monotonic(), output
            known.starts += 1
            known.baseline = math.nan

    def kill(self, name: str) -> None:
        """Kill a node; it is restarted after up to 2 s."""
        node = self.nodes[name]
        node.process.kill()
        node.process.wait()
        node.kills += 1
        self._restarts.append((time.monotonic() + self._source.random.uniform(0.2, 2.0), name))

    def end(self) -> dict[str, int | None]:
        """Request all nodes to end; return their statuses, None for a node that does not end."""
        statuses: dict[str, int | None] = {}
        for node in self.nodes.values():
            node.process.send_signal(signal.SIGINT)
        for name, node in self.nodes.items():
            try:
                statuses[name] = node.process.wait(_END)
            except subprocess.TimeoutExpired:
                statuses[name] = None
        return statuses

    def stop(self) -> None:
        """Kill the running nodes."""
        for node in self.nodes.values():
            node.process.kill()
            node.process.wait()

    # Course.

    def run(self, node: Node, spin: Callable[[float], None]) -> Watch:
        """Run to the end; raise RunError on failure."""
        client = HostileClient(node, self._source, NODES, _FIXED)
        watch = Watch(node, self.options, client.has_sent)
        for name in NODES:
            self.start(name)
        self._await_parameters(client, spin)
        watch.states = watch.commands = watch.active = 0
        seconds = self.options.seconds
        self._start_time = start = time.monotonic()
        repair, kill, sample, discovery = start, start + _KILL * seconds, start, start
        while (now := time.monotonic()) < start + seconds:
            if now >= discovery:
                client.discover()
                discovery = now + _DISCOVERY_PERIOD
            if now >= sample:
                self._check(now)
                self.trace.append(f'{now - start:9.3f} s  {watch.text()}')
                sample = now + _SAMPLE
            for due, name in tuple(self._restarts):
                if now >= due:
                    self._restarts.remove((due, name))
                    self.start(name)
                    self._note(f'{name} is restarted')
            if now >= kill and now < start + _LAST_KILL * seconds:
                self._kill_one()
                kill = now + _KILL * seconds
            if now >= repair:
                self._repair(client)
                repair = now + _REPAIR
            if (now - start) % (_BURST + _PAUSE) < _BURST:
                self._act(client)
            spin(_ACTION_PERIOD)
            if watch.wrong:
                raise RunError(watch.wrong)
        self._check(time.monotonic())
        self.counts['requests'] = sum(client.requests.values())
        self.counts['messages'] = sum(client.messages.values())
        self.counts['responses'] = sum(client.responses.values())
        statuses = self.end()
        if set(statuses.values()) != {0}:
            raise RunError(f'exit statuses {statuses}; expected 0')
        return watch

    def _await_parameters(self, client: HostileClient, spin: Callable[[float], None]) -> None:
        limit = time.monotonic() + _START
        requested: dict[str, float] = {}
        while not all(map(client.is_known, NODES)):
            if time.monotonic() > limit:
                raise RunError('the nodes do not respond')
            client.discover()
            for name in {service.node for service in client.services}:
                if not client.is_known(name) and time.monotonic() > requested.get(name, 0.0) + 3.0:
                    client.learn_parameters(name)
                    requested[name] = time.monotonic()
            spin(0.2)
            self._check(time.monotonic())
        client.limit_choices('law', self.options.laws)
        client.limit_choices('switching', _SWITCHING)

    def _act(self, client: HostileClient) -> None:
        """Send a random message or request, or change a parameter."""
        draw = self._source.random.random()
        if draw < 0.5 and client.topics:
            self._note(client.random_message())
        elif draw < 0.8 and client.services:
            self._note(client.random_request())
        else:
            name = self._source.random.choice(('controller', 'controller', 'plant'))
            text = client.valid_change(name)
            if text is not None:
                self._note(text)
                self.changes[' '.join(text.split()[:2])] = self.actions[-1]

    def _repair(self, client: HostileClient) -> None:
        """Resume the plant, clear a fault, configure and enable the controller."""
        for target, service, fields in (
            ('plant', 'pause', {'data': False}),
            ('controller', 'clear_fault', {}),
            ('controller', 'change_state', {'transition': Transition(label='configure')}),
            ('controller', 'enable', {'data': True}),
        ):
            text = client.call(target, service, **fields)
            if text is not None:
                self._note(text)

    def _kill_one(self) -> None:
        waiting = {name for _, name in self._restarts}
        names = [name for name in KILLED if name not in waiting]
        if names:
            name = self._source.random.choice(names)
            self._note(f'{name} is killed')
            self.kill(name)

    def _check(self, now: float) -> None:
        """Check that no process has ended and that no memory has grown."""
        waiting = {name for _, name in self._restarts}
        seconds = self.options.seconds
        for name, node in self.nodes.items():
            if name in waiting:
                continue
            if node.process.poll() is not None:
                raise RunError(f'{name} ended unexpectedly with status {node.process.returncode}')
            node.present = memory(node.process.pid)
            node.largest = max(node.largest, node.present)
            part = _WARM if node.starts == 1 else _WARM_AGAIN
            flat = max(self._start_time + _WARM * seconds, node.started + part * seconds)
            if math.isnan(node.baseline):
                if now >= flat:
                    node.baseline = node.present
            elif node.present > node.baseline * (1.0 + _GROWTH) + _GROWTH_MIB:
                raise RunError(
                    f'{name} has grown from {node.baseline:.1f} to {node.present:.1f} MiB; '
                    f'expected at most {_GROWTH:.0%} and {_GROWTH_MIB:g} MiB more'
                )

    def _note(self, text: str) -> None:
        self.actions.append((time.monotonic() - self._start_time, text))

    # Report.

    def report(self, watch: Watch) -> None:
        """Print a summary of the run."""
        print('node        starts  kills  baseline  present  largest (MiB)')
        for name, node in self.nodes.items():
            print(
                f'{name:<10}  {node.starts:>6}  {node.kills:>5}  {node.baseline:>8.1f}'
                f'  {node.present:>7.1f}  {node.largest:>7.1f}'
            )
        counts = ', '.join(f'{number} {name}' for name, number in self.counts.items())
        share = watch.active / max(1, watch.states)
        print(f'{watch.states} states, {watch.commands} commands, {share:.0%} active; {counts}')
        print(
            f'largest torque {watch.torque:.3f} of its limit; wheels {watch.wheel:.1f} rad/s, '
            f'arm {watch.arm:.1f} rad/s; seed {self.options.seed}'
        )

    def print_failure(self, failure: BaseException) -> None:
        """Print the failure, the preceding actions and the last lines of the nodes."""
        print(f'FAILED: {failure}; seed {self.options.seed}')
        print('changed parameters:')
        for when, text in self.changes.values():
            print(f'  {when:9.3f} s  {text}')
        print('the last actions:')
        for when, text in self.actions:
            print(f'  {when:9.3f} s  {text}')
        print('the last seconds:', *self.trace, sep='\n  ')
        for name, node in self.nodes.items():
            lines = node.output.read_text(encoding='utf-8', errors='replace').splitlines()
            for line in lines[-8:]:
                print(f'  {name}: {line[:200]}')


@contextmanager
def _watching(domain: Mapping[str, str]) -> Iterator[tuple[Node, Callable[[float], None]]]:
    """Yield a node in a domain, and a function that spins it for a time in s."""
    os.environ.update(domain)
    prepare_transport()
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = Node('hostile', context=context, enable_rosout=False)
    # rclpy warns about every subscription that does not match a publisher of the client.
    node.get_logger().set_level(LoggingSeverity.ERROR)
    executor = EventsExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, lambda seconds: executor.spin_until_future_complete(Future(), seconds)
    finally:
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
        context.try_shutdown()


def hostile_soak(options: Options) -> bool:
    """Run, print a summary, and return True on success."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        domain = stack.enter_context(private_domain())
        node, spin = stack.enter_context(_watching(domain))
        run = HostileRun(folder, domain, options)
        stack.callback(run.stop)
        try:
            watch = run.run(node, spin)
        except RunError as failure:
            run.print_failure(failure)
            return False
        run.report(watch)
    return True
