# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Payload at the tip: change of the base inertial parameters."""

from __future__ import annotations

from typing import Any

from cart_arm import CART_ARM
from helpers.robots import Array, between, DEFAULT, PROPERTY
from helpers.small_tree import parameters, URDF
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.robot.robot import Robot, robot_of
from masmc_ros.robot.tree.tree_parameters import PARAMETERS
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest

CENTRE = st.tuples(*3 * [between(-0.3, 0.3)]).map(np.array)
BOX = st.tuples(*3 * [between(0.01, 0.4)]).map(np.array)
"""Edges of a homogeneous box in m."""

_LOAD = """<link name="load"><inertial><origin xyz="{} {} {}"/><mass value="{}"/>
<inertia ixx="{}" ixy="0" ixz="0" iyy="{}" iyz="0" izz="{}"/></inertial></link>
<joint name="load_joint" type="fixed"><parent link="hand"/><child link="load"/></joint></robot>"""


def inertia_of_box(mass: float, edges: Array) -> Array:
    """Return xx, yy, zz, xy, yz, zx (6) in kg·m² of a homogeneous box."""
    squares = edges**2
    return np.concatenate([mass / 12.0 * (squares.sum() - squares), np.zeros(3)])


def tree(urdf: str) -> Robot:
    values: dict[str, Any] = {p.name: p.default for p in PARAMETERS}
    return robot_of({**values, **parameters(urdf), 'robot.tip_frame': 'hand',
                     'robot.speed_limits': ()})  # fmt: skip


@PROPERTY
@given(between(0.1, 10.0), CENTRE, BOX)
def test_payload_of_tree_equals_fixed_link_of_urdf(
    mass: float, centre: Array, edges: Array
) -> None:
    inertia = inertia_of_box(mass, edges)
    load = _LOAD.format(*centre.tolist(), mass, *inertia[:3].tolist())
    loaded = tree(URDF.replace('</robot>', load))
    theta = tree(URDF).theta_with_payload(mass, centre, inertia)
    np.testing.assert_allclose(theta, loaded.theta, rtol=1e-9, atol=1e-12)


@PROPERTY
@given(between(0.1, 10.0), between(0.0, 0.3))
def test_payload_of_planar_robot_equals_other_link_2(mass: float, inertia: float) -> None:
    values = {f'robot.{name}': value for name, value in DEFAULT.items()}
    choice = {'robot.mechanism': TWO_LINK.name, 'robot.speed_limits': ()}
    own, place = DEFAULT['link_2_mass'], DEFAULT['link_2_length']
    total = own + mass
    com = (own * DEFAULT['link_2_com'] + mass * place) / total
    other = {
        'robot.link_2_mass': total,
        'robot.link_2_com': com,
        'robot.link_2_inertia': DEFAULT['link_2_inertia']
        + own * (com - DEFAULT['link_2_com']) ** 2
        + inertia
        + mass * (com - place) ** 2,
    }
    about = np.array([0.0, 0.0, inertia, 0.0, 0.0, 0.0])
    theta = robot_of({**values, **choice}).theta_with_payload(mass, np.zeros(3), about)
    expected = robot_of({**values, **choice, **other}).theta
    np.testing.assert_allclose(theta, expected, rtol=1e-12)


def test_payload_of_mechanism_without_it_raises() -> None:
    robot = Robot(CART_ARM, {}, np.zeros(1), np.zeros(1))
    with pytest.raises(InputError, match='expected a payload of 0 kg'):
        robot.theta_with_payload(1.0, np.zeros(3), np.zeros(6))
