# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""URDF of an arm of two joints with narrow limits, which moves in a vertical plane."""

from __future__ import annotations

_URDF = """<robot name="arm"><link name="base_link"><inertial><mass value="20"/>
<inertia ixx="0.6" ixy="0" ixz="0" iyy="0.7" iyz="0" izz="0.8"/></inertial></link>
<link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.15 0 0"/><mass value="1"/>
<inertia ixx="0.005" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base_link"/><child link="upper"/>
<axis xyz="0 1 0"/>
<limit lower="{0[0]}" upper="{0[1]}" effort="{3[0]}" velocity="{2}"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
<origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
<limit lower="{1[0]}" upper="{1[1]}" effort="{3[1]}" velocity="{2}"/></joint></robot>"""


def limited_arm(
    shoulder: tuple[float, float],
    elbow: tuple[float, float],
    speed: float,
    efforts: tuple[float, float] = (60.0, 30.0),
) -> str:
    """Return the URDF for ranges in rad, a speed limit in rad/s and effort limits in N·m."""
    return _URDF.format(shoulder, elbow, speed, efforts)
