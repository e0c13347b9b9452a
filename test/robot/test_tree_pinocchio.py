# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Dynamics of trees against Pinocchio, for published robot descriptions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
import math
import os
from pathlib import Path
import re
import subprocess
import sys
from typing import Any

from helpers.tree_bits import model_of
from masmc_ros.errors import InputError
from masmc_ros.robot.packages import resource_path
from masmc_ros.robot.tree import articulated, dynamics, kinematics
from masmc_ros.robot.tree.assembly import tree_robot, TreeRobot
from masmc_ros.robot.tree.dynamics import GRAVITY
from masmc_ros.robot.tree.task.task import frame_pose
from masmc_ros.robot.tree.tree_model import DIFFERENTIAL
from masmc_ros.robot.urdf import read_urdf_file
import numpy as np
from numpy.typing import NDArray
import pytest

pytestmark = pytest.mark.slow

Array = NDArray[np.float64]

ROBOTS = 'package://example-robot-data/robots'
STRETCH = 'package://stretch_urdf/SE3/stretch_description_SE3_eoa_wrist_dw3_tool_sg3.urdf'


@dataclass(frozen=True)
class Case:
    """A published robot description and its configuration."""

    urdf: str
    base: str
    joints: Sequence[str]
    tip: str
    wheels: Sequence[str] = ()
    roller_angles: Sequence[float] = ()
    held: Mapping[str, float] = field(default_factory=dict)

    def robot(self) -> TreeRobot:
        """Return the tree of the description."""
        if self.urdf == STRETCH and find_spec('stretch_urdf') is None:
            pytest.skip('needs hello-robot-stretch-urdf')
        return tree_robot(
            read_urdf_file(self.urdf),
            self.urdf,
            base=self.base,
            joints=self.joints,
            wheels=self.wheels,
            roller_angles=self.roller_angles,
            held=self.held,
        )


TIAGO_ARM = ('torso_lift_joint', *(f'arm_{i}_joint' for i in range(1, 8)))
CORNERS = ('front_right', 'front_left', 'rear_right', 'rear_left')
PANDA = tuple(f'panda_joint{i}' for i in range(1, 8))
CASES = {
    'tiago': Case(
        f'{ROBOTS}/tiago_description/robots/tiago.urdf',
        'differential',
        TIAGO_ARM,
        'arm_tool_link',
        ('wheel_right_joint', 'wheel_left_joint'),
        held={'head_1_joint': 0.4},
    ),
    'tiago_pro': Case(
        f'{ROBOTS}/tiago_pro_description/robots/tiago_pro.urdf',
        'omnidirectional',
        ('torso_lift_joint', *(f'arm_right_{i}_joint' for i in range(1, 8))),
        'arm_right_tool_link',
        [f'wheel_{place}_joint' for place in CORNERS],
        [math.pi / 4.0 * sign for sign in (1, -1, -1, 1)],
    ),
    'stretch': Case(
        STRETCH,
        'differential',
        (
            'joint_lift',
            *(f'joint_arm_l{i}' for i in (3, 2, 1, 0)),
            *(f'joint_wrist_{way}' for way in ('yaw', 'pitch', 'roll')),
        ),
        'link_grasp_center',
        ('joint_right_wheel', 'joint_left_wheel'),
        held={'joint_head_pan': -0.3, 'joint_gripper_finger_left': 0.2},
    ),
    'ur5': Case(f'{ROBOTS}/ur_description/urdf/ur5_robot.urdf', 'fixed', (), 'tool0'),
    'xarm7': Case(f'{ROBOTS}/xarm_description/urdf/xarm7.urdf', 'fixed', (), 'link_eef'),
    'kinova': Case(
        f'{ROBOTS}/kinova_description/robots/kinova.urdf', 'fixed', (), 'j2s6s200_end_effector'
    ),
    'panda': Case(
        f'{ROBOTS}/panda_description/urdf/panda.urdf', 'omnidirectional', PANDA, 'panda_hand'
    ),
}


@pytest.mark.parametrize('case', CASES.values(), ids=CASES)
def test_tree_dynamics_equal_pinocchio(case: Case) -> None:
    pin = pytest.importorskip('pinocchio')
    robot = case.robot()
    root = () if case.base == 'fixed' else (pin.JointModelPlanar(),)
    whole = pin.buildModelFromUrdf(str(resource_path(case.urdf)), *root)
    names = [joint.name for joint in robot.joints]
    held = pin.neutral(whole)
    for name, angle in case.held.items():
        held[whole.joints[whole.getJointId(name)].idx_q] = angle
    others = [
        whole.getJointId(name)
        for name in whole.names[1:]
        if name not in (*names, 'root_joint')
    ]
    model = pin.buildReducedModel(whole, others, held)
    draw = np.random.default_rng(1)
    for _ in range(5):
        _compare(pin, model, robot, case.tip, draw)


@pytest.mark.parametrize('name', [name for name, case in CASES.items() if case.wheels])
def test_tree_base_armature_equals_wheel_spin_of_pinocchio(name: str) -> None:
    pin, case = pytest.importorskip('pinocchio'), CASES[name]
    robot = case.robot()
    wheels, base = robot.wheels, robot.tree.base
    assert wheels is not None
    model = pin.buildModelFromUrdf(str(resource_path(case.urdf)), pin.JointModelPlanar())
    rolling = np.zeros((model.nv, base))
    rolling[[0, 2] if base == DIFFERENTIAL else [0, 1, 2], range(base)] = 1.0
    gliding, spin = rolling.copy(), np.zeros((base, base))
    turning = [model.joints[model.getJointId(joint.name)] for joint in wheels.joints]
    for joint, row in zip(turning, wheels.matrix, strict=True):
        rolling[joint.idx_v] = row
    # Unbalanced terms cancel between a turn and half a turn.
    for cosine in (1.0, -1.0):
        q = pin.neutral(model)
        for joint in turning:
            q[joint.idx_q] = cosine
        upper = np.triu(pin.crba(model, model.createData(), q))
        whole = upper + np.triu(upper, 1).T
        spin += (rolling.T @ whole @ rolling - gliding.T @ whole @ gliding) / 2.0
    # The axles of Stretch are tilted by rounded decimals.
    _assert_close(robot.tree.armature[:base, :base], spin, 1e-6)


@pytest.mark.parametrize('name', ['tiago', 'tiago_pro', 'stretch', 'ur5'])
def test_tree_meshes_of_published_robots_exist(name: str) -> None:
    case = CASES[name]
    case.robot()
    folder = resource_path(case.urdf).parent
    links = read_urdf_file(case.urdf).links.values()
    meshes = [resource_path(mesh, folder) for link in links for mesh in link.meshes]
    assert len(meshes) > 5
    assert all(mesh.is_file() for mesh in meshes)


def test_urdf_published_files_are_read() -> None:
    folder = resource_path(f'{ROBOTS}/ur_description').parent
    rejected = {}
    for path in folder.rglob('*.urdf'):
        try:
            read_urdf_file(path)
        except InputError as error:
            rejected[path.name] = str(error)
    # A mimic joint of a joint that does not exist, and a file without links.
    assert set(rejected) == {'alex_psyonic_hands.urdf', 'ur3.urdf'}
    assert "mimics 'index_q1', which is no joint" in rejected['alex_psyonic_hands.urdf']


def test_documented_robot_example_prints_documented_output() -> None:
    pytest.importorskip('pinocchio')
    page = Path(__file__).resolve().parents[2] / 'docs' / 'reference' / 'urdf_robots.md'
    text = page.read_text(encoding='utf-8')
    example = re.search(r'```python\n(.*?)```\n\n```text\n(.*?)```', text, re.DOTALL)
    assert example is not None
    process = subprocess.run(
        [sys.executable, '-c', example[1]],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, sys.path))},
        capture_output=True,
        text=True,
        check=True,
        timeout=600.0,
    )
    assert process.stdout == example[2]


def _compare(
    pin: Any, model: Any, robot: TreeRobot, tip: str, draw: np.random.Generator
) -> None:
    """Compare dynamics and kinematics in a random state."""
    base, bodies = robot.tree.base, len(robot.tree.parent)
    size = base + bodies - 1
    angles, pose = draw.uniform(-1.5, 1.5, bodies - 1), draw.uniform(-1.0, 1.0, 3)
    velocity, reference, acceleration, forces = draw.normal(size=(4, size))
    # Pinocchio's planar base also has u, v and omega in its own frame.
    select, q = np.zeros((model.nv, size)), pin.neutral(model)
    if base:
        q[:4] = [*pose[:2], np.cos(pose[2]), np.sin(pose[2])]
        select[[0, 2] if base == DIFFERENTIAL else [0, 1, 2], range(base)] = 1.0
    for number, joint in enumerate(robot.joints):
        other = model.joints[model.getJointId(joint.name)]
        select[other.idx_v, base + number] = 1.0
        angle = angles[number]
        q[other.idx_q:other.idx_q + other.nq] = (
            [np.cos(angle), np.sin(angle)] if other.nq == 2 else [angle]
        )
    data, v = model.createData(), select @ velocity
    upper = np.triu(pin.crba(model, data, q))
    rotors = robot.tree.armature
    inertia = select.T @ (upper + np.triu(upper, 1).T) @ select + rotors
    coriolis = select.T @ pin.computeCoriolisMatrix(model, data, q, v) @ select
    gravity = select.T @ pin.computeGeneralizedGravity(model, data, q)

    frame = robot.frames[tip]
    tree_model = model_of(robot, frame.body, frame.offset)
    place = kinematics.place(tree_model, *(pose.tolist() if base else (0.0, 0.0, 0.0)), angles, 0)
    arguments = tree_model, place, robot.inertial_parameters.ravel()
    _assert_close(dynamics.inertia(*arguments), inertia)
    torques = dynamics.inverse_dynamics(*arguments, velocity, reference, acceleration, GRAVITY)
    _assert_close(torques, inertia @ acceleration + coriolis @ reference + gravity)
    accelerations = articulated.forward_dynamics(*arguments, velocity, forces, GRAVITY)
    _assert_close(accelerations, np.linalg.solve(inertia, forces - coriolis @ velocity - gravity))

    point = frame.body, frame.offset
    jacobian = kinematics.point_jacobian(tree_model, place, *point)
    derivative = kinematics.point_jacobian_rate(tree_model, place, velocity, *point)
    number, world = model.getFrameId(tip), pin.LOCAL_WORLD_ALIGNED
    pin.computeJointJacobiansTimeVariation(model, data, q, v)
    pin.updateFramePlacements(model, data)
    _assert_close(jacobian.T, pin.getFrameJacobian(model, data, number, world) @ select)
    rates = pin.getFrameJacobianTimeVariation(model, data, number, world)
    _assert_close(derivative.T, rates @ select)
    rotation, origin = frame_pose(tree_model, place, 0)
    _assert_close(np.array(origin), data.oMf[number].translation)
    own = np.reshape(rotation, (3, 3)) @ np.reshape(frame.rotation, (3, 3))
    _assert_close(own, data.oMf[number].rotation)


def _assert_close(actual: Array, expected: Array, within: float = 1e-9) -> None:
    assert np.abs(actual - expected).max() < within * np.abs(expected).max()
