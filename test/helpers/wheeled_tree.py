# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""URDF and parameters of a base on four wheels, or others, with an arm of two joints."""

from __future__ import annotations

import math
from pathlib import Path

BODY = """<link name="{0}"><inertial><origin xyz="{1}"/><mass value="{2}"/>
<inertia ixx="{3}" ixy="0" ixz="0" iyy="{4}" iyz="0" izz="{3}"/></inertial></link>"""
JOINT = """<joint name="{0}_joint" type="{1}"><parent link="{2}"/><child link="{0}"/>
<origin xyz="{3}"/><axis xyz="{4}"/>{5}</joint>"""
RANGE = '<limit lower="-2" upper="2" effort="30" velocity="3"/>'

HALF, RADIUS, AHEAD = 0.3, 0.1, 0.15

WEAK = 8.0 / 3.0
"""Limit of the torque of the rear right wheel in N·m, a third of those of the others."""


def wheel(name: str, x: float, side: int, *, axis: int = 1, effort: float = 8.0) -> str:
    """Return a wheel of the robot, on the right (-1) or left (1)."""
    limit = f'<limit effort="{effort}" velocity="20"/><dynamics damping="0.1" friction="0.2"/>'
    return BODY.format(name, '0 0 0', 1.5, 0.004, 0.006) + JOINT.format(
        name, 'continuous', 'base', f'{x} {side * HALF} {RADIUS}', f'0 {axis} 0', limit
    )


def robot_text(*wheels: str) -> str:
    """Return the URDF of a base with an arm of two joints on these wheels."""
    parts = [
        BODY.format('base', '0.03 0.01 0.2', 20.0, 0.6, 0.8), *wheels,
        BODY.format('upper', '0.1 0.02 0', 2.0, 0.02, 0.03),
        BODY.format('hand', '0.1 0 0.05', 1.0, 0.01, 0.02),
        JOINT.format('upper', 'revolute', 'base', '0.2 0.1 0.4', '0 0 1', RANGE),
        JOINT.format('hand', 'revolute', 'upper', '0.3 0 0', '0 1 0', RANGE),
    ]  # fmt: skip
    return f'<robot name="cart">{"".join(parts)}</robot>'


SKID = robot_text(
    wheel('front_left_wheel', AHEAD + 0.25, 1, axis=-1),
    wheel('front_right_wheel', AHEAD + 0.25, -1),
    wheel('rear_left_wheel', AHEAD - 0.25, 1),
    wheel('rear_right_wheel', AHEAD - 0.25, -1, effort=WEAK),
)
WHEELS = tuple(
    f'{end}_{side}_wheel_joint' for side in ('right', 'left') for end in ('front', 'rear')
)

MECANUM_ANGLES = tuple(math.pi / 4.0 * sign for sign in (1, -1, -1, 1))
"""Roller angles of mecanum wheels in the order of WHEELS."""


def parameter_file(folder: Path, base: str, ticks: int) -> Path:
    """Write the URDF and a parameter file; the tip moves to the left from rest."""
    (folder / 'cart.urdf').write_text(SKID, encoding='utf-8')
    rollers = f'      roller_angles: {list(MECANUM_ANGLES)}\n' if base == 'omnidirectional' else ''
    path = folder / 'cart.yaml'
    path.write_text(
        f"""/**:
  ros__parameters:
    robot:
      urdf: cart.urdf
      base: {base}
      wheels: [{', '.join(WHEELS)}]
{rollers}      task: [planar]
    duration: {0.01 * ticks}
    pacing: lockstep
controller:
  ros__parameters: {{approach_on_start: false}}
trajectory:
  ros__parameters:
    line_sine:
      offset: [0.5, 0.2]
      amplitude: [0.0, 0.1]
      frequency: [0.0, 1.0]
      phase: [0.0, {-0.5 * math.pi}]
""",
        encoding='utf-8',
    )
    return path
