# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Services and timeouts of the controller node, in real time and in lockstep."""

from __future__ import annotations

import itertools
from pathlib import Path
import signal
import time
from typing import Any

from helpers.live_run import live_run, LiveRun
from helpers.log_contents import read_log
from helpers.processes import peer, processes, ros_arguments, shortened
from masmc_ros.log.read.reader import read_run
from masmc_ros.loop.controller_events import ACTIVATED, ADAPTATION_RESET, DEACTIVATED, RESUMED
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.parameter_record import read_record
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.topics import JOINTS
from masmc_ros.report.measure.metrics import metrics
from masmc_ros.report.measure.table import cells
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger


def call(run: LiveRun, name: str, value: bool | None = None) -> Any:
    if value is None:
        return run.tester.call(Trigger, f'/controller/{name}', Trigger.Request(), again=False)
    return run.tester.call(SetBool, f'/controller/{name}', SetBool.Request(data=value))


def wait_for_rest(run: LiveRun) -> None:
    """Wait until no torque has been applied for 0.1 s."""
    moved = run.stamp

    def has_rested() -> bool:
        nonlocal moved
        # Earlier states may still arrive.
        if np.any(run.torque):
            moved = run.stamp
        return run.stamp > moved + 100_000_000

    run.tester.until(has_rested, 'rest')


def test_controller_services_and_timeouts_change_state(tmp_path: Path) -> None:
    settings = {'active_on_start': 'false', 'reference_timeout': 0.5, 'fault_action': 'void'}
    with live_run(tmp_path, **settings) as run:
        run.wait_for_state('inactive', 'not enabled')
        wait_for_rest(run)
        assert not call(run, 'clear_fault').success
        assert call(run, 'enable', True).message == 'active'
        run.wait_for_progress()

        assert call(run, 'emergency_stop').success
        run.wait_for_state('fault: emergency stop')
        wait_for_rest(run)
        assert call(run, 'clear_fault').success
        run.wait_for_state('inactive')
        wait_for_rest(run)
        call(run, 'enable', True)
        run.wait_for_progress()
        call(run, 'emergency_stop')
        call(run, 'enable', True)
        run.wait_for_progress()
        assert call(run, 'enable', False).message == 'inactive: disabled'
        wait_for_rest(run)
        call(run, 'enable', True)
        run.wait_for_progress()
        assert call(run, 'reset_adaptation').success
        run.wait_for_progress()

        # Missing states raise a fault, which ends when states arrive again.
        run.nodes['plant'].signal(signal.SIGSTOP)
        run.wait_for_state('fault', 'joint_states', '0.2 s')
        run.wait_for_report('controller', 'message', 'joint_states')
        run.nodes['plant'].signal(signal.SIGCONT)
        run.wait_for_progress()

        # After the reference timeout there is no torque.
        run.nodes['trajectory'].signal(signal.SIGSTOP)
        run.wait_for_state('fault: no reference for 0.5 s')
        wait_for_rest(run)
        run.nodes['trajectory'].signal(signal.SIGCONT)
        run.wait_for_progress()
        run.end()
    contents = read_log(run.log)
    assert contents.messages['diagnostics']


def test_controller_second_source_of_states_fault(tmp_path: Path) -> None:
    """Zeros next to the plant's states are named and end the law, until they end."""
    with live_run(tmp_path) as run:
        run.wait_for_progress()
        states = run.tester.publisher(JointState, 'joint_states')
        message = JointState(name=list(JOINTS), position=[0.0] * 7, velocity=[0.0] * 7)

        def is_fault() -> bool:
            stamp = run.stamp + 1_000_000
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            states.publish(message)
            return run.states[-1].startswith('fault: states of two robots: joint_states from ')

        run.tester.until(is_fault, 'the fault')
        assert '/plant' in run.states[-1]
        run.wait_for_report('controller', 'senders of inputs', '/plant')
        run.tester.node.destroy_publisher(states)
        run.wait_for_progress()
        assert run.nodes['controller'].logged('WARN', 'more than one sender: joint_states from')
        run.end()


@pytest.mark.slow
def test_controller_second_source_of_odometry_fault(tmp_path: Path) -> None:
    """Another pose next to the plant's odometry is named and ends the law, until it ends."""
    settings = {'pose_source': 'odom', 'plant__odom_decimation': 5, 'runaway_detection': 'false'}
    with live_run(tmp_path, **settings) as run:
        run.wait_for_progress()
        source = run.tester.publisher(Odometry, 'odom')
        message = Odometry()
        message.pose.pose.position.x, message.pose.pose.orientation.w = 5.0, 1.0
        # The states of this process may be late; the controller uses odometry of the last 0.1 s.
        shifts = itertools.cycle((1_000_000, 100_000_000, 300_000_000))
        started = time.monotonic()

        def is_fault() -> bool:
            stamp = run.stamp + next(shifts)
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            source.publish(message)
            return run.states[-1].startswith('fault: states of two robots: odom from ')

        run.tester.until(is_fault, 'the fault')
        assert all(name in run.states[-1] for name in ('/plant', '/peer'))
        run.wait_for_report('controller', 'senders of inputs', '/plant')
        run.tester.node.destroy_publisher(source)
        run.wait_for_progress()
        assert run.nodes['controller'].logged('WARN', 'more than one sender: odom from')
        lines = run.nodes['trajectory'].logged('INFO', 'the robot was set back')
        assert len(lines) <= time.monotonic() - started + 1.0
        run.end()


@pytest.mark.slow
def test_controller_restarted_plant_is_no_second_robot(tmp_path: Path) -> None:
    """The killed plant stays in the graph for a time; the new one starts at another state."""
    with live_run(tmp_path) as run:
        # The restart moves the base back by 0.2 m, ten times the smallest jump.
        run.wait_for_progress(1.0)
        run.nodes['plant'].signal(signal.SIGKILL)
        run.nodes['plant'].wait()
        run.wait_for_state('fault', 'joint_states')
        run.start('plant')
        run.wait_for_earlier_report(
            'controller', 'senders of inputs', 'joint_states from /plant and /plant'
        )
        # A second robot would be detected within this time.
        run.wait_for_progress(1.0)
        assert not any('two robots' in text for text in run.states)
        run.end()


@pytest.mark.slow
def test_controller_second_sender_of_references_named(tmp_path: Path) -> None:
    """It may be intended, so it is named and no fault."""
    with live_run(tmp_path) as run:
        run.wait_for_progress()
        reference = run.tester.publisher(Float64MultiArray, 'reference')
        for name in ('reference from ', '/trajectory', '/peer'):
            run.wait_for_report('controller', 'senders of inputs', name)
        run.wait_for_progress()
        assert not any('two robots' in text for text in run.states)
        run.tester.node.destroy_publisher(reference)
        run.tester.until(
            lambda: 'senders of inputs' not in run.health['controller'], 'a single sender'
        )
        assert run.nodes['controller'].logged('WARN', 'more than one sender: reference from ')
        run.end()


def test_controller_disabled_or_guided_keeps_the_arm(tmp_path: Path) -> None:
    """A disabled controller holds the arm; hand guiding balances it. Both end with an approach."""
    with live_run(tmp_path) as run:
        run.wait_for_progress()
        for service in ('enable', 'hand_guide'):
            is_guide = service == 'hand_guide'
            assert call(run, service, is_guide).success
            run.wait_for_state('inactive: hand guiding' if is_guide else 'inactive: disabled')
            later = run.stamp + 300_000_000
            run.tester.until(lambda later=later: run.stamp > later, 'states')
            # The disturbance moves the robot; the controller opposes it.
            assert np.any(run.torque)
            assert call(run, service, not is_guide).message == 'active'
            run.wait_for_progress()
        response = call(run, 'hand_guide', False)
        assert not response.success
        assert response.message == 'hand guiding is not active'
        call(run, 'emergency_stop')
        response = call(run, 'hand_guide', True)
        assert not response.success
        assert 'call ~/clear_fault first' in response.message
        run.end()


def test_lockstep_disabled_controller_answers_with_zeros(tmp_path: Path) -> None:
    file = shortened(tmp_path, 0.5, wait_for='[controller, trajectory, recorder]')
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started:
        started.start_all(
            *ros_arguments(file, recorder__output=log, controller__active_on_start='false')
        )
        assert set(started.wait().values()) == {0}, started.output()
    command = EffortCdr()
    answers = read_log(log).messages['effort_commands']
    assert len(answers) == 501
    for raw in answers:
        assert command.load(raw)
        assert not command.data.any()


@pytest.mark.slow
def test_path_starts_at_activation_with_pose_from_odometry(tmp_path: Path) -> None:
    settings = {
        'pose_source': 'odom',
        'active_on_start': 'false',
        'trajectory__start_time': -1.0,
        'plant__odom_decimation': 5,
        'plant__wait_for': '[controller, trajectory, peer]',
    }
    with live_run(tmp_path, 'plant', 'trajectory', 'controller', **settings) as run:
        windows = run.tester.collect(Float64MultiArray, 'reference', raw=True)
        errors = run.tester.collect(Float64MultiArray, 'controller/tracking_error', past=False)
        wait_for_rest(run)
        assert windows == []
        disabled = run.stamp
        wait_for_rest(run)
        assert windows == []
        call(run, 'enable', True)
        run.wait_for_progress()
        moved = run.stamp
        run.wait_for_progress(3.0)
        # Latched messages may arrive after later ones, because discovery takes time.
        stamps = [window.stamp_ns for window in map(ReferenceWindow.from_bytes, windows) if window]
        first = min(stamp for stamp in stamps if stamp is not None)
        # The trajectory may use the state before that of the activation.
        assert disabled <= first < moved
        # The path starts at the robot; therefore errors stay small.
        assert max(np.abs(message.data[2:]).max() for message in errors) < 0.1
        run.end()


@pytest.mark.slow
def test_second_command_publisher_reported(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        run = LiveRun(started, tester, tmp_path, {'plant__wait_for': '[controller, peer]'})
        for name in ('plant', 'trajectory', 'controller'):
            run.start(name)
        run.wait_for_progress()
        other = tester.publisher(Float64MultiArray, 'effort_commands')
        tester.wait_for_subscribers(other)
        run.wait_for_report('controller', 'others on effort_commands', '/peer')
        run.wait_for_report('plant', 'senders of commands', '/peer')
        run.end()


@pytest.mark.slow
def test_torque_limits_hold_across_all_controller_states(tmp_path: Path) -> None:
    """After a zero command the torque starts at zero, independent of the command's cause."""
    # Less than the law requests at times to oppose the disturbance.
    limit, rate, period = np.array([0.2, 0.2, 0.15, 0.15]), 20.0, 0.002
    settings = {'torque_limit': str(limit.tolist()), 'torque_rate_limit': rate}
    stop = {'fault_action': 'void', 'runaway_detection': 'false'}
    with live_run(tmp_path, **settings, **stop) as run:
        raw = run.tester.collect(Float64MultiArray, 'effort_commands', raw=True)
        requested = run.tester.collect(Float64MultiArray, 'controller/raw_torque', past=False)
        record_messages = run.tester.collect(String, 'controller/parameters')
        run.wait_for_progress(1.0)
        call(run, 'enable', False)
        wait_for_rest(run)
        call(run, 'enable', True)
        run.wait_for_progress()
        call(run, 'emergency_stop')
        call(run, 'enable', True)
        run.wait_for_progress()
        call(run, 'reset_adaptation')
        run.wait_for_progress()
        run.tester.until(
            lambda: any((np.abs(raw.data[2:]) > limit).any() for raw in requested[-500:]),
            'a requested torque above the limit',
        )
        # The plant stops and sends no states; afterwards it continues from the same state.
        run.nodes['plant'].signal(signal.SIGSTOP)
        run.wait_for_state('fault', 'joint_states')
        run.nodes['plant'].signal(signal.SIGCONT)
        run.wait_for_progress()
        # Only the reports after each start contain these keys.
        run.wait_for_earlier_report('controller', 'joints with limited torque', '%')
        run.wait_for_earlier_report('controller', 'ticks with limited torque', '%')
        run.tester.until(
            lambda: read_record(record_messages[-1].data).event in (RESUMED, ACTIVATED),
            'the event',
        )
        run.end()
    records = [read_record(message.data) for message in record_messages]
    events = [record.event for record in records]
    # The torque also starts at zero after missing states, which had no answers.
    activations = {record.tick for record in records if record.event == ACTIVATED}
    message, previous, stops = EffortCdr(), np.zeros(4), 0
    for command in raw:
        assert message.load(command)
        assert message.stamp_ns is not None
        torque = message.data.copy()
        assert (np.abs(torque) <= limit).all()
        if torque.any():
            starts = [previous]
            if round(message.stamp_ns * 1e-9 / period) in activations:
                # The plant may repeat its last state after the pause: two commands have its stamp.
                starts.append(np.zeros(4))
            steps = [np.abs(torque - start).max() for start in starts]
            assert min(steps) <= rate * period * (1.0 + 1e-9), (message.stamp_ns, steps)
        else:
            stops += 1
        previous = torque
    assert stops
    assert (np.abs([message.data[2:] for message in requested]) > limit).any()
    for event in (ACTIVATED, DEACTIVATED, ADAPTATION_RESET):
        assert event in events, events


def test_report_of_stopped_controller_names_reasons(tmp_path: Path) -> None:
    with live_run(tmp_path, fault_action='void') as run:
        run.wait_for_progress()
        call(run, 'enable', False)
        run.wait_for_state('inactive: disabled')
        call(run, 'enable', True)
        run.wait_for_progress()
        run.nodes['plant'].signal(signal.SIGSTOP)
        run.wait_for_state('fault', 'joint_states')
        run.nodes['plant'].signal(signal.SIGCONT)
        run.wait_for_progress()
        # On a busy machine this process sees stamps later than the controller.
        asked = run.stamp
        call(run, 'emergency_stop')
        run.wait_for_state('fault: emergency stop')
        stop = run.stamp
        run.tester.until(lambda: run.stamp > 1.5 * stop, 'states after the stop')
        seen = run.stamp
        run.end()
    logged = read_run(run.log)
    row = metrics(logged)
    disabled, timeout, stopped = row.notes[-3:]
    assert disabled.startswith('Controller inactive: disabled, from t = ')
    assert timeout.startswith('Controller fault: ')
    assert 'joint_states' in timeout
    assert stopped.startswith('Controller fault: emergency stop, from t = ')
    assert stopped.endswith(' s to the end.')
    end = float(stopped.partition('from t = ')[2].split()[0])
    assert asked * 1e-9 - 0.001 <= end + logged.times[0] <= seen * 1e-9
    assert row.errors is not None
    assert row.errors.last == pytest.approx(end, abs=0.1)
    ((_, window, *_),) = cells({'run': row})
    assert window.startswith(f'{row.start:g}-{row.end:g} (only ')
