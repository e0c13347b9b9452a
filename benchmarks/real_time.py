# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Jitter and overruns of a real-time run: `python -m benchmarks.real_time [SECONDS]`.

`python -m benchmarks.real_time laws` changes the law of TIAGo to every law that supports it, and
back, and prints the latest command of each pair of changes; `chrt -f 50` keeps other load out.

All times are those at which the middleware sent the messages. Delays of the observer have no
effect.

`python -m benchmarks.real_time delayed [SECONDS]` runs a plant whose states and commands are up to
10 ms late in total, on a busy machine, and compares its error with the simulated one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import os
from pathlib import Path
import sys
import tempfile
import time
from types import MappingProxyType
from typing import Any

from benchmarks.busy import busy
from benchmarks.live_nodes import end, realtime_nodes
import masmc_ros as masmc
from masmc_ros.aliases import Array
from masmc_ros.files import shared_file
from masmc_ros.log.read.reader import read_run
from masmc_ros.loop.law_code import fitting
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.parameter_record import read_record
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.ros_topics import subscription_qos
from masmc_ros.robot.mechanisms import driven_joint_names, mechanism_from
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from rcl_interfaces.srv import SetParametersAtomically
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

NODES = ('trajectory', 'controller', 'plant')
RATES = (500, 1000)
TIAGO = 'tiago.yaml'

PATIENT = {
    'controller.state_timeout': 10.0,
    'controller.runaway_detection': 'false',
    'plant.command_timeout': 10.0,
}
"""Settings with which late ticks on a busy machine do not end the run."""

COMPILING = 900.0
"""Maximum time in s for compiling on a busy machine."""

DELAYED = {
    'plant.measurement_delay': 0.003,
    'plant.command_delay': 0.003,
    'plant.delay_jitter': 0.67,
    'controller.law': 'smc',
    'controller.switching': 'implicit',
    'controller.latency': 0.006,
}
"""Parameters of a plant with delays and jitter, each of both of at most 5 ms."""

RATE_DELAYED = 500
"""Rate of that run in 1/s."""


class Observer:
    """
    Node that observes a run in real time.

    Attributes
    ----------
    states
        Times in ns at which states were sent, by their stamps in ns.
    commands
        Times in ns at which the commands that answer them were sent, by the same stamps.
    law
        Law that computes the commands.

    """

    def __init__(self, context: Context, command: EffortCdr) -> None:
        """Initialise the node in a context; `command` reads commands of the robot."""
        self.states: dict[int, int] = {}
        self.commands: dict[int, int] = {}
        self.law = ''
        self._command = command
        self.node = Node('observer', context=context)
        # The other executor fails on callbacks that receive the times of a message.
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        qos = subscription_qos(depth=1000)
        callbacks: tuple[tuple[type, str, Any], ...] = (  # rclpy's types know one argument only
            (JointState, 'joint_states', self._on_state),
            (Float64MultiArray, 'effort_commands', self._on_command),
        )
        for message_type, topic, callback in callbacks:
            self.node.create_subscription(message_type, topic, callback, qos, raw=True)
        self.node.create_subscription(
            String,
            'controller/parameters',
            self._on_parameters,
            subscription_qos(depth=10, past=True),
        )

    def spin(self, seconds: float) -> None:
        """Receive messages for some seconds."""
        limit = time.monotonic() + seconds
        while time.monotonic() < limit:
            self._executor.spin_once(0.1)

    def until(self, condition: Any, seconds: float = 30.0) -> None:
        """Receive messages until a condition holds; raise TimeoutError after some seconds."""
        limit = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > limit:
                raise TimeoutError(f'nothing has changed for {seconds:g} s')
            self._executor.spin_once(0.1)

    def close(self) -> None:
        """Destroy the node."""
        self._executor.remove_node(self.node)
        self.node.destroy_node()
        self._executor.shutdown()

    def _on_state(self, raw: Any, info: Any) -> None:
        self.states[header_stamp(raw)] = info['source_timestamp']

    def _on_command(self, raw: Any, info: Any) -> None:
        command = self._command
        if command.load(raw) and command.stamp_ns is not None:
            self.commands.setdefault(command.stamp_ns, info['source_timestamp'])

    def _on_parameters(self, message: String) -> None:
        self.law = read_record(message.data).parameters['law']


@contextmanager
def observed(
    command: EffortCdr,
    period: float,
    file: str = 'paper.yaml',
    settings: Mapping[str, object] = MappingProxyType({}),
) -> Iterator[Observer]:
    """Yield the observer of an endless run in real time, from its first command on."""
    with (
        tempfile.TemporaryDirectory() as folder,
        realtime_nodes(Path(folder), period, *NODES, file=file, settings=settings) as processes,
    ):
        context = Context()
        rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        observer = Observer(context, command)
        observer.until(lambda: observer.states and observer.commands, COMPILING)
        yield observer
        end(processes)
        observer.close()
        context.try_shutdown()


def measure(rate: int, seconds: float) -> str:
    """Run for `seconds` at a rate in 1/s and return a line of figures."""
    with observed(EffortCdr(), 1.0 / rate) as observer:
        observer.spin(seconds)
    states, commands = observer.states, observer.commands
    # The two topics are not discovered at the same time.
    first = min(commands)
    return _figures(rate, {stamp: t for stamp, t in states.items() if stamp >= first}, commands)


def _figures(rate: int, states: dict[int, int], commands: dict[int, int]) -> str:
    period = 1e3 / rate
    sent = np.array([states[stamp] for stamp in sorted(states)]) * 1e-6
    jitter = np.abs(np.diff(sent) - period)
    response = np.array(
        [(commands[stamp] - states[stamp]) * 1e-6 for stamp in states.keys() & commands.keys()]
    )
    unanswered = len(states) - len(response)
    return (
        f'{rate:5d} Hz, {len(states)} states in {(sent[-1] - sent[0]) / 1e3:.1f} s: '
        f'|interval - period| median {np.median(jitter):.3f}, '
        f'99.9 % {np.quantile(jitter, 0.999):.3f}, most {jitter.max():.3f} ms; '
        f'state to command median {np.median(response):.3f}, '
        f'99.9 % {np.quantile(response, 0.999):.3f}, most {response.max():.3f} ms; '
        f'{int((response > period).sum())} later than a period, {unanswered} overtaken'
    )


def law_changes() -> Iterator[str]:
    """Change the law of TIAGo to each law and back, and yield a line with the latest tick."""
    values = load_scenario(str(shared_file('config', TIAGO)))['controller']
    laws = [law.name for law in fitting(mechanism_from(values)) if law.name != values['law']]
    command = EffortCdr(driven_joint_names(values))
    with observed(command, values['control_period'], TIAGO, PATIENT) as observer:
        client = observer.node.create_client(
            SetParametersAtomically, 'controller/set_parameters_atomically'
        )
        observer.until(client.service_is_ready)
        observer.until(lambda: observer.law)
        observer.states.clear()
        observer.commands.clear()
        observer.spin(5.0)
        yield f'{values["law"]:24} 5 s without a change: {_latest(observer)}'
        for law in laws:
            observer.states.clear()
            observer.commands.clear()
            durations = []
            for name in (law, values['law']):
                start = time.monotonic()
                value = Parameter('law', value=name).to_parameter_msg()
                client.call_async(SetParametersAtomically.Request(parameters=[value]))
                observer.until(lambda name=name: observer.law == name, COMPILING)
                durations.append(time.monotonic() - start)
                observer.spin(0.3)
            yield f'{law:24} active after {durations[0]:6.2f} s: {_latest(observer)}'


def _latest(observer: Observer) -> str:
    """Return the longest time from a state to the next command, and the longest interval."""
    answered = np.array(sorted(observer.commands))
    sent = np.array([observer.commands[stamp] for stamp in answered])
    states = np.array(sorted(stamp for stamp in observer.states if stamp <= answered[-1]))
    # A state that a later one has overtaken waits for the command that answers the later one.
    at = np.array([observer.states[stamp] for stamp in states])
    late = 1e-6 * (sent[np.searchsorted(answered, states)] - at)
    return (
        f'latest command {late.max():.1f} ms after its state, {np.diff(sent).max() * 1e-6:.1f} ms '
        f'after the previous one, {np.diff(at).max() * 1e-6:.1f} ms between states; {len(late)} '
        f'ticks, load {os.getloadavg()[0]:.1f}'
    )


def measure_delayed(rate: int, seconds: float) -> str:
    """Run a delayed plant on a busy machine and return a line with its error and the simulated."""
    lasts = {f'{node}.duration': seconds for node in NODES}
    with (
        busy(2),
        tempfile.TemporaryDirectory() as folder,
        realtime_nodes(
            Path(folder), 1.0 / rate, *NODES, 'recorder', settings={**DELAYED, **lasts}
        ) as processes,
    ):
        processes['plant'].wait(2.0 * seconds + COMPILING)
        end(processes)
        live = read_run(Path(folder) / 'run.mcap').telemetry['error'].values
    period = {'control_period': 1.0 / rate, 'duration': seconds}
    errors = [_rms(e) for e in (masmc.simulate('paper', DELAYED, **period).error, live)]
    return (
        f'{rate:5d} Hz, {seconds:g} s, load {os.getloadavg()[0]:.1f}: E RMS simulated '
        f'{errors[0]:.3f} mm, in real time {errors[1]:.3f} mm, ratio {errors[1] / errors[0]:.2f}'
    )


def _rms(error: Array) -> float:
    """Return the RMS error of E over the second half of a run in mm, of the errors (n, 4) in m."""
    return 1e3 * float(np.sqrt((error[len(error) // 2:, :2] ** 2).sum(axis=1).mean()))


def main() -> None:
    """Print a line for every rate, or for every law."""
    kind = next((word for word in sys.argv[1:] if word in ('laws', 'delayed')), '')
    numbers = [float(word) for word in sys.argv[1:] if word != kind]
    if kind == 'laws':
        lines = law_changes()
    elif kind == 'delayed':
        lines = iter([measure_delayed(RATE_DELAYED, *(numbers or [60.0]))])
    else:
        lines = (measure(rate, *(numbers or [30.0])) for rate in RATES)
    for line in lines:
        print(line, flush=True)


if __name__ == '__main__':
    main()
