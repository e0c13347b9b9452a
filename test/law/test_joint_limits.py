# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Joint limits that every law keeps: intervals of accelerations, and the change of torques."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment
from helpers.core_loop import node_values
from helpers.limited_arm import limited_arm
from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.law.parts.joint_limits import highest_acceleration, limit_change
from masmc_ros.loop.controller import Controller
from masmc_ros.robot.robot import robot_of
import numpy as np
import pytest
from scipy.optimize import lsq_linear

SEEDS = st.integers(0, 2**32 - 1)

_change = getattr(limit_change, 'py_func', limit_change)
_highest = getattr(highest_acceleration, 'py_func', highest_acceleration)


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.integers(1, 6))
def test_limit_change_equals_reference_solver(seed: int, joints: int) -> None:
    rng = np.random.default_rng(seed)
    root = np.tril(rng.uniform(-0.5, 0.5, (joints, joints)), -1) + np.diag(
        rng.uniform(0.5, 2.0, joints)
    )
    inertia, free = root @ root.T, rng.normal(0.0, 10.0, joints)
    lowest = rng.uniform(-15.0, 0.0, joints)
    highest = lowest + rng.uniform(0.1, 20.0, joints)
    accelerations, change = free.copy(), np.empty(joints)
    wide = np.full(joints, np.inf)
    _change(np.linalg.inv(inertia), accelerations, lowest, highest, -wide, wide, change)
    # min (a - free)' H (a - free) within the intervals.
    best = lsq_linear(root.T, root.T @ free, (lowest, highest), method='bvls', tol=1e-14).x
    np.testing.assert_allclose(accelerations, best, atol=1e-5)
    np.testing.assert_allclose(inertia @ (best - free), change, atol=1e-4)


def test_limit_change_keeps_bounds_of_torques() -> None:
    accelerations, change = np.array([10.0, 0.0]), np.empty(2)
    wide, bound = np.full(2, 5.0), np.full(2, 2.0)
    _change(np.eye(2), accelerations, -wide, wide, -bound, bound, change)
    assert change.tolist() == [-2.0, 0.0]
    assert accelerations.tolist() == [8.0, 0.0]


@settings(max_examples=60, deadline=None)
@given(
    SEEDS, st.floats(0.001, 0.02), st.floats(1.0, 50.0), st.floats(0.2, 5.0),
    st.sampled_from((1.0, 0.5, 2.0)),
)  # fmt: skip
def test_joint_with_extreme_requests_keeps_limits(
    seed: int, period: float, deceleration: float, fastest: float, gain: float
) -> None:
    """`gain` is the nominal inertia divided by the true one."""
    rng = np.random.default_rng(seed)
    # In much narrower ranges a joint cannot brake for both ends.
    narrow = 32.0 * deceleration * period * period
    lower, upper = -rng.uniform(narrow, 1.0 + narrow), rng.uniform(narrow, 1.0 + narrow)
    at, speed, wish = 0.0, 0.0, 0.0
    # At an end a joint turns within half a period.
    slack = 0.125 * deceleration * period * period
    slack += 0.0 if gain == 1.0 else 2.0 * period * fastest
    reached = 0.0
    for _ in range(300):
        high = _highest(upper - at, speed, fastest, 2.0 * period, deceleration)
        low = -_highest(at - lower, -speed, fastest, 2.0 * period, deceleration)
        if rng.random() < 0.05:
            wish = rng.choice((-1e3, 1e3))
        acceleration = gain * min(max(wish, low), high)
        at += period * speed + 0.5 * period * period * acceleration
        speed += period * acceleration
        reached = max(reached, abs(speed) / fastest, at / upper, at / lower)
        assert abs(speed) <= fastest * (1.0 + 1e-9)
        assert lower - slack <= at <= upper + slack
    assert reached > 0.1


RUN = """
import sys
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
for choice, scale in (('ignore', '1.0'), ('enforce', '1.0'), ('enforce', '2.0')):
    simulation = Simulation(load_scenario(sys.argv[1], [
        'robot.task=joints', 'robot.limit_margin=0.0', 'control_period=0.005', 'duration=0.6',
        'plant.initial_joints=[0.0, 0.75]', 'trajectory.line_sine.offset=[0.0, 0.75]',
        'trajectory.line_sine.amplitude=[0.5, 0.4]', 'trajectory.line_sine.frequency=[4.0, 5.0]',
        'trajectory.line_sine.phase=[0.0, 0.0]', 'controller.law=computed_torque',
        'controller.model_scale=' + scale, 'controller.joint_limits=' + choice,
    ]))
    blocks = list(simulation.run())
    position = np.concatenate([block.true_position for block in blocks])[:, -2:]
    speed = np.concatenate([block.true_velocity for block in blocks])[:, -2:]
    ends = np.array([[-0.3, 0.6], [0.2, 0.9]])
    beyond = np.maximum(ends[0] - position, position - ends[1]).max()
    print(beyond, np.abs(speed).max(), simulation.controller.limited_ticks)
"""


@pytest.mark.slow
def test_enforced_limits_hold_where_ignored_ones_fail(tmp_path: Path) -> None:
    urdf = tmp_path / 'arm.urdf'
    urdf.write_text(limited_arm((-0.3, 0.2), (0.6, 0.9), 2.0), encoding='utf-8')
    output = subprocess.run(
        [sys.executable, '-c', RUN, str(urdf)],
        env={**child_environment(), 'NUMBA_DISABLE_JIT': '1'},
        check=True, capture_output=True, text=True, timeout=300,
    ).stdout  # fmt: skip
    ignored, nominal, doubled = (
        tuple(map(float, line.split())) for line in output.strip().splitlines()[-3:]
    )
    assert ignored[0] > 0.1
    assert ignored[2] == 0
    assert nominal[0] <= 0.0
    assert nominal[1] <= 2.0
    assert doubled[0] <= 0.004
    assert doubled[1] <= 2.0
    assert min(nominal[2], doubled[2]) > 10


@pytest.mark.parametrize('name', ['command_interface', 'robot.speed_limits'])
def test_enforced_limits_name_what_is_missing(name: str) -> None:
    shared, own = {'robot.speed_limits': ('arm_joint_1 2.0',)}, {'joint_limits': 'enforce'}
    if name == 'command_interface':
        own[name] = 'velocity'
    else:
        shared.clear()
    values = node_values(shared, controller=own)['controller']
    with pytest.raises(InputError, match=name):
        Controller(robot_of(values), 0.001, values)
