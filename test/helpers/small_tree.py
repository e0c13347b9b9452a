# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""URDF and parameters of a small robot on two wheels with an arm of five joints."""

from __future__ import annotations

from collections.abc import Sequence
import math
from pathlib import Path
from typing import Any

from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.tree.task.outputs import OUTPUTS
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
import numpy as np

_BODY = """<link name="{0}"><inertial><origin xyz="{1}" rpy="0.2 -0.1 0.3"/><mass value="{2}"/>
<inertia ixx="{3}" ixy="0.0002" ixz="-0.0001" iyy="{4}" iyz="0.0003" izz="{5}"/>
</inertial></link>"""
_JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>
<origin xyz="{4}" rpy="{5}"/><axis xyz="{6}"/>{7}</joint>"""
_LIMIT = '<limit lower="-3" upper="3" effort="80" velocity="3"/>'

URDF = '<robot name="small">{}</robot>'.format(
    ''.join(
        [
            _BODY.format('base_link', '0.05 0 0.2', 20, 0.6, 0.7, 0.8),
            _BODY.format('wheel_right', '0 0 0', 1, 0.003, 0.005, 0.003),
            _BODY.format('wheel_left', '0 0 0', 1, 0.003, 0.005, 0.003),
            _BODY.format('turret', '0.02 0 0.1', 3, 0.03, 0.03, 0.02),
            _BODY.format('lift', '0.1 0 0.05', 2, 0.02, 0.03, 0.03),
            _BODY.format('upper', '0.15 0 0', 1.5, 0.004, 0.02, 0.02),
            _BODY.format('fore', '0.12 0.01 0', 1, 0.006, 0.01, 0.01),
            _BODY.format('hand', '0.05 0 0.02', 0.6, 0.002, 0.003, 0.003),
            _JOINT.format('wheel_right_joint', 'continuous', 'base_link', 'wheel_right',
                          '0 -0.2 0.1', '0 0 0', '0 1 0', ''),
            _JOINT.format('wheel_left_joint', 'continuous', 'base_link', 'wheel_left',
                          '0 0.2 0.1', '0 0 0', '0 1 0', ''),
            _JOINT.format('turret_joint', 'revolute', 'base_link', 'turret',
                          '0.1 0 0.3', '0 0 0', '0 0 1', _LIMIT),
            _JOINT.format('lift_joint', 'prismatic', 'turret', 'lift',
                          '0 0 0.2', '0 0 0', '0 0 1', _LIMIT),
            _JOINT.format('upper_joint', 'revolute', 'lift', 'upper',
                          '0.2 0 0', '0 0 0.4', '0 1 0', _LIMIT),
            _JOINT.format('fore_joint', 'revolute', 'upper', 'fore',
                          '0.3 0 0', '0.1 0 0', '0 1 0', _LIMIT),
            _JOINT.format('hand_joint', 'revolute', 'fore', 'hand',
                          '0.25 0 0', '0 0 0', '1 0 0', _LIMIT),
        ]
    )
)  # fmt: skip

START = (0.0, 0.0, 0.3, 0.1, 0.7, 0.9, -0.4)
"""Positions of wheels and joints."""


def parameters(urdf: str = URDF) -> dict[str, Any]:
    """Return the parameters that select the robot."""
    return {
        'robot.urdf': urdf,
        'robot.base': 'differential',
        'robot.wheels': ('wheel_right_joint', 'wheel_left_joint'),
        'robot.posture': START[2:],
    }


def hand_at_start() -> list[float]:
    """Return the pose of the hand at START."""
    values = parameters()
    mechanism = tree_mechanism(values)
    robot = robot_of({p.name: p.default for p in mechanism.parameters} | values)
    pose: list[float] = robot.task_positions(np.array([[0.0, 0.0, 0.0, *START]]))[0].tolist()
    return pose


def write_scenario(
    folder: Path, tip: list[float], duration: float, task: str = 'pose'
) -> Path:
    """
    Write URDF and scenario into a folder; the task frame moves forward and rotates slightly.

    The task frame is the hand, which starts at `tip`. For the task `base` it is the base, which
    then has no wheels.
    """
    wheels, start = 'wheels: [wheel_right_joint, wheel_left_joint]', START
    base = 'differential'
    if task == 'base':
        wheels, base = 'held_joints: [wheel_right_joint, wheel_left_joint]', 'omnidirectional'
        start, tip = (0.0, *START), [0.0] * 6
    ahead = [tip[0] + 0.1, *tip[1:4], tip[4] + 0.1, tip[5]]

    def of_task(values: Sequence[float]) -> list[float]:
        return [values[axis] for axis in OUTPUTS[task]]

    (folder / 'small.urdf').write_text(URDF, encoding='utf-8')
    path = folder / 'small.yaml'
    path.write_text(
        f"""/**:
  ros__parameters:
    robot:
      urdf: {folder / 'small.urdf'}
      base: {base}
      {wheels}
      task: {task}
      posture: {list(START[2:])}
    control_period: 0.001
    duration: {duration}
plant:
  ros__parameters:
    initial_joints: {list(start)}
trajectory:
  ros__parameters:
    line_sine:
      offset: {of_task(ahead)}
      amplitude: {of_task([0.1, 0.0, 0.0, 0.0, 0.1, 0.0])}
      frequency: {of_task([2.0, 0.0, 0.0, 0.0, 1.5, 0.0])}
      phase: {of_task([-0.5 * math.pi, 0.0, 0.0, 0.0, -0.5 * math.pi, 0.0])}
controller:
  ros__parameters:
    k_s1: {of_task([100.0, 100.0, 100.0, 10.0, 10.0, 10.0])}
    k_s2: {of_task([100.0, 100.0, 100.0, 10.0, 10.0, 10.0])}
""",
        encoding='utf-8',
    )
    return path
