# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Bases with an axle next to the base frame, skid-steer bases, and steered wheels."""

from __future__ import annotations

import json
import math
from pathlib import Path
import subprocess
import sys
from typing import Any

from helpers.child_environment import child_environment
from helpers.tree_bits import model_of
from helpers.wheeled_tree import (
    AHEAD,
    BODY,
    HALF,
    JOINT,
    MECANUM_ANGLES,
    RADIUS,
    RANGE,
    robot_text,
    SKID,
    WEAK,
    wheel,
    WHEELS,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.tree import dynamics, kinematics
from masmc_ros.robot.tree.assembly import AXLE, tree_robot, TreeRobot
from masmc_ros.robot.tree.identified import values_of
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
from masmc_ros.robot.tree.tree_model import OMNIDIRECTIONAL
from masmc_ros.robot.tree.urdf_defaults import urdf_defaults
from masmc_ros.robot.tree.wheels import driving_wheels, Mount
from masmc_ros.robot.urdf import Joint, Pose, read_urdf
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

FEW = settings(max_examples=40, deadline=None)
SEED = st.integers(0, 2**32 - 1)

ON_AXLE = robot_text(wheel('right', AHEAD, -1), wheel('left', AHEAD, 1))
def cart(text: str, wheels: tuple[str, ...], **settings: Any) -> TreeRobot:
    """Return the robot on its wheels."""
    arguments = {'base': 'differential', 'wheels': wheels, 'armature': 0.01, **settings}
    return tree_robot(read_urdf(text, 'cart.urdf'), 'cart.urdf', **arguments)


def test_axle_ahead_of_base_frame_equals_added_link() -> None:
    """The added link is the base frame, as one that the user adds and names."""
    link = f'<link name="mine"/><joint name="m" type="fixed"><parent link="base"/>\
<child link="mine"/><origin xyz="{AHEAD} 0 0"/></joint></robot>'
    wheels = ('right_joint', 'left_joint')
    own = cart(ON_AXLE, wheels)
    stated = cart(ON_AXLE.replace('</robot>', link), wheels, base_frame='mine')
    assert (own.base_frame, stated.base_frame, stated.axle) == (AXLE, 'mine', None)
    np.testing.assert_array_equal(own.inertial_parameters, stated.inertial_parameters)
    np.testing.assert_array_equal(own.tree.offset, stated.tree.offset)
    np.testing.assert_array_equal(own.tree.armature, stated.tree.armature)
    assert own.frames['base'].offset == pytest.approx((-AHEAD, 0.0, 0.0))
    assert "the middle of the wheels is at x 0.15 m, y 0 m of 'base'" in own.notes[0]


def test_axle_ahead_transforms_lead_to_root_link() -> None:
    """The published transforms place the root link behind the axle, also after a turn."""
    values = {
        'robot.urdf': ON_AXLE, 'robot.base': 'differential',
        'robot.wheels': ('right_joint', 'left_joint'), 'robot.task': ('joints',),
    }  # fmt: skip
    mechanism = tree_mechanism(values)
    assert mechanism.frames[0] == ('odom', AXLE)
    assert f'<link name="{AXLE}"' in mechanism.text
    position = np.array([[1.0, 2.0, 0.5 * math.pi, 0.0, 0.0, 0.0, 0.0]])
    poses = mechanism.formulas.frame_transforms(mechanism.frame_motion.origin, position)[0]
    back = mechanism.frames.index((AXLE, 'base'))
    np.testing.assert_allclose(poses[0, :3], [1.0, 2.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(poses[back, :3], [-AHEAD, 0.0, 0.0], atol=1e-15)
    # A description with other inertial parameters keeps the link and its place.
    robot = robot_of({p.name: p.default for p in mechanism.parameters} | values)
    again = tree_mechanism(values_of(robot, robot.theta))
    np.testing.assert_allclose(
        again.robot.inertial_parameters, mechanism.robot.inertial_parameters, atol=1e-12
    )


@pytest.mark.parametrize(
    ('text', 'wheels', 'expected'),
    [
        (ON_AXLE, ('left_joint', 'right_joint'), 'the right one first, at the smaller y'),
        (
            robot_text(wheel('right', 0.1, -1), wheel('left', 0.2, 1)),
            ('right_joint', 'left_joint'), 'expected both on one axle',
        ),
        (
            robot_text(*(wheel(f'w{i}', 0.1 * i, -1 if i else 1) for i in range(4))),
            tuple(f'w{i}_joint' for i in range(4)), 'as many on the right as on the left',
        ),
        (ON_AXLE, ('right_joint',), 'or of all wheels of a skid-steer base'),
        (
            ON_AXLE.replace(f'-{HALF} {RADIUS}"/><axis xyz="0 1', f'-{HALF} 0.2"/><axis xyz="1 0'),
            ('right_joint', 'left_joint'),
            "is along (1.0, 0.0, 0.0), expected parallel to the base's y; joint 'left_joint':"
            ' wheels at heights [0.2, 0.1] m, expected equal ones',
        ),
    ],
)  # fmt: skip
def test_differential_wheels_invalid_raise_one_line(
    text: str, wheels: tuple[str, ...], expected: str
) -> None:
    with pytest.raises(InputError) as raised:
        cart(text, wheels)
    assert expected in str(raised.value)
    assert '\n' not in str(raised.value)


def test_skid_steer_rates_limits_and_shares() -> None:
    robot = cart(SKID, WHEELS, track_factor=1.8)
    wheels = robot.wheels
    assert wheels is not None
    ahead, turn = 1.0 / RADIUS, 1.8 * HALF / RADIUS
    expected = [[ahead, turn], [ahead, turn], [-ahead, turn], [ahead, -turn]]
    np.testing.assert_allclose(wheels.matrix, expected, rtol=1e-12)
    assert [drive.name for drive in wheels.drives] == [WHEELS[0], WHEELS[2]]
    assert robot.limits.effort[:2].tolist() == [8.0 + WEAK, 16.0]
    assert [drive.friction for drive in wheels.drives] == [0.4, 0.4]
    assert wheels.followers == {
        WHEELS[1]: (WHEELS[0], 1.0, 0.0), WHEELS[3]: (WHEELS[2], -1.0, 0.0),
    }  # fmt: skip
    # Torques of the drives at their limits are those of all wheels, of equal power.
    torques = wheels.wheel_torques(np.array([[8.0 + WEAK, -16.0]]))[0]
    np.testing.assert_allclose(torques, [8.0, WEAK, -8.0, 8.0])
    np.testing.assert_allclose(
        wheels.matrix.T @ torques, wheels.drive_matrix.T @ [8.0 + WEAK, -16.0], rtol=1e-12
    )


def test_skid_steer_without_limits_shares_are_equal() -> None:
    wheels = cart(SKID.replace(f'effort="{WEAK}"', 'effort="0"'), WHEELS).wheels
    assert wheels is not None
    assert wheels.drives[0].effort == math.inf
    np.testing.assert_allclose(wheels.wheel_torques(np.ones((1, 2)))[0, :2], 0.5)


def check_against_pinocchio(text: str, robot: TreeRobot, base: Array, rows: Array) -> None:
    """
    Compare mass matrix and bias with those of the floating tree with all wheels, for v = P nu.

    The base's rates move the root link by `base` (6, rates) and the wheels by `rows` (N, rates).
    """
    pin = pytest.importorskip('pinocchio')
    assert robot.wheels is not None
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    data, parameters = model.createData(), robot.inertial_parameters.ravel()
    rates, arm = rows.shape[1], ('upper_joint', 'hand_joint')
    to_all = np.zeros((model.nv, rates + 2))
    to_all[:6, :rates] = base
    for wheel_, row in zip(robot.wheels.joints, rows, strict=True):
        to_all[model.joints[model.getJointId(wheel_.name)].idx_v, :rates] = row
    for k, name in enumerate(arm, rates):
        to_all[model.joints[model.getJointId(name)].idx_v, k] = 1.0
    armature = np.diag([0.0] * 6 + [0.01] * (model.nv - 6))
    draw, tree = np.random.default_rng(1), model_of(robot)
    for _ in range(100):
        angles, velocity = draw.uniform(-2.0, 2.0, 2), draw.normal(size=rates + 2)
        q = pin.neutral(model)
        for name, angle in zip(arm, angles, strict=True):
            q[model.joints[model.getJointId(name)].idx_q] = angle
        full = pin.crba(model, data, q)
        full = np.triu(full) + np.triu(full, 1).T + armature
        place = kinematics.place(tree, 0.0, 0.0, 0.0, angles, 0)
        expected = to_all.T @ full @ to_all
        close(dynamics.inertia(tree, place, parameters), expected)
        # The map is constant, so the bias has no term of its derivative.
        bias = to_all.T @ pin.nonLinearEffects(model, data, q, to_all @ velocity)
        still = np.zeros(rates + 2)
        close(
            dynamics.inverse_dynamics(
                tree, place, parameters, velocity, velocity, still, dynamics.GRAVITY
            ),
            bias,
        )


def close(actual: Array, expected: Array) -> None:
    assert np.abs(actual - expected).max() <= 1e-12 * (1.0 + np.abs(expected).max())


def test_skid_steer_dynamics_equal_pinocchio() -> None:
    factor = 1.7
    robot = cart(SKID, WHEELS, track_factor=factor)
    base = np.zeros((6, 2))
    # The root link is behind the middle of the wheels.
    base[0, 0], base[1, 1], base[5, 1] = 1.0, -AHEAD, 1.0
    turn = factor * HALF
    rows = np.array([[1.0, turn], [1.0, turn], [-1.0, turn], [1.0, -turn]]) / RADIUS
    check_against_pinocchio(SKID, robot, base, rows)


def test_mecanum_dynamics_equal_pinocchio() -> None:
    """The four wheels push the base; their rates are those of the literature."""
    robot = cart(
        SKID, WHEELS, base='omnidirectional', roller_angles=MECANUM_ANGLES
    )
    base = np.zeros((6, 3))
    base[0, 0] = base[1, 1] = base[5, 2] = 1.0
    # Places and axes of the wheels: front right, rear right, front left (axle to the right),
    # rear left; the rolling rate is (u - y w) + tan(angle) (v + x w), over the radius.
    rows = np.array([
        [axis, axis * tangent, axis * (tangent * x - y)]
        for (x, y, axis), tangent in zip(
            [(0.4, -0.3, 1), (-0.1, -0.3, 1), (0.4, 0.3, -1), (-0.1, 0.3, 1)],
            np.tan(MECANUM_ANGLES), strict=True,
        )
    ]) / RADIUS  # fmt: skip
    check_against_pinocchio(SKID, robot, base, rows)


@FEW
@given(st.integers(4, 7), SEED, st.floats(0.0, 1.2))
def test_wheel_torques_inside_limits_have_the_forces(count: int, seed: int, size: float) -> None:
    """If any torques inside of the limits have the forces, the result is inside and has them."""
    draw = np.random.default_rng(seed)
    angles = 2.0 * math.pi * (np.arange(count) + draw.uniform(0.0, 0.5)) / count
    limits = draw.uniform(1.0, 6.0, count)
    mounts = [
        Mount(
            Joint(f'w{i}', 7, 'continuous', 'base', 'w', Pose(), (0.0, 0.0, 1.0), effort=limit),
            (0.3 * math.cos(angle), 0.3 * math.sin(angle), RADIUS),
            (math.cos(angle), math.sin(angle), 0.0), 0.0,
        )
        for i, (angle, limit) in enumerate(zip(angles, limits, strict=True))
    ]  # fmt: skip
    wheels = driving_wheels(OMNIDIRECTIONAL, mounts, 'x')
    possible = size * draw.uniform(-1.0, 1.0, (20, count)) * limits
    torques = wheels.wheel_torques(possible @ wheels.matrix)
    assert (np.abs(torques) <= limits).all()
    if size <= 0.9:
        np.testing.assert_allclose(
            torques @ wheels.matrix, possible @ wheels.matrix, atol=1e-6
        )
    # One row has the same bits as many.
    np.testing.assert_array_equal(
        wheels.wheel_torques(possible[3:4] @ wheels.matrix)[0],
        wheels.wheel_torques(np.repeat(possible[3:4] @ wheels.matrix, 5, axis=0))[4],
    )
    box = np.array(wheels.base_limits[1]) * draw.choice([-1.0, 1.0], (20, 3))
    np.testing.assert_allclose(wheels.wheel_torques(box) @ wheels.matrix, box, atol=1e-9)


def test_defaults_skid_steer_base_with_all_wheels() -> None:
    defaults = urdf_defaults(SKID, {})
    values = {choice.parameter: choice.value for choice in defaults.choices}
    assert values['robot.base'] == 'differential'
    assert set(values['robot.wheels'][:2]) == set(WHEELS[:2])
    assert set(values['robot.wheels'][2:]) == set(WHEELS[2:])
    assert len(values['plant.initial_joints']) == 4
    reason = next(c.reason for c in defaults.choices if c.parameter == 'robot.base')
    assert 'skid-steer' in reason
    assert values['robot.track_factor'] == 1.5


def steered(name: str, x: float, side: int) -> str:
    """Return a wheel on a steering joint."""
    fork = BODY.format(f'{name}_fork', '0 0 0', 1.0, 0.004, 0.006)
    turn = JOINT.format(
        f'{name}_fork', 'revolute', 'base', f'{x} {side * HALF} {RADIUS}', '0 0 1', RANGE
    )
    rolling = JOINT.format(name, 'continuous', f'{name}_fork', '0 0 0', '0 1 0', '')
    return fork + turn + BODY.format(name, '0 0 0', 1.5, 0.004, 0.006) + rolling


FRONT = steered('front_right_wheel', 0.5, -1), steered('front_left_wheel', 0.5, 1)
REAR = wheel('right_wheel', 0.0, -1), wheel('left_wheel', 0.0, 1)


@pytest.mark.parametrize('rear', [(), REAR])
def test_steered_wheels_rejected_by_name_with_reason(rear: tuple[str, ...]) -> None:
    """Also if the steering joints are held, and with a rear axle, as of a car."""
    text, wheels = robot_text(*FRONT, *rear), ('front_right_wheel_joint', 'front_left_wheel_joint')
    with pytest.raises(InputError) as raised:
        cart(text, wheels, joints=('upper_joint', 'hand_joint'))
    message = str(raised.value)
    assert "that joint 'front_right_wheel_fork_joint' steers (swerve or Ackermann)" in message
    assert 'robot.base omnidirectional without robot.wheels' in message
    # As youBot's file, in which a joint without a drive carries each wheel.
    forks = {f'front_{side}_wheel_fork_joint': 0.0 for side in ('right', 'left')}
    assert cart(text, wheels, held=forks).wheels is not None
    defaults = urdf_defaults(text, {})
    assert 'robot.base' not in {choice.parameter for choice in defaults.choices}
    assert 'its wheels are steered (swerve or Ackermann)' in defaults.notes[0]


@pytest.mark.slow
@pytest.mark.parametrize('settings', [(), ('--set', 'robot.base=omnidirectional')])
def test_urdf_of_four_wheels_alone_is_simulated(
    settings: tuple[str, ...], tmp_path: Path
) -> None:
    """A skid-steer base, or with the base stated one on mecanum wheels."""
    (tmp_path / 'cart.urdf').write_text(SKID, encoding='utf-8')
    command = 'import sys; from masmc_ros.cli.main import main; sys.exit(main())'
    options = ['cart.urdf', *settings, '--set', 'duration=0.2', '--json']
    run = subprocess.run(
        [sys.executable, '-c', command, 'simulate', *options],
        cwd=tmp_path, env={**child_environment(), 'NUMBA_DISABLE_JIT': '1'}, check=True,
        capture_output=True, text=True,
    )  # fmt: skip
    assert ('robot.roller_angles' if settings else 'robot.track_factor') in run.stderr
    assert 0.0 < json.loads(run.stdout)['runs'][0]['tip_rms'] < 1e-4
