# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Wheels of a base: linear map against rolling constraints, the literature, and power."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.robot.tree.assembly import tree_robot, TreeRobot
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
from masmc_ros.robot.tree.tree_model import DIFFERENTIAL, OMNIDIRECTIONAL
from masmc_ros.robot.tree.wheels import driving_wheels, Mount
from masmc_ros.robot.urdf import Joint, Pose, read_urdf
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

RADIUS = 0.08
UP = np.array([0.0, 0.0, 1.0])


def mount(x: float, y: float, heading: float, spin: float = 0.002, name: str = 'w') -> Mount:
    """Return a wheel whose axle has a heading in the base frame."""
    axle = (math.cos(heading), math.sin(heading), 0.0)
    joint = Joint(name, 7, 'continuous', 'base', 'wheel', Pose(), (0.0, 0.0, 1.0))
    return Mount(joint, (x, y, RADIUS), axle, spin)


lengths = st.floats(-1.0, 1.0)
wheels = st.builds(mount, lengths, lengths, st.floats(-math.pi, math.pi), st.floats(0.0, 0.1))
driven = st.lists(st.tuples(wheels, st.floats(-1.2, 1.2)), min_size=3, max_size=6)
three = st.tuples(*[st.floats(-5.0, 5.0)] * 3).map(np.array)


@given(driven, three, st.integers(0, 2**32 - 1))
@example(
    # All in one place, up to rounding.
    [(mount(2.6e-161, 0.0, 0.0, 0.0), 0.0), (mount(0.0, 0.0, 1.0, 0.0), 0.0),
     (mount(0.0, 0.0, 2.0, 0.0), 0.0)],
    np.zeros(3), 0,
)  # fmt: skip
def test_driving_wheels_do_not_slip_and_preserve_power(
    drawn: list[tuple[Mount, float]], rates: Array, seed: int
) -> None:
    mounts, angles = zip(*drawn, strict=True)
    columns = np.array([
        [a[0], a[1], np.cross(wheel.centre, a)[2]]
        for wheel, angle in drawn
        for a in [_roller_axis(wheel, angle) / math.cos(angle)]
    ])
    try:
        drive = driving_wheels(OMNIDIRECTIONAL, mounts, 'x', roller_angles=angles)
    except InputError as error:
        assert 'x, line 7: robot.wheels' in str(error)
        assert ' cannot drive the base ' in str(error)
        scale = np.linalg.norm(columns, axis=0)
        alike = columns / np.where(scale > 0.0, scale, 1.0)
        assert np.linalg.svd(alike)[1][-1] < 2.0e-3 or scale.min() < 1.01e-3 * scale.max()
        return
    for wheel, angle, rate in zip(mounts, angles, drive.matrix @ rates, strict=True):
        centre = np.array([rates[0], rates[1], 0.0]) + np.cross(rates[2] * UP, wheel.centre)
        rim = np.cross(rate * np.array(wheel.axle), -RADIUS * UP)
        assert np.dot(centre + rim, _roller_axis(wheel, angle)) == pytest.approx(0.0, abs=1e-12)
    assert drive.matrix * RADIUS == pytest.approx(columns, abs=1e-12)
    assert drive.inverse @ drive.matrix == pytest.approx(np.eye(3), abs=1e-8)
    assert drive.inverse == pytest.approx(np.linalg.pinv(drive.matrix), rel=1e-6, abs=1e-6)
    torques = np.random.default_rng(seed).normal(size=len(mounts))
    forces = drive.matrix.T @ torques
    assert forces @ rates == pytest.approx(torques @ (drive.matrix @ rates), rel=1e-9, abs=1e-9)
    energy = np.sum((drive.spin + 0.01) * (drive.matrix @ rates) ** 2)
    assert rates @ drive.inertia(0.01) @ rates == pytest.approx(energy, rel=1e-9, abs=1e-12)
    assert np.array_equal(drive.inertia(0.01), drive.inertia(0.01).T)


def _roller_axis(wheel: Mount, angle: float) -> Array:
    """Return the direction in which the ground constrains a wheel."""
    ahead = np.cross(wheel.axle, UP)
    return np.asarray(math.cos(angle) * ahead + math.sin(angle) * np.cross(UP, ahead))


@given(st.floats(0.1, 0.5), st.floats(0.1, 0.5))
def test_driving_wheels_four_mecanum_wheels_equal_literature(along: float, across: float) -> None:
    # H. Taheri, B. Qiao, N. Ghaeminezhad, Kinematic Model of a Four Mecanum Wheeled Mobile
    # Robot, 2015: front left, front right, rear left, rear right.
    places = ((along, across), (along, -across), (-along, across), (-along, -across))
    drive = driving_wheels(
        OMNIDIRECTIONAL,
        [mount(x, y, math.pi / 2.0) for x, y in places],
        'x',
        roller_angles=[math.pi / 4.0 * sign for sign in (-1, 1, 1, -1)],
    )
    arm = along + across
    assert drive.matrix * RADIUS == pytest.approx(
        np.array([[1, -1, -arm], [1, 1, arm], [1, 1, -arm], [1, -1, arm]]), abs=1e-12
    )
    assert drive.inverse / RADIUS == pytest.approx(
        np.array([[1, 1, 1, 1], [-1, 1, 1, -1], [-1 / arm, 1 / arm, -1 / arm, 1 / arm]]) / 4.0,
        abs=1e-12,
    )


@given(st.floats(0.1, 0.5), st.floats(-math.pi, math.pi))
def test_driving_wheels_three_omni_wheels_equal_literature(arm: float, first: float) -> None:
    # R. Siegwart, I. Nourbakhsh, Introduction to Autonomous Mobile Robots, 2004, 3.2.5.
    angles = np.array([first + 2.0 * math.pi / 3.0 * i for i in range(3)])
    drive = driving_wheels(
        OMNIDIRECTIONAL,
        [mount(arm * math.cos(a), arm * math.sin(a), a + math.pi) for a in angles],
        'x',
    )
    expected = np.stack([-np.sin(angles), np.cos(angles), np.full(3, arm)], axis=1)
    assert drive.matrix * RADIUS == pytest.approx(expected, abs=1e-12)
    back = np.stack([-2 * np.sin(angles), 2 * np.cos(angles), np.full(3, 1 / arm)]) / 3.0
    assert drive.inverse / RADIUS == pytest.approx(back, abs=1e-10)


@given(st.floats(0.1, 0.5), st.sampled_from([1.0, -1.0]), st.sampled_from([1.0, -1.0]))
def test_driving_wheels_two_wheels_are_differential_base(
    half: float, right: float, left: float
) -> None:
    mounts = [
        mount(0.0, -half, right * math.pi / 2.0, 0.002),
        mount(0.0, half, left * math.pi / 2.0, 0.003),
    ]
    drive = driving_wheels(DIFFERENTIAL, mounts, 'x')
    expected = np.array([[right, right * half], [left, -left * half]]) / RADIUS
    assert drive.matrix == pytest.approx(expected, rel=1e-12)
    assert drive.inverse @ drive.matrix == pytest.approx(np.eye(2), abs=1e-12)
    across = (0.002 - 0.003) * half
    spin = np.array([[0.005, across], [across, 0.005 * half**2]]) / RADIUS**2
    assert drive.inertia(0.0) == pytest.approx(spin, abs=1e-12)


INERTIA = (
    '<inertial><mass value="{0}"/>'
    '<inertia ixx="{1}" ixy="0" ixz="0" iyy="{1}" iyz="0" izz="{2}"/></inertial>'
)
URDF = '<robot name="car"><link name="base">{}</link>\n{}\n</robot>'.format(
    INERTIA.format(20.0, 1.0, 1.5),
    '\n'.join(
        f'<link name="{name}">{INERTIA.format(1.0, 0.002, 0.003)}</link>'
        f'<joint name="{name}" type="continuous"><parent link="base"/><child link="{name}"/>'
        f'<origin xyz="{x} {y} 0.08" rpy="-1.5707963267948966 0 0"/><axis xyz="0 0 1"/>'
        '<limit effort="6" velocity="13"/></joint>'
        for name, x, y in (
            ('front_right', 0.3, -0.2),
            ('front_left', 0.3, 0.2),
            ('rear_right', -0.3, -0.2),
            ('rear_left', -0.3, 0.2),
        )
    ),
)
CORNERS = ('front_right', 'front_left', 'rear_right', 'rear_left')
ANGLES = tuple(math.pi / 4.0 * sign for sign in (1, -1, -1, 1))


def car(text: str = URDF, **settings: Any) -> TreeRobot:
    """Return a car on mecanum wheels."""
    arguments = {
        'base': 'omnidirectional',
        'wheels': CORNERS,
        'roller_angles': ANGLES,
        'armature': 0.01,
        **settings,
    }
    return tree_robot(read_urdf(text, 'car.urdf'), 'car.urdf', **arguments)


def test_tree_robot_base_inertia_contains_wheel_spin() -> None:
    robot = car()
    assert robot.wheels is not None
    sideways = robot.wheels.matrix @ np.array([0.0, 1.0, 0.0])
    assert sideways * 0.08 == pytest.approx(np.array([1.0, -1.0, -1.0, 1.0]))
    assert np.diag(robot.tree.armature) == pytest.approx(
        np.array([1.0, 1.0, 0.5**2]) * 4.0 * 0.013 / 0.08**2
    )
    assert robot.inertial_parameters[0][0] == 24.0
    # A third of what the wheels allow in each direction alone.
    assert robot.limits.speed == pytest.approx(13.0 * 0.08 / 3.0 / np.array([1.0, 1.0, 0.5]))
    assert robot.limits.effort == pytest.approx(6.0 * 4.0 / 0.08 / 3.0 * np.array([1.0, 1.0, 0.5]))
    assert robot.limits.upper.tolist() == [math.inf] * 3


def test_tree_robot_omnidirectional_without_wheels_is_driven() -> None:
    robot = car(wheels=(), roller_angles=(), joints=('rear_left',))
    assert robot.wheels is None
    assert np.diag(robot.tree.armature).tolist() == [0.0, 0.0, 0.0, 0.01]
    assert robot.limits.effort.tolist() == [6.0]


@pytest.mark.parametrize(
    ('own', 'expected'),
    [
        ({'robot.roller_angles': (0.5,)}, 'robot.roller_angles [0.5, 0.5]: expected one for each'),
        ({'robot.held_joints': (CORNERS[0],)}, "joint 'front_right' is a wheel"),
    ],
)
def test_tree_mechanism_invalid_differential_base_raises_one_line(
    own: dict[str, Any], expected: str
) -> None:
    values = {'robot.urdf': URDF, 'robot.base': 'differential', 'robot.wheels': CORNERS[:2]}
    with pytest.raises(InputError) as raised:
        tree_mechanism({**values, **own})
    assert expected in str(raised.value)
    assert '\n' not in str(raised.value)


@pytest.mark.parametrize(
    ('old', 'new', 'settings', 'expected'),
    [
        ('', '', {'wheels': CORNERS[:2]}, "robot.wheels ['front_right', 'front_left']: expecte"),
        ('', '', {'wheels': (*CORNERS, 'rear_left')}, 'three or more joints or none for robot.b'),
        ('', '', {'base': 'fixed'}, 'expected none for robot.base = fixed'),
        ('', '', {'wheels': (*CORNERS[:3], 'rear_lef')}, "no joint 'rear_lef'; did you mean rear"),
        ('', '', {'roller_angles': ANGLES[:3]}, 'robot.roller_angles [0.785'),
        ('', '', {'roller_angles': (*ANGLES[:3], 1.6)}, 'robot.roller_angles: 1.6, expected less'),
        (
            '',
            '',
            {'roller_angles': ()},
            "car.urdf, line 2: robot.wheels ['front_right', 'front_left', 'rear_right',"
            " 'rear_left'] cannot drive the base sideways by itself; expected axles, places or"
            ' robot.roller_angles that differ more',
        ),
        ('rpy="-1.57', 'rpy="-1.5', {}, "car.urdf, line 2: joint 'front_right' is no wheel of su"),
        ('-0.3 0.2 0.08', '-0.3 0.2 0.09', {}, "car.urdf, line 5: joint 'rear_left': wheels at h"),
        (' 0.08"', ' -0.08"', {}, 'car.urdf: robot.wheel_radius: the axles are -0.08 m above'),
        ('"continuous"', '"fixed"', {}, "line 2: joint 'front_right' is fixed: it is no wheel"),
        (
            '<parent link="base"/><child link="rear_left"',
            '<parent link="front_left"/><child link="rear_left"',
            {'wheels': ('front_right', 'rear_right', 'rear_left'), 'roller_angles': ANGLES[:3]},
            "line 5: joint 'rear_left' moves against the base: it is no wheel",
        ),
        (
            '',
            '',
            {'base': 'differential', 'wheels': CORNERS[1::-1], 'roller_angles': ()},
            'expected both on one axle, the right one first, at the smaller y',
        ),
    ],
)
def test_tree_robot_invalid_wheels_raise_one_line(
    old: str, new: str, settings: dict[str, Any], expected: str
) -> None:
    assert old in URDF
    with pytest.raises(InputError) as raised:
        car(URDF.replace(old, new), **settings)
    assert expected in str(raised.value)
    assert '\n' not in str(raised.value)


def test_wheel_tyre_as_link_of_its_own_has_same_inertia() -> None:
    """Links that are fixed to a wheel spin with it, wherever their frames are."""
    tyre = '<inertial><origin xyz="{}" rpy="{}"/><mass value="{}"/>{}</inertial>'
    inertia = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.02"/>'
    own = tyre.format('0 0 0', '0 0 0', 2.0, inertia)
    turned = tyre.format('0.1 0 0', '0 -1.5707963267948966 0', 2.0, inertia)
    links = {
        'one': f'<link name="w">{own}</link>',
        'apart': (
            f'<link name="w"/><link name="tyre">{turned}</link><joint name="seat" type="fixed">'
            '<parent link="w"/><child link="tyre"/>'
            '<origin xyz="0 0 0.1" rpy="0 1.5707963267948966 0"/></joint>'
        ),
        'with an arm': (
            f'<link name="w">{own}</link><link name="tyre">{own}</link>'
            '<joint name="seat" type="continuous"><parent link="w"/><child link="tyre"/>'
            '<axis xyz="0 0 1"/></joint>'
        ),
    }
    spins = []
    for text in links.values():
        sides = ''.join(
            text.replace('"w"', f'"{name}"').replace('tyre', f'{name}_t').replace('seat', f's{y}')
            + f'<joint name="{name}" type="continuous"><parent link="base"/><child link="{name}"/>'
            f'<origin xyz="0 {y} 0.08" rpy="-1.5707963267948966 0 0"/><axis xyz="0 0 1"/></joint>'
            for name, y in (('right', -0.2), ('left', 0.2))
        )
        robot = (
            '<robot name="cart"><link name="base"><inertial><mass value="10"/>'
            '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
            f'{sides}</robot>'
        )
        cart = tree_robot(
            read_urdf(robot, 'cart'), 'cart', base='differential', wheels=('right', 'left')
        )
        assert cart.wheels is not None
        spins.append(cart.wheels.spin)
    np.testing.assert_allclose(spins[0], 0.02, rtol=1e-12)
    np.testing.assert_allclose(spins[1], spins[0], rtol=1e-9)
    # A link on a controlled joint is a body of its own.
    np.testing.assert_array_equal(spins[2], spins[0])
