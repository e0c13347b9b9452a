# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Orders of events in which the controller once left a torque, or did not end."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

from core_loop import CoreLoop, node_values
from masmc_ros.control.actions import (
    Actions,
    Command,
    Finish,
    Halt,
    HaltCommand,
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
    """Let a time pass without a state; return the time after it."""
    for _ in range(round(seconds / 0.01)):
        now += 0.01
        loop.perform(loop.core.on_timer(now))
    return now


def test_late_and_repeated_states_in_turn_raise_a_fault() -> None:
    """Stamps 48, 47, 48, 47, ...: the last torque must not stay."""
    loop = loop_of()
    loop.run(0.48)
    last, now = (loop.tick - 1) * NS, loop.now
    for step in range(100):
        now += 0.01
        send(loop, last - NS * (step % 2), now)
        loop.perform(loop.core.on_timer(now))
    assert loop.state.startswith('fault: no usable joint_states')
    assert loop.torque is None


def test_driver_that_repeats_a_stamp_raises_a_fault() -> None:
    loop = loop_of()
    loop.run(0.5)
    now = loop.now
    for _ in range(50):
        now += 0.01
        assert Command not in kinds(send(loop, (loop.tick - 1) * NS, now))
        loop.perform(loop.core.on_timer(now))
    assert loop.state.startswith('fault: no usable joint_states')


def test_paused_plant_that_repeats_a_stamp_raises_no_fault() -> None:
    loop = loop_of()
    loop.perform(loop.core.on_plant('realtime'))
    loop.run(0.5)
    now = loop.now
    for _ in range(1000):
        now += 0.02
        assert kinds(send(loop, (loop.tick - 1) * NS, now)) == [Repeat]
        loop.perform(loop.core.on_timer(now))
    assert loop.state == 'active'


def test_fault_of_missing_states_ends_with_a_repeated_state() -> None:
    """A plant that was silent while it was paused repeats its state."""
    loop = loop_of()
    loop.perform(loop.core.on_plant('realtime'))
    loop.run(0.5)
    now = pass_time(loop, loop.now, 0.5)
    assert loop.state.startswith('fault: no usable joint_states')
    send(loop, (loop.tick - 1) * NS, now + 0.01)
    assert loop.state == 'active'


def test_pending_last_state_ends_the_run_after_a_stop() -> None:
    loop = CoreLoop(node_values({'duration': 0.2}))
    loop.run(0.1, has_reference=True)
    last = loop.timing.stamp(20)
    core = loop.core
    # The windows so far cover everything: forget them, so the last state has to wait.
    core.windows._windows.clear()
    core.windows._recent = None
    loop.tick = 20
    assert Finish not in kinds(send(loop, last, 0.2))
    assert core._pending == last
    actions = core.on_stop(0.21)
    assert kinds(actions)[-1] is Finish


def test_single_stamp_far_ahead_does_not_end_a_run() -> None:
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


def test_fault_within_a_tick_sends_one_command() -> None:
    loop = loop_of()
    loop.run(0.5)

    def fail(*_: Any) -> int:
        raise RuntimeError('law failed')

    loop.controller.answer = fail  # type: ignore[method-assign]
    sent = [k for k in kinds(send(loop, loop.tick * NS, loop.now)) if k.__name__ != 'State']
    assert len([k for k in sent if k is Void or issubclass(k, Command)]) == 1


def test_enable_long_after_the_reference_ended_holds_first() -> None:
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
def test_change_to_real_time_while_inactive_ends_the_torque(action: str) -> None:
    loop = CoreLoop(node_values({'pacing': 'lockstep'}, controller={'fault_action': action}))
    loop.run(0.5)
    actions = loop.core.on_enable(loop.now, enabled=False)
    assert not {Halt, HaltCommand} & set(kinds(actions))
    actions = loop.core.on_plant('realtime')
    assert (Halt if action == 'void' else HaltCommand) in kinds(actions)


def test_shutdown_commands_nothing() -> None:
    loop = loop_of()
    loop.run(0.5)
    assert kinds(loop.core.on_shutdown()) == [Halt]


def test_enable_during_silence_raises_the_fault_again() -> None:
    """The patience counts from the activation; the deadline is never in the past."""
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


def test_law_that_fails_after_its_tick_the_torque_changes_by_one_step() -> None:
    rate = 50.0
    loop = loop_of(torque_rate_limit=(rate,) * 4)
    loop.run(0.5)
    before = loop.core.controller.commanded.copy()
    compute = loop.core.controller.answer

    def answer(*arrays: Any) -> int:
        compute(*arrays)
        raise InputError('law')

    with patch.object(loop.core.controller, 'answer', answer):
        send(loop, loop.tick * NS, loop.now + 0.01)
    assert loop.state == 'fault: law'
    change = np.abs(loop.core.controller.commanded - before)
    assert (change <= rate * 0.01 * (1.0 + 1e-9)).all()
    assert change.any()


def test_torque_that_is_not_finite_the_safe_stop_commands() -> None:
    loop = loop_of()
    loop.run(0.5)
    compute = loop.core.controller.answer

    def answer(*arrays: Any) -> int:
        status = compute(*arrays)
        # As the kernel leaves it: the torque of this tick counts as commanded already.
        loop.core.controller.commanded[:] = np.nan
        return status | NOT_FINITE

    with patch.object(loop.core.controller, 'answer', answer):
        actions = send(loop, loop.tick * NS, loop.now + 0.01)
    assert loop.state.startswith('fault: the closed loop diverged')
    assert StopCommand in kinds(actions)
    assert np.isfinite(loop.core.controller.commanded).all()
