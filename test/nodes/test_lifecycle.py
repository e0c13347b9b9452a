# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lifecycle of the controller node: transitions, events, and invalid requests."""

from __future__ import annotations

from pathlib import Path
import signal
from typing import Any

from benchmarks.hostile import RandomInput
from helpers.live_run import live_run, LiveRun
from helpers.processes import Peer, peer, processes, ros_arguments
from lifecycle_msgs.msg import State, Transition, TransitionEvent
from lifecycle_msgs.srv import (
    ChangeState,
    GetAvailableStates,
    GetAvailableTransitions,
    GetState,
)
from masmc_ros.control.supervisor import STATES, TRANSITIONS
import numpy as np
import pytest
from std_srvs.srv import SetBool
from test_supervision import call, wait_for_rest

SERVICES = {
    'change_state': ChangeState,
    'get_state': GetState,
    'get_available_states': GetAvailableStates,
    'get_available_transitions': GetAvailableTransitions,
    'get_transition_graph': GetAvailableTransitions,
}


def change(tester: Peer, label: str, number: int = 0) -> bool:
    """Request a transition; return its success."""
    request = ChangeState.Request(transition=Transition(id=number, label=label))
    name = '/controller/change_state'
    return bool(tester.call(ChangeState, name, request, again=False).success)


def lifecycle(tester: Peer) -> str:
    """Return the label of the state."""
    name = '/controller/get_state'
    label: str = tester.call(GetState, name, GetState.Request()).current_state.label
    return label


def transitions(tester: Peer, service: str = 'get_available_transitions') -> list[Any]:
    """Return the descriptions of transitions."""
    request = GetAvailableTransitions.Request()
    response = tester.call(GetAvailableTransitions, f'/controller/{service}', request)
    return list(response.available_transitions)


def test_lifecycle_numbers_are_those_of_lifecycle_msgs() -> None:
    for state in STATES:
        assert state.number == getattr(State, f'PRIMARY_STATE_{state.label.upper()}')
    for transition in TRANSITIONS:
        prefix = f'{transition.start.label}_' if transition.label == 'shutdown' else ''
        name = f'TRANSITION_{prefix}{transition.label}'.upper()
        assert transition.number == getattr(Transition, name)


def test_lifecycle_transitions_in_real_time_change_state(tmp_path: Path) -> None:
    with live_run(tmp_path, active_on_start='false') as run:
        tester = run.tester
        events = tester.collect(TransitionEvent, 'controller/transition_event', past=False)
        run.wait_for_state('inactive: not enabled yet')
        run.wait_for_recorder()
        assert lifecycle(tester) == 'inactive'
        # A lifecycle manager configures every node before it activates it.
        assert change(tester, 'configure')
        assert not change(tester, 'deactivate')
        assert change(tester, 'activate')
        run.wait_for_progress()
        assert lifecycle(tester) == 'active'
        assert not change(tester, 'cleanup')
        assert not change(tester, 'no_transition', Transition.TRANSITION_DEACTIVATE)

        assert change(tester, '', Transition.TRANSITION_DEACTIVATE)
        run.wait_for_state('inactive: disabled')
        run.spin(0.3)
        assert np.any(run.torque)
        check_cleaned_up(run)
        assert change(tester, 'activate')
        run.wait_for_progress()
        check_faults(run)

        assert change(tester, 'shutdown')
        run.wait_for_state('inactive: shut down')
        wait_for_rest(run)
        assert transitions(tester) == []
        response = call(run, 'enable', True)
        assert (response.success, response.message) == (
            False,
            'inactive: shut down; start the node again',
        )
        assert lifecycle(tester) == 'finalized'
        run.end()
    changes = [(event.start_state.label, event.goal_state.label) for event in events]
    assert changes == [
        ('inactive', 'active'),
        ('active', 'inactive'),
        ('inactive', 'unconfigured'),
        ('unconfigured', 'inactive'),
        ('inactive', 'active'),
        ('active', 'inactive'),
        ('inactive', 'active'),
        ('active', 'inactive'),
        ('inactive', 'active'),
        ('active', 'finalized'),
    ]


def check_cleaned_up(run: LiveRun) -> None:
    """Release the held robot; only `configure` permits torques again."""
    tester = run.tester
    assert change(tester, 'cleanup')
    wait_for_rest(run)
    assert [description.transition.label for description in transitions(tester)] == [
        'configure',
        'shutdown',
    ]
    assert not change(tester, 'activate')
    for service in ('enable', 'hand_guide'):
        response = call(run, service, True)
        assert (response.success, response.message) == (
            False,
            'inactive: not configured; configure it first',
        )
    assert call(run, 'emergency_stop').message == 'inactive: not configured'
    assert change(tester, 'configure')
    run.wait_for_state('inactive: not enabled yet')
    wait_for_rest(run)


def check_faults(run: LiveRun) -> None:
    """Check that a passing fault is active, and that a latched one is inactive."""
    tester = run.tester
    run.nodes['plant'].signal(signal.SIGSTOP)
    run.wait_for_state('fault: no usable joint_states')
    assert lifecycle(tester) == 'active'
    assert change(tester, 'deactivate')
    run.nodes['plant'].signal(signal.SIGCONT)
    stamp = run.stamp
    tester.until(lambda: run.stamp > stamp + 300_000_000, 'states')
    assert run.states[-1] == 'inactive: disabled'
    assert change(tester, 'activate')
    run.wait_for_progress()
    assert call(run, 'emergency_stop').success
    run.wait_for_state('fault: emergency stop')
    assert lifecycle(tester) == 'inactive'
    assert change(tester, 'activate')
    run.wait_for_progress()


@pytest.mark.slow
def test_lifecycle_random_requests_are_answered(tmp_path: Path) -> None:
    """No request ends the node, whether its transition is unavailable, unknown or random."""
    source = RandomInput(7)
    with processes(tmp_path) as started, peer(started.domain) as tester:
        node = started.start('controller', *ros_arguments(pacing='realtime', duration=0.0))
        descriptions = transitions(tester, 'get_transition_graph')
        assert len(descriptions) == len(TRANSITIONS)
        for number in range(256):
            change(tester, '', number)
        for _ in range(200):
            service = source.random.choice(list(SERVICES))
            request = source.request(SERVICES[service], {})
            tester.call(SERVICES[service], f'/controller/{service}', request, again=False)
        assert lifecycle(tester) == 'finalized'
        assert tester.call(SetBool, '/controller/enable', SetBool.Request(data=False)).success
        node.signal(signal.SIGINT)
        assert node.wait() == 0, started.output()
        assert 'Traceback' not in started.output()
