# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Services and timeouts of the controller node, in real time and in lockstep."""

from __future__ import annotations

from pathlib import Path
import signal
from typing import Any

from helpers.live_run import live_run, LiveRun
from helpers.log_contents import read_log
from helpers.processes import peer, processes, ros_arguments, shortened
from masmc_ros.loop.controller_events import ACTIVATED, ADAPTATION_RESET, DEACTIVATED, RESUMED
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.parameter_record import read_record
from masmc_ros.messages.reference_window import ReferenceWindow
import numpy as np
import pytest
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
            last = 0.0 if round(message.stamp_ns * 1e-9 / period) in activations else previous
            assert (np.abs(torque - last) <= rate * period * (1.0 + 1e-9)).all(), message.stamp_ns
        else:
            stops += 1
        previous = torque
    assert stops
    assert (np.abs([message.data[2:] for message in requested]) > limit).any()
    for event in (ACTIVATED, DEACTIVATED, ADAPTATION_RESET):
        assert event in events, events
