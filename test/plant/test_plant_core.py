# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Core of the plant without ROS: one state per tick, stamps of commands, and pauses."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.control.actions import Failure, Line, Wait
from masmc_ros.loop.plant_parameters import MAX_REAL_TIME_FACTOR
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.loop.timing import LATE_TICKS, Timing
from masmc_ros.params.declaration import check_all
from masmc_ros.plant.lockstep import LockStep, PacedLockStep
from masmc_ros.plant.plant_core import (
    Actions,
    AwaitCommand,
    CommandPart,
    Commands,
    Done,
    NOTHING,
    PlantCore,
    Publish,
    PublishAgain,
)
from masmc_ros.plant.real_time import RealTime
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.scenario.node_parameters import declared
import numpy as np
import pytest

PERIOD, TIMEOUT = 0.01, 0.1
TORQUE = np.array([0.1, 0.1, 0.2, 0.1])
AHEAD = 800
"""Maximum number of ticks by which lockstep may be ahead of a recorder."""

FEW = settings(max_examples=40, deadline=None)


@cache
def values() -> dict[str, Any]:
    changed = {'control_period': PERIOD, 'duration': 50.0, 'command_timeout': TIMEOUT}
    return check_all(declared('plant', mechanism_from({})), changed)


def core_of(
    kind: type[PlantCore], *, parts: int = 1, changed: Mapping[str, Any] = {}, **options: Any
) -> PlantCore:
    parameters = {**values(), **changed}
    timing = Timing.from_values(parameters)
    shares = [CommandPart(f'part_{i}', 4 // parts) for i in range(parts)]
    return kind(
        plant_of(parameters, timing.period), timing, parameters, Commands(shares), **options
    )


def published(actions: Actions) -> int:
    return sum(isinstance(action, Publish) for action in actions)


def command(core: PlantCore, now: float = 0.0, stamp: int | None = None) -> Actions:
    part = core.commands.parts[0]
    return core.on_command(part, TORQUE, core.stamp if stamp is None else stamp, now)


EVENTS = st.lists(
    st.sampled_from([
        *('valid', 'valid', 'valid', 'void', 'old', 'ahead'),
        *('pause', 'run', 'step', 'reset', 'look'),
    ]),
    max_size=60,
)


@FEW
@given(EVENTS)
def test_lockstep_random_events_one_state_per_command(events: list[str]) -> None:
    core = core_of(LockStep)
    # Before the first state every command is dropped.
    assert (command(core, stamp=0), core.dropped) == (NOTHING, 1)
    assert published(core.start(0.0)) == 1
    is_paused, steps, dropped, has_command = False, 0, 1, False
    for event in events:
        tick = core.robot.tick
        if event in ('valid', 'void'):
            part = core.commands.parts[0]
            numbers = None if event == 'void' else TORQUE
            actions = core.on_command(part, numbers, core.stamp, 0.0)
            has_command = True
        elif event in ('old', 'ahead'):
            actions = command(core, stamp=core.stamp + (-1 if event == 'old' else 1))
            dropped += 1
        elif event in ('pause', 'run'):
            # A step that still waits for its command is dropped, here and by a reset.
            is_paused, steps = event == 'pause', 0
            actions = core.on_pause(0.0, is_paused=is_paused)
        elif event == 'step':
            assert bool(core.step_refusal()) != is_paused
            actions = NOTHING
            if is_paused:
                steps += 1
                actions = core.on_step(0.0)
        elif event == 'reset':
            actions, has_command, steps = core.on_reset(0.0), False, 0
            assert (published(actions), core.robot.tick, core.stamp) == (1, 0, 0)
            continue
        else:
            actions = core.on_timer(0.0)
        advances = has_command and (steps > 0 if is_paused else True)
        assert published(actions) == advances == core.robot.tick - tick
        if advances:
            has_command, steps = False, max(0, steps - 1)
        assert core.stamp == round(core.robot.tick * PERIOD * 1e9)
        assert core.dropped == dropped


@FEW
@given(
    st.lists(st.tuples(st.floats(0.0, 0.1), st.booleans()), min_size=1, max_size=60),
    st.sampled_from([0.5, 1.0]),
)
def test_lockstep_limited_never_faster_than_limit(
    waits: list[tuple[float, bool]], factor: float
) -> None:
    core = core_of(PacedLockStep, changed={MAX_REAL_TIME_FACTOR.name: factor})
    now = 0.0
    core.start(now)
    for wait, is_answered in waits:
        now += wait
        tick = core.robot.tick
        actions = command(core, now) if is_answered else core.on_timer(now)
        # The same command again: a state follows an answer to the previous one only.
        assert published(actions) == core.robot.tick - tick <= 1
        assert core.robot.tick * PERIOD <= factor * (now + 0.05) + 1e-9


@pytest.mark.parametrize('factor', [1.0, 2.0])
def test_lockstep_limited_fast_answers_keep_speed(factor: float) -> None:
    core = core_of(PacedLockStep, changed={MAX_REAL_TIME_FACTOR.name: factor})
    core.start(0.0)
    now = 0.0
    # Its timer is up to 30 ms late, and answers need 1 ms.
    for step in range(400):
        now += core.timer_period if step % 50 else 0.03
        actions, answered = core.on_timer(now), now
        while published(actions) or not core.commands.is_complete:
            answered += 1e-3
            actions = command(core, answered)
    assert factor * now - 0.06 < core.robot.tick * PERIOD <= factor * (now + 0.05)


def test_lockstep_limited_slow_answers_slow_time_down() -> None:
    core = core_of(PacedLockStep, changed={MAX_REAL_TIME_FACTOR.name: 1.0})
    core.start(0.0)
    now = 0.0
    while now < 3.0:
        now += 2.5 * PERIOD
        assert published(command(core, now)) == 1
    assert core.robot.tick * PERIOD == pytest.approx(now / 2.5)
    # The reason of a wait is reported once per second, as without a limit.
    reasons = [core.on_timer(now + 0.01 * step) for step in range(250)]
    assert sum(AwaitCommand('part_0') in actions for actions in reasons) == 2


def test_lockstep_two_command_parts_waits_for_both() -> None:
    core = core_of(LockStep, parts=2)
    core.start(0.0)
    first, second = core.commands.parts
    assert core.on_command(second, TORQUE[2:], core.stamp, 0.0) == NOTHING
    core.on_timer(0.0)
    assert core.on_timer(1.0) == (AwaitCommand('part_0'),)
    assert published(core.on_command(first, TORQUE[:2], core.stamp, 1.0)) == 1


def test_lockstep_recorder_without_progress_no_longer_awaited() -> None:
    core = core_of(LockStep)
    core.start(0.0)
    core.on_recorded(0, 0.0)
    for _ in range(AHEAD + 1):
        assert published(command(core)) == 1
    assert command(core, 1.0) == NOTHING
    assert core.on_timer(1.0) == (Wait(None),)
    assert core.on_timer(2.0) == (Wait('the recorder (recorder/progress)'),)
    # Its report continues the run; a pause of the run does not count as missing progress.
    assert published(core.on_recorded(core.stamp // 2, 100.0)) == 1
    for _ in range(AHEAD):
        command(core, 100.0)
    command(core, 200.0)
    core.on_timer(200.0)
    assert core.on_timer(201.0) == (Wait('the recorder (recorder/progress)'),)
    assert core.on_timer(205.0) == (Wait('the recorder (recorder/progress)'),)
    line, state = core.on_timer(206.5)
    assert isinstance(line, Line)
    assert isinstance(state, Publish)
    assert not core.recorder.is_there


@pytest.mark.parametrize('kind', [LockStep, RealTime])
def test_plant_core_last_tick_ends_run_once(kind: type[PlantCore]) -> None:
    core = core_of(kind, **({'waits': False} if kind is RealTime else {}))
    core.start(10.0)
    core.robot.tick = last = round(50.0 / PERIOD)
    core.stamp = round(last * PERIOD * 1e9)
    if kind is LockStep:
        actions = command(core, 12.0)
    else:
        core.on_parameters(('real_time_factor',), 11.9)
        core.on_timer(12.0)
        assert core.is_due
        actions = core.on_due(12.0)
    assert actions == (Done(last, 2.0),)
    assert core.is_over
    assert not core.is_due
    assert not published(core.on_timer(13.0))


class Clock:
    """Clock that wakes a core in real time."""

    def __init__(self, core: RealTime) -> None:
        self.core = core
        self.now = 100.0

    def wake(self, elapsed: float) -> list[Any]:
        self.now += elapsed
        actions = list(self.core.on_timer(self.now))
        while self.core.is_due:
            actions += self.core.on_due(self.now)
        return actions


def running(**options: Any) -> tuple[RealTime, Clock]:
    """Return a core in real time after its first state, with its clock."""
    core = core_of(RealTime, **{'waits': False, **options})
    assert isinstance(core, RealTime)
    clock = Clock(core)
    core.start(clock.now)
    return core, clock


@FEW
@given(st.lists(st.floats(0.0, 0.3), min_size=1, max_size=40), st.sampled_from([0.5, 1.0, 3.0]))
def test_real_time_random_wakes_few_ticks_at_once(times: list[float], factor: float) -> None:
    core, clock = running(changed={'real_time_factor': factor})
    start = clock.now
    for elapsed in times:
        actions = clock.wake(elapsed)
        assert published(actions) <= LATE_TICKS * max(1.0, factor)
        assert core.robot.tick <= (clock.now - start) * factor / PERIOD + 1e-6
    late = core.lateness.total
    assert core.robot.tick + late >= int((clock.now - start) * factor / PERIOD) - len(times)


def test_real_time_before_first_command_state_repeated() -> None:
    core, clock = running(waits=True)
    assert core.text == 'waits for the first command'
    repeated = sum(isinstance(a, PublishAgain) for _ in range(10) for a in clock.wake(0.05))
    assert (repeated, core.robot.tick) == (10, 0)
    command(core, clock.now)
    assert published(clock.wake(1.01 * PERIOD)) == 1
    # A pause stops time; the age of the command does not increase.
    core.on_pause(clock.now, is_paused=True)
    for _ in range(20):
        assert not published(clock.wake(1.0))
    assert published(core.on_step(clock.now)) == 1
    core.on_pause(clock.now, is_paused=False)
    assert published(clock.wake(1.01 * PERIOD)) == 1
    assert core.commands.held() is not None


def test_real_time_old_command_and_old_answer_dropped() -> None:
    core, clock = running()
    command(core, clock.now)
    lines: list[Any] = []
    for _ in range(30):
        lines += [action for action in clock.wake(PERIOD) if isinstance(action, Line)]
    (line,) = lines
    assert line.text == 'no command on part_0 for 0.1 s; the drives hold until one comes'
    assert core.commands.held() is None
    command(core, clock.now, core.stamp - round(1.1e9 * TIMEOUT))
    command(core, clock.now, core.stamp + 1)
    assert core.dropped == 2
    command(core, clock.now, core.stamp - round(0.9e9 * TIMEOUT))
    assert core.commands.held() is not None


def test_real_time_late_process_reads_queue_before_timeout() -> None:
    """A delay of the process that reads commands does not make the last command too old."""
    core, clock = running()
    command(core, clock.now)
    clock.wake(PERIOD)
    clock.wake(20.0)
    assert core.commands.held() is not None


def test_plant_core_robot_diverges_run_fails() -> None:
    core = core_of(LockStep, changed={'torque_limit': (0.0,) * 4})
    core.start(0.0)
    part = core.commands.parts[0]
    actions: Actions = NOTHING
    while not core.is_over:
        actions = core.on_command(part, np.full(4, 1e200), core.stamp, 0.0)
    (failure,) = actions
    assert isinstance(failure, Failure)
    assert core.robot.tick < round(50.0 / PERIOD)
    assert command(core) == NOTHING


def test_real_time_twist_with_stamp_zero_is_unlabelled() -> None:
    """The header of a twist is empty at any time; a label of torques names the state of t = 0."""
    for is_header, count in ((True, 0), (False, 1)):
        core = core_of(RealTime, waits=False)
        part = core.commands.parts[0]
        part.is_zero_unlabelled = is_header
        core.start(0.0)
        core.stamp = 10**9
        assert core.on_command(part, TORQUE, 0, 0.0) == NOTHING
        assert (core.dropped, part.is_here) == (count, is_header)


def test_real_time_dropped_commands_logged_once() -> None:
    """Single late commands are counted; ten in a row have a clock of their own and get a line."""
    core = core_of(RealTime, waits=False)
    core.start(0.0)
    actions = [action for _ in range(30) for action in command(core, stamp=10**18)]
    assert core.dropped == 30
    (line,) = actions
    assert isinstance(line, Line)
    assert 'part_0 ignored: its stamp is 1e+09 s' in line.text
    command(core)
    assert [command(core, now=9.0, stamp=10**18) for _ in range(9)] == [NOTHING] * 9
