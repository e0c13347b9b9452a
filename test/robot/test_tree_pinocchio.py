# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Trees of bodies against Pinocchio, on robots that others have described."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
import sysconfig
from typing import Any

from masmc_ros.robot.tree import dynamics
from masmc_ros.robot.tree.assembly import tree_robot, TreeRobot
from masmc_ros.robot.tree.dynamics import GRAVITY, Placement
from masmc_ros.robot.tree.urdf import read_urdf_file
import numpy as np
from numpy.typing import NDArray
import pytest

pytestmark = pytest.mark.slow

Array = NDArray[np.float64]

ROBOTS = Path(sysconfig.get_path('purelib')) / 'cmeel.prefix/share/example-robot-data/robots'


@dataclass(frozen=True)
class Case:
    """A robot of the package example-robot-data."""

    urdf: str
    base: str
    joints: Sequence[str]
    tip: str
    wheels: Sequence[str] = ()
    held: Mapping[str, float] = field(default_factory=dict)


TIAGO_ARM = ('torso_lift_joint', *(f'arm_{i}_joint' for i in range(1, 8)))
PANDA = tuple(f'panda_joint{i}' for i in range(1, 8))
CASES = {
    'tiago': Case(
        'tiago_description/robots/tiago.urdf',
        'differential',
        TIAGO_ARM,
        'arm_tool_link',
        ('wheel_right_joint', 'wheel_left_joint'),
        {'head_1_joint': 0.4},
    ),
    'tiago_pro': Case(
        'tiago_pro_description/robots/tiago_pro.urdf',
        'omnidirectional',
        ('torso_lift_joint', *(f'arm_right_{i}_joint' for i in range(1, 8))),
        'arm_right_tool_link',
    ),
    'ur5': Case('ur_description/urdf/ur5_robot.urdf', 'fixed', (), 'tool0'),
    'panda': Case('panda_description/urdf/panda.urdf', 'omnidirectional', PANDA, 'panda_hand'),
}


@pytest.mark.parametrize('case', CASES.values(), ids=CASES)
def test_agrees_with_pinocchio(case: Case) -> None:
    pin = pytest.importorskip('pinocchio')
    path = ROBOTS / case.urdf
    robot = tree_robot(
        read_urdf_file(path),
        str(path),
        base=case.base,
        joints=case.joints,
        wheels=case.wheels,
        held=case.held,
    )
    root = () if case.base == 'fixed' else (pin.JointModelPlanar(),)
    whole = pin.buildModelFromUrdf(str(path), *root)
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


def _compare(
    pin: Any, model: Any, robot: TreeRobot, tip: str, draw: np.random.Generator
) -> None:
    """Compare everything in a random state."""
    base, bodies = robot.tree.base, len(robot.tree.parent)
    size = base + bodies - 1
    angles, pose = draw.uniform(-1.5, 1.5, bodies - 1), draw.uniform(-1.0, 1.0, 3)
    velocity, reference, acceleration, forces = draw.normal(size=(4, size))
    # Pinocchio's planar base has u, v and omega in its own frame, too.
    select, q = np.zeros((model.nv, size)), pin.neutral(model)
    if base:
        q[:4] = [*pose[:2], np.cos(pose[2]), np.sin(pose[2])]
        select[[0, 2] if base == dynamics.DIFFERENTIAL else [0, 1, 2], range(base)] = 1.0
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

    place = Placement(np.empty((bodies, 9, 1)), np.empty((bodies, 3, 1)))
    position = np.concatenate([pose if base else [], angles])[:, None]
    dynamics.place(robot.tree, position, place)
    moments = np.ascontiguousarray(robot.moments[:, :, None])
    nu, nu_r, a_r, pushed = (
        each[:, None].copy() for each in (velocity, reference, acceleration, forces)
    )
    found = np.empty((size, size, 1))
    dynamics.inertia(robot.tree, moments, place, found)
    _near(found[:, :, 0], inertia)
    taken = np.empty((size, 1))
    dynamics.inverse_dynamics(robot.tree, moments, place, nu, nu_r, a_r, GRAVITY, taken)
    _near(taken[:, 0], inertia @ acceleration + coriolis @ reference + gravity)
    gained = np.empty((size, 1))
    dynamics.forward_dynamics(robot.tree, moments, place, nu, pushed, GRAVITY, gained)
    _near(gained[:, 0], np.linalg.solve(inertia, forces - coriolis @ velocity - gravity))

    poses = Placement(np.empty_like(place.rotation), np.empty_like(place.offset))
    dynamics.world_poses(robot.tree, place, poses)
    frame = robot.frames[tip]
    jacobian, derivative = np.empty((2, 6, size, 1))
    point = np.array(frame.offset)[:, None]
    dynamics.point_jacobian(robot.tree, poses, nu, frame.body, point, jacobian, derivative)
    number, world = model.getFrameId(tip), pin.LOCAL_WORLD_ALIGNED
    pin.computeJointJacobiansTimeVariation(model, data, q, v)
    pin.updateFramePlacements(model, data)
    _near(jacobian[:, :, 0], pin.getFrameJacobian(model, data, number, world) @ select)
    rates = pin.getFrameJacobianTimeVariation(model, data, number, world)
    _near(derivative[:, :, 0], rates @ select)
    rotation = poses.rotation[frame.body, :, 0].reshape(3, 3)
    _near(poses.offset[frame.body, :, 0] + rotation @ point[:, 0], data.oMf[number].translation)
    _near(rotation @ np.reshape(frame.rotation, (3, 3)), data.oMf[number].rotation)


def _near(found: Array, expected: Array) -> None:
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()
