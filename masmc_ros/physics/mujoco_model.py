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

"""
A robot as MuJoCo has it: bodies of its URDF, wheels on a plane, castors, and what it carries.

The base moves freely; what keeps it on its way is friction. Bodies have the URDF's masses and
nothing but wheels and castors touches anything.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.robot.robot import Robot
from masmc_ros.robot.tree.assembly import tree_robot, TreeRobot
from masmc_ros.robot.tree.urdf import read_urdf
import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PLACES = [0, 5]
"""Of the velocities that two driven wheels give a base: ahead, and around."""

_SOFTNESS = 0.004
"""Time constant of contacts in s: 20 kg sink in by 10 um, and wheels creep by 0.1 mm/s."""

_IMPEDANCE_RATIO = 10.0
"""Of friction to the normal force; less lets wheels creep."""

_CASTOR = 0.25
"""Radius of a castor as a part of a wheel's."""

_GAP = 0.1e-3
"""Height in m of castors above the ground: flush with the wheels they would unload one."""

_POINT = 1.0e-6
"""Inertia of what is carried, about its centre, for each kg of it: in m2."""

_FLAT = 1.0e-9
"""Part by which moments of inertia are made larger: those of a flat body may miss by rounding."""


class ContactModel(NamedTuple):
    """A robot for MuJoCo, and where in its state and contacts what belongs to the robot is."""

    model: Any
    """The `mujoco.MjModel`."""
    positions: Array
    """(joints) places of the joints in qpos, in the mechanism's order."""
    rates: Array
    """(joints) their places in qvel."""
    wheels: Array
    """(wheels) numbers of the wheels' geometries."""
    centres: Array
    """(wheels) where they are to the left of the base's origin, in m."""
    radii: Array
    """(wheels) their radius in m, negative where a positive rate drives backwards."""
    height: float
    """Of the base's origin above the ground with the robot on its wheels, in m."""


def contact_model(
    robot: Robot,
    step: float,
    *,
    friction: float,
    castor_distance: float = 0.0,
    load: float = 0.0,
) -> ContactModel:
    """
    Make the model of a robot on two driven wheels.

    Parameters
    ----------
    robot
        what moves.
    step
        of integration, in s.
    friction
        coefficient of friction of the wheels on the ground.
    castor_distance
        of the castors from the axle, in m; 0 is half of the track.
    load
        mass of what the robot carries in its tip, in kg.

    Raises
    ------
    InputError
        where it does not stand on two driven wheels, or MuJoCo cannot have such bodies.

    """
    mechanism = robot.mechanism
    if [velocity.place for velocity in mechanism.twist] != _PLACES:
        raise InputError(
            'plant.physics = mujoco: expected a robot on two driven wheels (robot.base '
            'differential); what stands still or has rollers has no such contact with the ground'
        )
    tree = _with_wheels(robot)
    names = [joint.name for joint in mechanism.joints]
    driven = names[:len(_PLACES)]
    centres = [_centre(tree, name) for name in driven]
    radius = robot.values.get('wheel_radius') or centres[0][2]
    ground = centres[0][2] - radius
    spec = mujoco.MjSpec()
    spec.compiler.autolimits = True
    option = spec.option
    option.timestep, option.cone = step, mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = _IMPEDANCE_RATIO
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Who goes on from zero after a failure would tell of no failure.
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    spec.worldbody.add_geom(
        name='ground', type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], condim=1,
        solref=[_SOFTNESS, 1.0],
    )
    bodies = _bodies(spec, tree, robot.values.get('armature', 0.0))
    # Of a robot whose joints rub, coefficients of all of them: viscous ones first.
    coefficients = np.reshape(getattr(mechanism, 'friction', np.zeros(0)), (2, -1))
    for name, viscous, coulomb in zip(names, *coefficients, strict=False):
        joint = spec.joint(name)
        # The second and third are of its square and cube.
        joint.damping, joint.frictionloss = [viscous, 0.0, 0.0], coulomb
    for name in driven:
        _add_wheel(bodies[_number(tree, name)], name, radius, friction)
    distance = castor_distance or 0.5 * abs(centres[0][1] - centres[1][1])
    for side in (-distance, distance):
        size = _CASTOR * radius
        bodies[0].add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[size, 0.0, 0.0], condim=1,
            pos=[side, 0.0, ground + size + _GAP], solref=[_SOFTNESS, 1.0],
        )
    tip = tree.frames[mechanism.point_frame or mechanism.frames[-1][1]]
    # Always there, so that the state is laid out alike; what weighs nothing moves nothing.
    carried = bodies[tip.body].add_body(name='load', pos=tip.offset)
    carried.explicitinertial = True
    carried.mass, carried.ipos, carried.inertia = load, np.zeros(3), np.full(3, _POINT * load)
    try:
        model = spec.compile()
    except ValueError as error:
        raise InputError(f'plant.physics = mujoco: {error}') from error
    joints = [model.joint(name) for name in names]
    return ContactModel(
        model,
        np.array([joint.qposadr[0] for joint in joints]),
        np.array([joint.dofadr[0] for joint in joints]),
        np.array([model.geom(name).id for name in driven]),
        np.array([centre[1] for centre in centres]),
        np.array([radius * _side(tree, name) for name in driven]),
        -ground,
    )


def _with_wheels(robot: Robot) -> TreeRobot:
    """Return the bodies of a robot, its wheels being bodies of their own."""
    mechanism = robot.mechanism
    names = [joint.name for joint in mechanism.joints]
    values = {f'robot.{name}': value for name, value in robot.values.items()}
    where = 'robot_description'
    text = mechanism.formulas.description(values, names, '')
    return tree_robot(
        read_urdf(text, where),
        where,
        base_frame=mechanism.frames[0][1],
        joints=names,
        held=getattr(mechanism, 'held', {}),
    )


def _number(tree: TreeRobot, joint: str) -> int:
    """Return the number of the body that a joint moves."""
    return 1 + [each.name for each in tree.joints].index(joint)


def _centre(tree: TreeRobot, joint: str) -> Sequence[float]:
    """Return where a wheel's centre is in the base, in m."""
    found: Sequence[float] = tree.tree.offset[_number(tree, joint)].tolist()
    return found


def _side(tree: TreeRobot, joint: str) -> float:
    """Return 1 where a wheel's axle points to the left, -1 where it does to the right."""
    number = _number(tree, joint)
    axle = tree.tree.rotation[number].reshape(3, 3) @ tree.joints[number - 1].axis
    return float(np.sign(axle[1]))


def _bodies(spec: Any, tree: TreeRobot, armature: float) -> list[Any]:
    """Add the bodies, the base first, and return them."""
    found: list[Any] = []
    for number, moments in enumerate(tree.moments):
        if number == 0:
            body = spec.worldbody.add_body(name='base')
            body.add_freejoint()
        else:
            joint = tree.joints[number - 1]
            rotation = tree.tree.rotation[number].reshape(3, 3)
            quaternion = np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, rotation.ravel())
            body = found[tree.tree.parent[number]].add_body(
                name=joint.child, pos=tree.tree.offset[number], quat=quaternion
            )
            slides = joint.kind == 'prismatic'
            body.add_joint(
                name=joint.name,
                type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
                axis=joint.axis,
                armature=armature,
            )
        _set_inertia(body, moments)
        found.append(body)
    return found


def _set_inertia(body: Any, moments: Array) -> None:
    """Give a body its mass, centre of mass and inertia about it, of its moments (10)."""
    mass, first = moments[0], moments[1:4]
    body.explicitinertial = True
    body.mass = mass
    if mass <= 0.0:
        return
    centre = first / mass
    xx, yy, zz, xy, yz, zx = moments[4:]
    second = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]) - mass * np.outer(centre, centre)
    inertia = np.trace(second) * (1.0 + _FLAT) * np.eye(3) - second
    body.ipos = centre
    body.fullinertia = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


def _add_wheel(body: Any, name: str, radius: float, friction: float) -> None:
    """Add what touches the ground: in one point below the wheel's centre, as a thin disc does."""
    body.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0.0, 0.0],
        friction=[friction, 0.0, 0.0], priority=1, condim=3, solref=[_SOFTNESS, 1.0],
    )
