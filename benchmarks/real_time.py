# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Jitter and overruns of a real-time run: `python -m benchmarks.real_time [SECONDS]`.

All times are those at which the middleware sent the messages. Delays of the observer have no
effect. `python -m benchmarks.real_time delayed [SECONDS]` runs a plant whose states and commands
are up to 10 ms late in total, on a busy machine, and compares its error with the simulated one.
"""

from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

from benchmarks.live_nodes import end, realtime_nodes
import masmc_ros as masmc
from masmc_ros.log.read.reader import read_run
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.qos import subscription_qos
from masmc_ros.numerics.aliases import Array
import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

NODES = ('trajectory', 'controller', 'plant')
RATES = (500, 1000)

DELAYED = {
    'plant.measurement_delay': 0.003,
    'plant.command_delay': 0.003,
    'plant.delay_jitter': 0.67,
    'controller.law': 'smc',
    'controller.switching': 'implicit',
    'controller.latency': 0.006,
}
"""Parameters of a plant with delays and jitter, each of both of at most 5 ms."""

RATES_DELAYED = (500,)


_STARTING = 600.0
"""Longest time in s for the start of the nodes, which may have to compile."""


def measure(rate: int, seconds: float) -> str:
    """Run for `seconds` at a rate in 1/s and return a line of figures."""
    states: dict[int, int] = {}
    commands: dict[int, int] = {}
    command = EffortCdr()

    def on_state(raw: Any, info: Any) -> None:
        states[header_stamp(raw)] = info['source_timestamp']

    def on_command(raw: Any, info: Any) -> None:
        if command.load(raw) and command.stamp_ns is not None:
            commands.setdefault(command.stamp_ns, info['source_timestamp'])

    with (
        tempfile.TemporaryDirectory() as folder,
        realtime_nodes(Path(folder), 1.0 / rate, *NODES) as processes,
    ):
        context = Context()
        rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        # The other executor fails on callbacks that receive the times of a message.
        executor = SingleThreadedExecutor(context=context)
        node = Node('observer', context=context)
        qos = subscription_qos(depth=1000)
        callbacks: tuple[tuple[type, str, Any], ...] = (  # rclpy's types know one argument only
            (JointState, 'joint_states', on_state),
            (Float64MultiArray, 'effort_commands', on_command),
        )
        for message_type, topic, callback in callbacks:
            node.create_subscription(message_type, topic, callback, qos, raw=True)
        executor.add_node(node)
        limit = time.monotonic() + 30.0
        while not (states and commands) and time.monotonic() < limit:
            executor.spin_once(0.1)
        start = time.monotonic()
        while time.monotonic() < start + seconds:
            executor.spin_once(0.1)
        end(processes)
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
        context.try_shutdown()
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


def measure_delayed(rate: int, seconds: float) -> str:
    """Run a delayed plant on a busy machine and return a line with its error and the simulated."""
    lasts = {f'{node}.duration': seconds for node in NODES}
    busy = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(2)]
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            realtime_nodes(
                Path(folder), 1.0 / rate, *NODES, 'recorder', settings={**DELAYED, **lasts}
            ) as processes,
        ):
            processes['plant'].wait(2.0 * seconds + _STARTING)
            end(processes)
            live = read_run(Path(folder) / 'run.mcap').telemetry['error'].values
    finally:
        for process in busy:
            process.kill()
            process.wait()
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
    """Print a line for every rate."""
    is_delayed = 'delayed' in sys.argv
    numbers = [float(value) for value in sys.argv[1:] if value != 'delayed']
    seconds = numbers[0] if numbers else 60.0 if is_delayed else 30.0
    function, rates = (measure_delayed, RATES_DELAYED) if is_delayed else (measure, RATES)
    for rate in rates:
        print(function(rate, seconds), flush=True)


if __name__ == '__main__':
    main()
