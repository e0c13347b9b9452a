# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ends of runs: without messages at the regular end, with one line and status 2 on failure."""

from __future__ import annotations

from pathlib import Path
import signal
import subprocess
import sys
import time

from helpers.child_environment import child_environment
from helpers.log_contents import read_log
from helpers.processes import NodeProcess, PATIENCE, peer, processes, ros_arguments
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.process.ending import ENDING
from masmc_ros.nodes.process.runtime import StopSignals
from masmc_ros.nodes.recorder.intake import take_rest
import pytest
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

ALL = '[controller, trajectory, recorder]'


@pytest.mark.slow
def test_real_time_run_after_its_end_logs_nothing(tmp_path: Path) -> None:
    """While the recorder receives the last messages, no node warns of late or missing ones."""
    log = tmp_path / 'run.mcap'
    with processes(tmp_path, fresh=True) as started:
        arguments = ros_arguments(
            duration=0.5,
            control_period=0.002,
            pacing='realtime',
            plant__wait_for=ALL,
            plant__command_timeout=0.1,
            controller__state_timeout=0.1,
            recorder__output=log,
        )
        composed = started.start('composed', '--record', *arguments)
        assert started.wait() == {'composed': 0}, started.output()
        lines = composed.stderr()
    (end,) = (i for i, line in enumerate(lines) if ' ticks in ' in line)
    assert len(lines[end + 1:]) == 1, lines[end:]
    assert 'messages in' in lines[-1]
    contents = read_log(log)
    assert contents.stamps('joint_states')[-1] == 500_000_000
    assert contents.messages['controller/state'][-1:] != []


@pytest.mark.slow
def test_real_time_nodes_delayed_at_the_end_exit(
    tmp_path: Path,
) -> None:
    """The first state that they receive after the delay is the last one of the run."""
    last = 2_000_000_000
    with processes(tmp_path, fresh=True) as started, peer(started.domain) as tester:
        stamps = [-1]
        tester.subscribe(
            JointState, 'joint_states', lambda raw: stamps.append(header_stamp(raw)), raw=True
        )
        arguments = ros_arguments(
            duration=last * 1e-9,
            control_period=0.002,
            pacing='realtime',
            plant__wait_for='[controller, trajectory, recorder, peer]',
            trajectory__window=0.2,
            trajectory__horizon=0.2,
            recorder__output=tmp_path / 'run.mcap',
        )
        nodes = started.start_all(*arguments)
        tester.until(lambda: stamps[-1] > 0, 'a run')
        for name in ('controller', 'trajectory'):
            nodes[name].signal(signal.SIGSTOP)
        tester.until(lambda: stamps[-1] == last, 'the last state')
        for name in ('controller', 'trajectory'):
            nodes[name].signal(signal.SIGCONT)
        assert set(started.wait().values()) == {0}, started.output()
    assert read_log(tmp_path / 'run.mcap').stamps('effort_commands')[-1] == last


def test_take_rest_after_delay_processes_all_messages() -> None:
    """Only the time spent on listening counts towards the timeout."""
    arrivals = [time.monotonic() - 60.0]
    spins = iter(range(100))

    def spin() -> None:
        turn = next(spins)
        time.sleep(0.5 if turn in (0, 3) else 0.02)
        if turn in (1, 2, 4):
            arrivals.append(time.monotonic())

    take_rest(spin, lambda: arrivals[-1])
    assert len(arrivals) == 4
    assert next(spins) > 7


@pytest.mark.parametrize('pacing', ['realtime', 'lockstep'])
def test_plant_robot_diverges_exits_with_one_line(pacing: str, tmp_path: Path) -> None:
    with processes(tmp_path, fresh=True) as started, peer(started.domain) as tester:
        states = tester.collect(JointState, 'joint_states', raw=True)
        commands = tester.publisher(Float64MultiArray, 'effort_commands')
        plant = started.start(
            'plant', *ros_arguments(pacing=pacing, wait_for='[peer]', duration=100.0)
        )
        tester.wait_for_subscribers(commands)
        tester.until(lambda: states, 'the first state')
        commands.publish(huge_command())
        assert plant.wait() == 2, started.output()
        (line,) = plant.complaints()
    assert line.startswith('plant: the closed loop diverged at t = 0.001 s; expected gains and a')
    assert ('ticks were late' in line) == (pacing == 'realtime')


@pytest.mark.parametrize('pacing', ['realtime', 'lockstep'])
def test_endless_plant_robot_diverges_waits_for_reset(pacing: str, tmp_path: Path) -> None:
    with processes(tmp_path, fresh=True) as started, peer(started.domain) as tester:
        states = tester.collect(JointState, 'joint_states', raw=True)
        commands = tester.publisher(Float64MultiArray, 'effort_commands')
        plant = started.start(
            'plant', *ros_arguments(pacing=pacing, wait_for='[peer]', duration=0.0)
        )
        tester.wait_for_subscribers(commands)
        tester.until(lambda: states, 'the first state')
        for number in range(10):
            commands.publish(huge_command())
            tester.until(lambda n=number: len(divergences(plant)) > n, 'the warning')
            tester.call(SetBool, 'plant/pause', SetBool.Request(data=True))
            refusal = tester.call(Trigger, 'plant/step', Trigger.Request())
            assert not refusal.success
            assert 'call reset first' in refusal.message
            tester.call(SetBool, 'plant/pause', SetBool.Request(data=False))
            states.clear()
            assert tester.call(Trigger, 'plant/reset', Trigger.Request()).success
            # The last states before the divergence may arrive later than the warning.
            tester.until(lambda: 0 in map(header_stamp, states), 'the initial state')
        assert plant.process.poll() is None
        lines = divergences(plant)
    assert len(lines) == 10
    assert 'the closed loop diverged at t = 0.001 s; expected gains' in lines[0]
    assert lines[0].endswith('; the robot stands until ~/reset is called')


def divergences(plant: NodeProcess) -> list[str]:
    return [line for line in plant.stderr() if 'diverged' in line]


def huge_command() -> bytes:
    huge = EffortCdr()
    huge.data[:] = 1e308
    huge.set_stamp(0)
    return huge.to_bytes()


def test_composed_loop_diverges_exits_with_one_line(tmp_path: Path) -> None:
    with processes(tmp_path, fresh=True) as started:
        arguments = ros_arguments(
            controller__switching='implicit',
            controller__observer_gain=1.0,
            controller__model_scale=9.0,
            plant__wait_for='[controller, trajectory]',
        )
        composed = started.start('composed', *arguments)
        assert composed.wait() == 2, started.output()
        (line,) = composed.complaints()
    assert 'the closed loop diverged at t = ' in line


BLOCKED = """
import ctypes
from masmc_ros.nodes.process import runtime
runtime._PATIENCE = 0.2
with runtime.bounded_ending(9):
    pass
print('complete')
with runtime.bounded_ending({status}):
    ctypes.{library}(None).sleep(600)
"""


@pytest.mark.parametrize('status', [0, 2])
@pytest.mark.parametrize('library', ['CDLL', 'PyDLL'])  # PyDLL holds the interpreter
def test_bounded_ending_blocked_keeps_status_and_output(library: str, status: int) -> None:
    result = subprocess.run(
        [sys.executable, '-c', BLOCKED.format(library=library, status=status)],
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert (result.returncode, result.stdout, result.stderr) == (status, 'complete\n', '')


WAITING = (
    ('trajectory', {}, 'waiting for the plant (odom)'),
    ('trajectory', {'start_time': -1.0}, 'waiting for the controller to become active'),
    ('controller', {}, 'waiting for the plant (joint_states)'),
    ('recorder', {}, 'waiting for the senders of joint_states, effort_commands'),
    ('plant', {'wait_for': '[controller]'}, 'waiting for controller'),
    ('plant', {'wait_for': '[]'}, "waiting for the controller's command (effort_commands)"),
)
"""Nodes, their settings, and the message about the awaited node when each runs alone."""


@pytest.mark.slow
def test_node_alone_logs_what_it_waits_for(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        alone = []
        for number, (node, settings, reason) in enumerate(WAITING):
            output = {'recorder__output': tmp_path / 'run.mcap'} if node == 'recorder' else {}
            arguments = ros_arguments(**settings, **output)
            space = ('-r', f'__ns:=/space_{number}')
            alone.append((started.start(node, *arguments, *space), reason))
        for process, reason in alone:
            tester.until(lambda p=process, r=reason: p.logged('INFO', r), reason)
        started.signal(signal.SIGINT)
        assert set(started.wait().values()) == {0}, started.output()


def test_signal_during_lock_of_future_does_not_block() -> None:
    """The executor completes its future after signals that arrive while the future is locked."""
    handlers = {number: signal.getsignal(number) for number in ENDING}
    try:
        stop = StopSignals()
        with Context() as context:
            executor = EventsExecutor(context=context)
            future = stop.future(executor)
            with future._lock:
                for _ in range(3):
                    signal.raise_signal(signal.SIGTERM)
            assert stop.requested
            executor.spin_until_future_complete(future, PATIENCE)
            executor.shutdown()
        assert future.cancelled()
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
