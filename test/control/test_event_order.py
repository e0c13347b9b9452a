# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Regression tests: orders of events in which a torque remained active or a run did not end."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

from helpers.core_loop import CoreLoop, node_values
from masmc_ros.control.actions import (
    Actions,
    Command,
    Finish,
    Halt,
    HaltCommand,
    Line,
    Repeat,
    StopCommand,
    Void,
)
from masmc_ros.errors import InputError
from masmc_ros.loop.closed_loop import NOT_FINITE
from masmc_ros.messages.reference_window import ReferenceWindow
import numpy as np
import pytest

NS = 10_000_000
"""Control period in ns."""


def loop_of(**controller: Any) -> CoreLoop:
    return CoreLoop(node_values(controller=controller))


def kinds(actions: Actions) -> list[type]:
    return [type(action) for action in actions]


def send(loop: CoreLoop, stamp: int, now: float) -> Actions:
    actions = loop.core.on_state(stamp, loop.plant.position, loop.plant.velocity, now)
    loop.perform(actions)
    return actions


def pass_time(loop: CoreLoop, now: float, seconds: float) -> float:
    """Advance by a time in s without a state; return the new time."""
    for _ in range(round(seconds / 0.01)):
        now += 0.01
        loop.perform(loop.core.on_timer(now))
    return now


def test_core_alternating_late_and_repeated_states_fault() -> None:
    """For stamps 48, 47, 48, 47, ... the last torque must not remain active."""
    loop = loop_of()
    loop.run(0.48)
    last, now = (loop.tick - 1) * NS, loop.now
    for step in range(100):
        now += 0.01
        send(loop, last - NS * (step % 2), now)
        loop.perform(loop.core.on_timer(now))
    assert loop.state.startswith('fault: no usable joint_states')
    assert loop.torque is None


def test_core_driver_repeats_stamp_fault() -> None:
    loop = loop_of()
    loop.run(0.5)
    now = loop.now
    for _ in range(50):
        now += 0.01
        assert Command not in kinds(send(loop, (loop.tick - 1) * NS, now))
        loop.perform(loop.core.on_timer(now))
    assert loop.state.startswith('fault: no usable joint_states')


def test_core_paused_plant_repeats_stamp_no_fault() -> None:
    loop = loop_of()
    loop.perform(loop.core.on_plant('realtime'))
    loop.run(0.5)
    now = loop.now
    for _ in range(1000):
        now += 0.02
        assert kinds(send(loop, (loop.tick - 1) * NS, now)) == [Repeat]
        loop.perform(loop.core.on_timer(now))
    assert loop.state == 'active'


def test_core_repeated_state_ends_fault_of_missing_states() -> None:
    """A plant that sent no states while it was paused repeats its state."""
    loop = loop_of()
    loop.perform(loop.core.on_plant('realtime'))
    loop.run(0.5)
    now = pass_time(loop, loop.now, 0.5)
    assert loop.state.startswith('fault: no usable joint_states')
    send(loop, (loop.tick - 1) * NS, now + 0.01)
    assert loop.state == 'active'


def test_core_stop_with_pending_last_state_ends_run() -> None:
    loop = CoreLoop(node_values({'duration': 0.2}))
    loop.run(0.1, has_reference=True)
    last = loop.timing.stamp(20)
    core = loop.core
    # The windows so far cover the whole run; without them the last state has to wait.
    core.reference.windows._windows.clear()
    core.reference.windows._recent = None
    loop.tick = 20
    assert Finish not in kinds(send(loop, last, 0.2))
    assert core.states.pending == last
    actions = core.on_stop(0.21)
    assert kinds(actions)[-1] is Finish


def test_core_single_stamp_far_ahead_run_continues() -> None:
    loop = CoreLoop(node_values({'duration': 100.0}))
    loop.run(0.1)
    now, ahead = loop.now, 150_000_000_000
    assert Finish not in kinds(send(loop, ahead, now))
    send(loop, ahead - NS, now + 0.001)  # late
    send(loop, ahead, now + 0.002)  # repeated
    samples = np.zeros((10, 3, 4))
    samples[:, 0] = [0.3, 0.5, 0.0, 0.0]
    window = ReferenceWindow(ahead, loop.period, samples)
    assert Finish not in kinds(loop.core.on_reference(window, now + 0.003))


def test_core_law_fails_sends_one_command() -> None:
    loop = loop_of()
    loop.run(0.5)

    def fail(*_: Any) -> int:
        raise RuntimeError('law failed')

    loop.controller.answer = fail  # type: ignore[method-assign]
    sent = [k for k in kinds(send(loop, loop.tick * NS, loop.now)) if k.__name__ != 'State']
    assert len([k for k in sent if k is Void or issubclass(k, Command)]) == 1


def test_core_enable_after_reference_end_holds_then_faults() -> None:
    loop = loop_of(reference_timeout=1.0)
    loop.run(2.0)
    loop.perform(loop.core.on_enable(loop.now, enabled=False))
    loop.run(20.0, has_reference=False)
    loop.perform(loop.core.on_enable(loop.now, enabled=True))
    loop.run(0.5, has_reference=False)
    assert loop.state == 'active'
    loop.run(1.0, has_reference=False)
    assert loop.state == 'fault: no reference for 1 s'


@pytest.mark.parametrize('action', ['void', 'hold'])
def test_core_change_to_real_time_while_inactive_halts(action: str) -> None:
    loop = CoreLoop(node_values({'pacing': 'lockstep'}, controller={'fault_action': action}))
    loop.run(0.5)
    actions = loop.core.on_enable(loop.now, enabled=False)
    assert not {Halt, HaltCommand} & set(kinds(actions))
    actions = loop.core.on_plant('realtime')
    assert (Halt if action == 'void' else HaltCommand) in kinds(actions)


def test_core_change_to_real_time_after_released_hand_guiding_halts() -> None:
    loop = CoreLoop(node_values({'pacing': 'lockstep'}))
    loop.run(0.5)
    loop.perform(loop.core.on_guide(loop.now, enabled=True))
    loop.run(0.1)
    assert loop.core.drive.stop.commands
    assert not {Halt, HaltCommand} & set(kinds(loop.core.on_transition(0, 'cleanup', loop.now)))
    assert Halt in kinds(loop.core.on_plant('realtime'))
    assert not loop.core.drive.stop.commands


def test_core_shutdown_halts() -> None:
    loop = loop_of()
    loop.run(0.5)
    assert kinds(loop.core.on_shutdown()) == [Halt]


def test_core_enable_without_states_raises_fault_again() -> None:
    """The timeout counts from the activation; the deadline is never in the past."""
    loop = loop_of()
    loop.run(0.5)
    now = pass_time(loop, loop.now, 0.3)
    assert loop.state.startswith('fault: no usable joint_states')
    loop.perform(loop.core.on_enable(now, enabled=True))
    assert loop.core.deadline > now
    now = pass_time(loop, now, 0.05)
    assert loop.state == 'active'
    now = pass_time(loop, now, 0.3)
    assert loop.state.startswith('fault: no usable joint_states')
    assert loop.torque is None


def test_core_law_fails_after_tick_torque_rate_limited() -> None:
    rate = 50.0
    loop = loop_of(torque_rate_limit=(rate,) * 4)
    loop.run(0.5)
    previous = loop.core.controller.commanded.copy()
    compute = loop.core.controller.answer

    def answer(*arrays: Any) -> int:
        compute(*arrays)
        raise InputError('law')

    with patch.object(loop.core.controller, 'answer', answer):
        send(loop, loop.tick * NS, loop.now + 0.01)
    assert loop.state == 'fault: law'
    change = np.abs(loop.core.controller.commanded - previous)
    assert (change <= rate * 0.01 * (1.0 + 1e-9)).all()
    assert change.any()


@pytest.mark.parametrize('pacing', ['realtime', 'lockstep'])
def test_core_endless_run_torque_not_finite_safe_stop_commands(pacing: str) -> None:
    loop = loop_of(pacing=pacing)
    loop.run(0.5)
    compute = loop.core.controller.answer

    def answer(*arrays: Any) -> int:
        status = compute(*arrays)
        # The kernel has already stored the torque of this tick as commanded.
        loop.core.controller.commanded[:] = np.nan
        return status | NOT_FINITE

    with patch.object(loop.core.controller, 'answer', answer):
        actions = send(loop, loop.tick * NS, loop.now + 0.01)
    assert loop.state.startswith('fault: the closed loop diverged')
    assert StopCommand in kinds(actions)
    assert np.isfinite(loop.core.controller.commanded).all()


CALM = {'disturbance.amplitude': (0.0,) * 4}
STRETCHED = {**CALM, 'initial_joints': (0.0,) * 4}
"""Plant whose elbow bends before the law starts."""


def unfolding() -> CoreLoop:
    """Return a loop that unfolds after its first activation."""
    loop = CoreLoop(node_values(controller={'active_on_start': False}, plant=STRETCHED))
    loop.run(0.2)
    loop.perform(loop.core.on_enable(loop.now, enabled=True))
    loop.run(0.1)
    assert loop.core.drive.is_unfolding
    return loop


def comes_to_rest(loop: CoreLoop, **options: bool) -> None:
    """Check that joints move less and less, under torques."""
    loop.run(3.0, **options)
    assert loop.torque is not None
    assert np.abs(loop.plant.true_velocity[3:]).max() < 0.3


def test_core_end_of_hand_guiding_without_reference_stops_robot() -> None:
    """A torque of hand guiding must not stay active before the first tick of the law."""
    loop = CoreLoop(node_values(controller={'active_on_start': False}, plant=CALM))
    loop.run(0.2, has_reference=False)
    loop.perform(loop.core.on_guide(loop.now, enabled=True))
    loop.run(0.5, has_reference=False)
    loop.perform(loop.core.on_guide(loop.now, enabled=False))
    assert HaltCommand in kinds(send(loop, loop.tick * NS, loop.now))
    loop.tick += 1
    comes_to_rest(loop, has_reference=False)
    assert loop.state == 'active'


def test_core_reference_lost_while_unfolding_stops_robot() -> None:
    loop = unfolding()
    loop.core.reference.windows._windows.clear()
    loop.core.reference.windows._recent = None
    comes_to_rest(loop, has_reference=False)


@pytest.mark.parametrize('is_stop', [True, False])
def test_core_stop_while_unfolding_holds(is_stop: bool) -> None:
    loop = unfolding()
    core = loop.core
    actions = core.on_stop(loop.now) if is_stop else core.on_enable(loop.now, enabled=False)
    assert HaltCommand in kinds(actions)
    loop.perform(actions)
    comes_to_rest(loop)


def test_core_enabled_after_loss_of_states_void_in_time() -> None:
    """The gravity torque of the last state ends after 0.1 s also if the law is enabled."""
    loop = loop_of(state_timeout=1.0)
    loop.run(0.5)
    now = loop.now
    while loop.state == 'active':
        now = pass_time(loop, now, 0.01)
    assert loop.torque is not None
    loop.perform(loop.core.on_enable(now, enabled=True))
    pass_time(loop, now, 0.12)
    assert loop.torque is None


def test_core_enabled_repeatedly_without_states_faults() -> None:
    loop = loop_of()
    loop.run(0.5)
    now = loop.now
    for _ in range(20):
        now = pass_time(loop, now, 0.05)
        if loop.state != 'active':
            return
        loop.perform(loop.core.on_enable(now, enabled=True))
    raise AssertionError('no fault')


def test_core_pose_jump_is_logged_only_if_approached() -> None:
    loop = loop_of()
    assert Line in kinds(loop.core.on_jump(0.0))
    assert Line not in kinds(loop.core.on_jump(0.01))
    assert Line in kinds(loop.core.on_jump(100.0))
    loop.run(0.5)
    loop.perform(loop.core.on_enable(loop.now, enabled=False))
    assert loop.core.on_jump(300.0) == ()
    assert CoreLoop(node_values({'pacing': 'lockstep'})).core.on_jump(0.0) == ()
