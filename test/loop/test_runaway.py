# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Run-away detection: true alarms, no false alarms, and standstill afterwards."""

from __future__ import annotations

from helpers.core_loop import CoreLoop, node_values
from helpers.processes import PAPER as PAPER_FILE
from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.law.registry import LAWS
from masmc_ros.loop.runaway import RunawayWatch
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

CONFIG = PAPER_FILE.parent

PAPER = {
    'control_period': 0.001,
    'robot.speed_limits': [
        'wheel_right_joint 40.0', 'wheel_left_joint 40.0', 'arm_joint_1 8.0', 'arm_joint_2 8.0',
    ],
}


def check_rest_after_runaway(loop: CoreLoop) -> None:
    """Wait for the fault, remove its cause, and check the hold."""
    for _ in range(round(5.0 / loop.period)):
        if loop.state.startswith('fault'):
            break
        loop.step()
    assert loop.state.startswith('fault: run-away'), loop.reports
    assert np.abs(loop.plant.true_velocity[3:]).max() < 60.0
    loop.drives = lambda torque: torque
    signals = loop.run(10.0)
    assert loop.state.startswith('fault: run-away')
    assert np.abs(signals['velocity'][:, 3:]).max() < 60.0
    assert np.abs(signals['velocity'][-100:, 3:]).max() < 10.0


def test_runaway_late_states_of_accurate_law_detected() -> None:
    """With states 5 ms old at 1 kHz the disturbance estimate diverges."""
    check_rest_after_runaway(CoreLoop(node_values(PAPER, plant={'measurement_delay': 0.005})))


@pytest.mark.parametrize('joint', [2, 3])
def test_runaway_reversed_joint_detected(joint: int) -> None:
    loop = CoreLoop(node_values(PAPER))
    loop.run(1.0)
    sign = np.ones(4)
    sign[joint] = -1.0
    loop.drives = lambda torque: sign * torque
    start = loop.now
    check_rest_after_runaway(loop)
    detected = next(time for time, text in loop.reports if text.startswith('fault'))
    assert detected - start < 0.4


@pytest.mark.parametrize(('gap', 'is_alarm'), [(0.05, True), (0.1, False), (10.0, False)])
def test_runaway_error_grows_without_states_no_alarm(gap: float, is_alarm: bool) -> None:
    """A joint is at its limit; after a time without states the robot has another position."""
    controller = CoreLoop(node_values(PAPER)).controller
    watch, rates = RunawayWatch(controller, [np.inf] * 4), np.zeros(4)
    controller.torque[:] = np.array(controller.values['torque_limit'])
    reasons = []
    for error, held in ((0.01, 0), (0.1, round(gap / controller.period)), (0.1, 0)):
        controller.error[:] = error
        watch.skip(held, 0.0)
        reasons += [alarm.reason for _ in range(100) if (alarm := watch.look(rates, 0.0))]
    assert any('the error grows' in reason for reason in reasons) is is_alarm


@pytest.mark.parametrize(('lateness', 'is_passing'), [(0.05, True), (0.005, False)])
def test_runaway_states_old_alarm_passes(lateness: float, is_passing: bool) -> None:
    """A controller that is late processes its queue without a gap in the stamps."""
    controller = CoreLoop(node_values()).controller
    watch, rates = RunawayWatch(controller, [np.inf] * 4), np.zeros(4)
    controller.torque[:] = np.array(controller.values['torque_limit'])
    alarms = []
    for tick in range(40):
        controller.error[:] = 0.01 * tick
        watch.note_age(lateness if tick < 10 else 0.0, 0.01 * tick)
        alarms.append(watch.look(rates, 0.01 * tick))
    first = next(alarm for alarm in alarms if alarm is not None)
    assert first.is_passing is is_passing
    assert first.reason.endswith('; states were late') is is_passing


def run_with_late_states(loop: CoreLoop, seed: int, share: float, longest: int) -> None:
    """Run 1 s in which a share of the torques is held for 2 to `longest` periods more."""
    random = np.random.default_rng(seed)
    end = loop.now + 1.0
    while loop.now < end:
        loop.step()
        if random.random() < share:
            for _ in range(random.integers(2, longest, endpoint=True)):
                loop.step(has_state=False)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    st.floats(0.0, 8.0),
    st.lists(st.tuples(st.integers(1, 4), st.integers(2, 9)), min_size=4, max_size=8),
)
def test_runaway_states_late_for_half_second_no_alarm(
    start: float, holds: list[tuple[int, int]]
) -> None:
    """At 100 Hz a busy machine holds torques for 20 to 90 ms, again and again."""
    loop = CoreLoop(node_values())
    loop.run(start)
    end = loop.now + 0.5
    for computed, held in holds:
        if loop.now + held * loop.period < end:
            loop.run(computed * loop.period)
            loop.run(held * loop.period, has_state=False)
    loop.run(3.0)
    assert loop.state == 'active', loop.reports


@settings(max_examples=8, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_runaway_one_torque_of_twenty_held_no_alarm(seed: int) -> None:
    loop = CoreLoop(node_values())
    for second in range(20):
        run_with_late_states(loop, seed + second, 0.05, 9)
    assert loop.state == 'active', loop.reports


@pytest.mark.parametrize('seed', range(4))
def test_runaway_half_of_torques_held_error_is_large(seed: int) -> None:
    """The robot has left its path by decimetres when the alarm stops it."""
    loop = CoreLoop(node_values())
    largest = 0.0
    for second in range(20):
        if loop.state != 'active':
            break
        run_with_late_states(loop, 20 * seed + second, 0.5, 9)
        largest = max(largest, float(np.abs(loop.controller.error).max()))
    assert loop.state.startswith('fault: run-away'), loop.reports
    assert largest > 0.1


@pytest.mark.parametrize('seed', [1, 2, 350])
def test_runaway_late_for_a_second_law_continues(seed: int) -> None:
    """The error grows at a limit because of late states: the alarm passes, and the law settles."""
    loop = CoreLoop(node_values())
    loop.run(2.0)
    run_with_late_states(loop, 20 * seed, 0.5, 9)
    loop.run(5.0)
    assert any(text.endswith('; states were late') for _, text in loop.reports)
    assert loop.state == 'active', loop.reports
    assert np.abs(loop.controller.error).max() < 0.005


def test_runaway_fault_latched_until_cleared() -> None:
    loop = CoreLoop(node_values(PAPER, plant={'measurement_delay': 0.005}))
    loop.run(3.0)
    assert loop.core.guide_refusal(enabled=True)
    loop.perform(loop.core.on_clear(loop.now))
    assert loop.state == 'inactive: a fault was cleared'


@pytest.mark.parametrize('law', ['smc', 'rasmc'])
@pytest.mark.parametrize('period', [0.001, 0.01])
def test_runaway_ordinary_run_no_alarm(law: str, period: float) -> None:
    loop = CoreLoop(node_values({**PAPER, 'control_period': period}, controller={'law': law}))
    loop.run(20.0)
    assert loop.state == 'active'


@pytest.mark.slow
@pytest.mark.parametrize('law', list(LAWS))
def test_runaway_ordinary_run_of_every_law_no_alarm(law: str) -> None:
    """The run has 1 kHz, the limits of the default drives and the implicit reaching term."""
    loop = CoreLoop(node_values(PAPER, controller={'law': law}))
    loop.run(10.0)
    assert loop.state == 'active', loop.reports


@pytest.mark.slow
@pytest.mark.parametrize('law', ['variable_structure', 'rasmc'])
def test_runaway_tiago_unstable_law_comes_to_rest(law: str) -> None:
    """`variable_structure` with gains of axes in m, and `rasmc` with a delay of 5 ms diverge."""
    delay = 0.0 if law == 'variable_structure' else 0.005
    settings = [
        'pacing=realtime', f'controller.law={law}', f'plant.measurement_delay={delay}',
        'controller.observer_gain=0.5',
        *(
            f'controller.variable_structure.{name}={value}'
            for name, value in (('alpha', 200.0), ('beta', 100.0), ('k', 120.0))
        ),
    ]
    loop = CoreLoop(load_scenario(str(CONFIG / 'tiago.yaml'), settings))
    limits = np.array(loop.controller.mechanism.speed_limits)
    peak = 0.0
    for _ in range(10_000):
        loop.step()
        peak = max(peak, float((np.abs(loop.plant.true_velocity[3:]) / limits).max()))
        if loop.state.startswith('fault'):
            break
    assert loop.state.startswith('fault: run-away'), loop.reports
    signals = loop.run(10.0)
    ratios = np.abs(signals['velocity'][:, 3:]) / limits
    assert max(peak, ratios.max()) < 4.0
    assert ratios[-1000:].max() < 0.6


@pytest.mark.slow
def test_compensated_latency_late_states_no_alarm() -> None:
    """The prediction tolerates states that otherwise raise an alarm."""
    control = {'law': 'smc', 'latency': 0.005}
    loop = CoreLoop(node_values(PAPER, plant={'measurement_delay': 0.005}, controller=control))
    loop.run(10.0)
    assert loop.state == 'active', loop.reports
    assert np.hypot(*loop.controller.error[:2]) < 1e-3
