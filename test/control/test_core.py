# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Random sequences of events for the controller's core, without ROS."""

from __future__ import annotations

from functools import cache
import math
from typing import Any

from hypothesis import event, HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule, RuleBasedStateMachine
from masmc_ros.control.actions import (
    Actions,
    Command,
    Failure,
    Finish,
    Halt,
    HaltCommand,
    Line,
    Record,
    Repeat,
    State,
    StopCommand,
    Telemetry,
    Void,
)
from masmc_ros.control.controller_core import ControllerCore
from masmc_ros.control.layer_watch import LayerWatch
from masmc_ros.control.supervisor import FINALIZED, transitions_from, UNCONFIGURED
from masmc_ros.errors import InputError
from masmc_ros.loop.closed_loop import NOT_FINITE
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.params.declaration import check_all
from masmc_ros.reference.approach import Approach
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.node_parameters import declared
import numpy as np

PERIOD = 0.01
NS = round(1e9 * PERIOD)
LIMIT, RATE = np.array([8.0, 8.0, 20.0, 10.0]), np.array([400.0, 400.0, 1000.0, 500.0])


@cache
def base() -> dict[str, Any]:
    limits = {'torque_limit': LIMIT.tolist(), 'torque_rate_limit': RATE.tolist()}
    return check_all(declared('controller'), {**limits, 'control_period': PERIOD})


class Core(RuleBasedStateMachine):
    """State machine of random events; it checks the actions after each event."""

    @initialize(
        pacing=st.sampled_from(['lockstep', 'realtime']),
        action=st.sampled_from(['void', 'gravity', 'hold']),
        active=st.sampled_from([True, True, True, False]),
        last=st.sampled_from([0.0, 1.0]),
    )
    def start(self, pacing: str, action: str, active: bool, last: float) -> None:
        values = {**base(), 'pacing': pacing, 'active_on_start': active, 'duration': last}
        values['fault_action'] = action
        robot, timing = robot_of(values), Timing.from_values(values)
        self.controller = controller = Controller(robot, PERIOD, values)
        self.failure: Any = None
        compute = controller.answer

        def answer(*arrays: Any) -> int:
            failure, self.failure = self.failure, None
            status = compute(*arrays)
            if isinstance(failure, Exception):
                raise failure
            return status if failure is None else failure

        controller.answer = answer  # type: ignore[method-assign]
        approach, layer = Approach(robot, values['approach_speed']), LayerWatch(controller)
        self.core = ControllerCore(controller, approach, layer, timing, values)
        self.now, self.stamp = 10.0, 20 * NS
        self.is_over = False
        self.text = ''
        self.waiting: int | None = None
        self.torque, self.reset = np.zeros(4), True
        self.sent: tuple[str, int] | None = None
        self.position = np.array([0.0, 0.0, 1.57, 0.0, 0.0, 0.78, -1.57])
        self.perform(self.core.start())

    def perform(self, actions: Actions, state: int | None = None) -> None:
        """Apply the actions of an event, and check them."""
        answers = [a for a in actions if type(a) in (Command, StopCommand, Void)]
        moves = self.core.pacing.is_timed and self.sent is not None and self.sent[0] != 'Void'
        for action in actions:
            event(f'{self.core.pacing.name} {type(action).__name__}')
            if isinstance(action, State):
                event(f'{self.core.pacing.name} {action.text[:24]}')
        assert len(answers) <= 1
        for action in actions:
            kind = type(action)
            if kind in (Command, StopCommand, HaltCommand):
                is_law = kind is Command
                assert is_law == self.core.supervisor.is_active or kind is HaltCommand
                torque = self.controller.torque.copy()
                assert np.isfinite(torque).all()
                assert (np.abs(torque) <= LIMIT).all()
                change = np.abs(torque - self.torque)
                assert (change <= RATE * PERIOD * (1 + 1e-9)).all()
                self.torque, self.sent = torque, (kind.__name__, action.stamp)
                if kind is HaltCommand:
                    assert self.core.pacing.is_timed
                    assert action.stamp == self.core.states.order.last
            elif kind in (Void, Halt):
                self.torque, self.sent = np.zeros(4), ('Void', action.stamp)
                if kind is Halt:
                    assert self.core.pacing.is_timed
                    assert action.stamp == self.core.states.order.last
            elif kind is Repeat:
                assert self.sent is not None
                assert len(actions) == 1
            elif kind is State:
                self.text, self.lifecycle = action.text, action.lifecycle
            elif kind is Record:
                assert len(answers) == 1
                assert action.stamp == answers[0].stamp
                assert action.tick == round(action.stamp / NS)
            elif kind is Telemetry:
                assert type(answers[0]) is Command
            elif kind in (Failure, Finish):
                self.is_over = True
                assert kind is Finish or not self.core.pacing.is_timed
        if answers:
            # The answer is to the new state or to the waiting one, and each has one answer.
            assert answers[0].stamp == (self.waiting if state is None else state)
            self.waiting = None
        elif state is not None and not self.is_over:
            assert self.core.states.pending == state
            if moves and state != self.waiting:
                # The last torque does not stay active while a state waits.
                assert {Halt, HaltCommand} & {type(action) for action in actions}
            self.waiting = state
        # Without the law, no state waits for a reference.
        assert self.waiting == self.core.states.pending or self.is_over
        assert self.is_over or self.core.supervisor.is_active or self.waiting is None
        assert self.text == self.core.supervisor.text
        assert self.lifecycle == self.core.lifecycle
        if self.lifecycle in (UNCONFIGURED, FINALIZED):
            assert self.sent is None or self.sent[0] == 'Void' or not self.core.pacing.is_timed
            assert all(type(answer) is Void for answer in answers)

    while_running = precondition(lambda self: not self.is_over)

    @while_running
    @rule(
        steps=st.sampled_from([1] * 8 + [2, 3, 0, -1, -2, 19, 20, 21, 40, -19, -20, -21, -60]),
        moved=st.floats(-0.02, 0.02),
        elapsed=st.sampled_from([0.001, 0.01, 0.05]),
    )
    def state(self, steps: int, moved: float, elapsed: float) -> None:
        self.send(steps, moved, elapsed)

    def send(self, steps: int, moved: float, elapsed: float) -> None:
        self.now += elapsed
        stamp = max(0, self.stamp + steps * NS)
        self.position[5:] += moved
        velocity = np.zeros(7)
        order = self.core.states.order
        last, pending = order.last, self.core.states.pending
        late, gaps = self.core.states.counts.late, self.core.states.counts.gaps
        is_stopped = self.core.drive.stop.commands
        actions = self.core.on_state(stamp, self.position, velocity, self.now)
        if self.core.states.counts.late > late:
            assert actions == ()
            return
        is_back = any(type(a) is Line and 'time was set back' in a.text for a in actions)
        if (is_back or self.core.states.counts.gaps > gaps) and not is_stopped:
            # After a jump of time the robot does not apply the law's last torque.
            self.torque = np.zeros(4)
        if is_back and not self.core.pacing.is_timed:
            self.sent = None  # the restarted robot has no command yet, also if its pacing changes
        if stamp == last and pending is None and [type(a) for a in actions] == [Repeat]:
            self.perform(actions)
        else:
            self.stamp = stamp
            self.perform(actions, stamp)

    @while_running
    @rule(
        first=st.integers(-20, 30),
        count=st.integers(1, 60),
        offset=st.floats(-1.0, 1.0),
        speed=st.sampled_from([0.0, 0.1, 0.3, 5.0]),
    )
    def window(self, first: int, count: int, offset: float, speed: float) -> None:
        samples = np.zeros((count, 3, 4))
        samples[:, 0] = np.array([0.3, 0.5, 0.0, 0.0]) + offset
        samples[:, 0, 0] += speed * PERIOD * np.arange(count)
        samples[:, 1, 0] = speed
        window = ReferenceWindow(max(0, self.stamp + first * NS), PERIOD, samples)
        try:
            actions = self.core.on_reference(window, self.now)
        except InputError as error:
            assert 'cannot be reached' in str(error)
            return
        self.perform(actions)

    @while_running
    @rule(number=st.sampled_from([0.0, 0.5, math.nan]))
    def set_point(self, number: float) -> None:
        window = ReferenceWindow(None, 0.0, np.full((1, 4), number))
        try:
            actions = self.core.on_reference(window, self.now)
        except InputError:
            return
        self.perform(actions)

    @while_running
    @rule(count=st.integers(1, 12), moved=st.floats(-0.01, 0.01))
    def ordinary_ticks(self, count: int, moved: float) -> None:
        samples = np.zeros((60, 3, 4))
        samples[:, 0] = [0.3, 0.5, 0.0, 0.0]
        start = max(0, self.stamp - 2 * NS)
        self.perform(self.core.on_reference(ReferenceWindow(start, PERIOD, samples), self.now))
        for _ in range(count):
            if not self.is_over:
                self.send(1, moved, 0.01)

    @while_running
    @rule(looks=st.sampled_from([1, 2, 5, 12, 40]))
    def time(self, looks: int) -> None:
        for _ in range(looks):
            self.now += 0.02
            if not self.is_over:
                self.perform(self.core.on_timer(self.now))
                assert self.core.deadline > self.now

    @while_running
    @rule(late=st.floats(0.0, 0.5))
    def time_to_the_deadline(self, late: float) -> None:
        if self.core.deadline < math.inf:
            self.now = max(self.now, self.core.deadline + late)
            self.perform(self.core.on_timer(self.now))
            assert self.core.deadline > self.now

    @while_running
    @rule(enabled=st.booleans())
    def enable(self, enabled: bool) -> None:
        self.perform(self.core.on_enable(self.now, enabled=enabled))
        expected = enabled and not self.core.enable_refusal(enabled=True)
        assert self.core.supervisor.is_active == expected

    @while_running
    @rule()
    def stop(self) -> None:
        was_active = self.core.supervisor.is_active
        self.perform(self.core.on_stop(self.now))
        assert not self.core.supervisor.is_active
        if was_active and self.sent is not None and self.core.pacing.is_timed:
            assert self.sent[0] != 'Command'

    @while_running
    @rule(enabled=st.booleans())
    def guide(self, enabled: bool) -> None:
        if not self.core.guide_refusal(enabled=enabled):
            self.perform(self.core.on_guide(self.now, enabled=enabled))
            assert self.core.supervisor.is_guided == enabled

    @while_running
    @rule(
        number=st.sampled_from([0, 1, 2, 3, 4, 5, 6, 7, 60, 99]),
        label=st.sampled_from(['', '', '', 'configure', 'cleanup', 'activate', 'create']),
    )
    def transition(self, number: int, label: str) -> None:
        available = {
            key: transition.goal
            for transition in transitions_from(self.core.lifecycle)
            for key in (transition.label, transition.number)
        }
        before = self.core.lifecycle, self.text
        actions = self.core.on_transition(number, label, self.now)
        if (label or number) in available:
            assert actions is not None
            self.perform(actions)
            # The law of a pending state may fail at once.
            goal = available[label or number]
            assert self.lifecycle == goal or self.text.startswith('fault')
        else:
            assert actions is None
            assert (self.core.lifecycle, self.core.supervisor.text) == before

    @while_running
    @rule()
    def states_that_repeat_and_are_late(self) -> None:
        """Send stamps 48, 47, 48, 47, ...: after the timeout only void commands are active."""
        # No stamp is older than zero.
        if not self.core.pacing.is_timed or self.sent is None or not self.core.states.order.last:
            return
        self.stamp = self.core.states.order.last or 0
        for step in range(40):
            self.send(-1 if step % 2 else 0, 0.0, 0.02)
            if self.core.deadline <= self.now:
                self.perform(self.core.on_timer(self.now))
            if self.is_over:
                return
        assert not self.core.supervisor.is_active

    @while_running
    @rule()
    def clear(self) -> None:
        self.perform(self.core.on_clear(self.now))

    @while_running
    @rule()
    def reset_adaptation(self) -> None:
        self.perform(self.core.on_reset_adaptation())

    @while_running
    @rule(
        changed=st.sampled_from(
            [
                {'k_s1': (50.0,) * 4},
                {'state_timeout': 0.1},
                {'state_timeout': 0.3},
                {'reference_timeout': 0.0},
                {'reference_timeout': 0.1},
                {'switching': 'saturation'},
                {'switching': 'implicit'},
                {'fault_action': 'void'},
                {'fault_action': 'hold'},
            ]
        )
    )
    def parameters(self, changed: dict[str, Any]) -> None:
        self.controller.change(changed)
        self.perform(self.core.on_parameters(changed))

    @while_running
    @rule(failure=st.sampled_from([InputError('law'), NOT_FINITE]))
    def law_fails_next(self, failure: Any) -> None:
        self.failure = failure

    @while_running
    @rule()
    def plant_in_real_time(self) -> None:
        self.perform(self.core.on_plant('realtime'))

    @precondition(lambda self: self.is_over)
    @rule()
    def run_has_ended(self) -> None:
        """Do nothing after the end of the run."""

    @invariant()
    def lockstep_has_no_deadline(self) -> None:
        if hasattr(self, 'core') and not self.core.pacing.is_timed:
            assert self.core.deadline == math.inf
            assert 'joint_states' not in self.text


TestCore = Core.TestCase
TestCore.settings = settings(
    max_examples=100,
    stateful_step_count=60,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
