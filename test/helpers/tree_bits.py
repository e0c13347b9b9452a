# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Digests of a tree's dynamics and adaptation, to compare machines: `tree_bits.py`."""

from __future__ import annotations

import hashlib

from masmc_ros.robot.tree import articulated, dynamics, kinematics
from masmc_ros.robot.tree.assembly import tree_robot, TreeRobot
from masmc_ros.robot.tree.natural_adaptation import natural_step
from masmc_ros.robot.tree.tree_model import packed, Tree, TreeModel
from masmc_ros.robot.urdf import read_urdf
import numpy as np

_LINK = """<link name="{0}"><inertial><origin xyz="0.1 -0.05 {1}" rpy="0.3 0.2 -0.7"/>
<mass value="{1}"/><inertia ixx="0.3" ixy="0.02" ixz="-0.01" iyy="0.4" iyz="0.03" izz="0.5"/>
</inertial></link>"""
_JOINT = """<joint name="{1}" type="{2}"><parent link="{0}"/><child link="{1}"/>
<origin xyz="0.2 0.1 0.3" rpy="0.1 -0.4 0.9"/><axis xyz="{3}"/>
<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>"""
_JOINTS = (
    ('base', 'shoulder', 'revolute', '0 0 1'),
    ('shoulder', 'slide', 'prismatic', '1 2 3'),
    ('slide', 'wrist', 'revolute', '0.3 -1 0.2'),
    ('shoulder', 'head', 'revolute', '0 1 0'),
)
_URDF = '<robot>{}</robot>'.format(
    ''.join(
        [_LINK.format(name, 1.5 + i) for i, name in enumerate(['base', *(j[1] for j in _JOINTS)])]
        + [_JOINT.format(*joint) for joint in _JOINTS]
    )
)


def model_of(
    robot: TreeRobot | Tree, body: int = 0, point: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> TreeModel:
    """Return a robot as the model of compiled functions, with a body's point as its task."""
    tree = robot if isinstance(robot, Tree) else robot.tree
    size = len(tree.armature)
    numbers = packed(
        tree, np.eye(tree.base), [(body, np.eye(3).ravel().tolist(), point)], range(6),
        np.ones(size), np.zeros(size), (np.zeros(size),) * 3, 0.0, 0.0, 1e-3,
    )  # fmt: skip
    return TreeModel(numbers)


def digest() -> str:
    """Return the digest of all dynamic quantities at some states."""
    robot = tree_robot(read_urdf(_URDF, 'a text'), 'a text', base='omnidirectional', armature=0.01)
    point = (0.3, -0.2, 0.1)
    model = model_of(robot, 3, point)
    size, states = 7, 5
    grid = np.arange(size * states, dtype=float).reshape(states, size)
    results = []
    for scale, *state in zip(
        np.linspace(0.5, 1.5, states),
        *((grid % step - step / 2.0) / 7.0 for step in (11.0, 13.0, 17.0, 19.0)),
        strict=True,
    ):
        position, velocity, reference, acceleration = state
        theta = scale * robot.inertial_parameters.ravel()
        posture = kinematics.place(model, *position[:3].tolist(), position, 3)
        of = model, posture, theta
        moved = velocity, reference, acceleration, 9.81
        results += [
            posture.frames[:, :12].copy(),
            posture.motion_subspaces,
            dynamics.inverse_dynamics(*of, *moved),
            dynamics.inertia(*of),
            articulated.forward_dynamics(*of, velocity, reference, 9.81),
            dynamics.moment_gradients(model, posture, *moved, velocity),
            kinematics.point_jacobian(model, posture, 3, point),
            kinematics.point_jacobian_rate(model, posture, velocity, 3, point),
        ]
    return hashlib.sha256(b''.join(map(np.ndarray.tobytes, results))).hexdigest()


def adapted_digest() -> str:
    """Return the digest of moments adapted by a series of steps, some of them too long."""
    robot = tree_robot(read_urdf(_URDF, 'a text'), 'a text')
    results = []
    for row in robot.inertial_parameters:
        inertial_parameters = tuple(row.tolist())
        for step in range(50):
            gradient = tuple(((step * 7 + i * 11) % 13 - 6.0) / 3.0 for i in range(10))
            inertial_parameters = natural_step(inertial_parameters, gradient, (step % 10) / 20.0)
            results.append(inertial_parameters)
    return hashlib.sha256(np.array(results).tobytes()).hexdigest()


if __name__ == '__main__':
    print(digest(), adapted_digest())
