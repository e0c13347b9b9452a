# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
MuJoCo model of a robot: bodies of its URDF, wheels on a plane, castors and payload.

The base moves freely and is guided by friction. Bodies have the masses of the URDF. Only wheels
and castors have contacts. The rotor of an elastic joint is a body that only spins, as that of
`plant_model.elastic`, and a tendon is its spring. A stiff constraint couples a mimic joint to its
controlled joint, and the wheels of one side of a skid-steer base to each other.

A wheel with rollers has friction along the axis of the roller on the ground, and nearly none
across. The contact geometry, a short capsule, defines both directions, and must not turn with the
wheel: see `ContactRobot`.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.params.declaration import Values
from masmc_ros.robot.robot import Robot
from masmc_ros.robot.tree.assembly import Mimic, tree_robot, TreeRobot
from masmc_ros.robot.tree.wheels import Wheels
from masmc_ros.robot.urdf import read_urdf
import mujoco
import numpy as np

_PLACES = [0, 5]
"""Indices of the base velocities with two driven wheels: forwards and rotation."""

_ANY_WAY = [0, 1, 5]
"""Indices for an omnidirectional base: forwards, sideways and rotation."""

_OMNI_COUNT = 4
"""Number of wheels under an omnidirectional base; they roll around its centre."""

_OMNI_RADIUS = 0.1
_OMNI_MASS = 0.05
_OMNI_INERTIA = 0.001
"""Radius, mass and inertia of such a wheel with its rotor: in m, kg and kg·m²."""

_OMNI_DISTANCE = 0.4
"""Default distance of these wheels from the centre of the base in m."""

_ROLLER = 1.0e-3
"""Friction of rollers along the axle as a part of the wheel's: zero for all that moves."""

_FLATNESS = 1.0e-3
"""Length of the contact cylinder as a part of the radius; it defines the axle direction."""

_SOFTNESS = 0.004
"""Time constant of contacts in s: 20 kg sink in by 10 um, and wheels creep by 0.1 mm/s."""

_IMPEDANCE_RATIO = 10.0
"""Ratio of the impedances of friction and normal force; a smaller one lets wheels creep."""

_CASTOR = 0.25
"""Radius of a castor as a part of a wheel's."""

_GAP = 0.1e-3
"""Height in m of castors above the ground: flush with the wheels they would unload one."""

_POINT = 1.0e-6
"""Inertia of the payload about its centre per kg: in m²."""

_FLAT = 1.0e-9
"""Relative increase of moments of inertia, because rounding can make flat bodies invalid."""


_COUPLED = (0.9999, 0.99999, 1.0e-6, 0.5, 2.0)
"""Impedance of the constraints of mimic joints: they deviate by less than 1e-8 rad or m."""


class ContactModel(NamedTuple):
    """MuJoCo model of a robot, and the indices of the robot in its state and contacts."""

    model: mujoco.MjModel
    positions: Array
    """Indices (joints - forces) of the joints in qpos, in the order of the mechanism."""
    rates: Array
    """Indices (joints - forces) of the joints in qvel."""
    rotor_positions: Array
    """Indices (joints - forces) of the rotors in qpos; those of rigid joints are the joints."""
    rotor_rates: Array
    """Indices (joints - forces) of the rotors in qvel."""
    mimic_positions: Array
    """Indices (mimic joints) in qpos."""
    mimic_rates: Array
    """Indices (mimic joints) in qvel."""
    sources: Array
    """Indices (mimic joints) of the joints in `positions` that move them."""
    multipliers: Array
    """Positions (mimic joints) per position of these joints."""
    forces: int
    """Number of the first joints of the mechanism that are forces on the base instead."""
    turning: Array
    """Indices (wheels) of the wheels in qvel."""
    angles: Array
    """Indices (wheels) of the wheels in qpos."""
    spun: Array
    """Axles (wheels, 3) in the frames of the wheels."""
    wheels: Array
    """Numbers (wheels) of the wheel geometries."""
    radii: Array
    """Radii (wheels) in m; negative if a positive rate drives backwards."""
    rolling: Array
    """Rates (wheels, 3) of rolling wheels per base velocity forwards, sideways and rotation."""
    has_rollers: bool
    """True if rollers allow motion along the axles."""
    driving: Wheels | None
    """Own wheels of the robot if they have rollers."""
    height: float
    """Height of the base origin above the ground in m, with the robot on its wheels."""


def contact_model(
    robot: Robot,
    step: float,
    *,
    friction: float,
    castor_distance: float = 0.0,
    load: float = 0.0,
    springs: Array | None = None,
) -> ContactModel:
    """
    Make the model of a robot on two driven wheels, on those of a skid-steer base, or on rollers.

    Parameters
    ----------
    robot
        Robot to model.
    step
        Step of the integration in s.
    friction
        Friction coefficient of the wheels on the ground.
    castor_distance
        Distance of the castors from the axle, or of the wheels that are put under an
        omnidirectional base from the centre, in m; 0 selects half of the track, or 0.4 m.
    load
        Mass of the payload at the tip in kg.
    springs
        Stiffness in N·m/rad, damping in N·m·s/rad and inertia of the rotor in kg·m² of each joint
        (joints, 3); a joint with a stiffness of 0 is rigid. None: all are rigid.

    Raises
    ------
    InputError
        If the robot has no wheels or friction in directions of the base, or MuJoCo rejects its
        bodies.

    """
    mechanism = robot.mechanism
    places = [velocity.place for velocity in mechanism.twist]
    has_rollers = places == _ANY_WAY
    if places not in (_PLACES, _ANY_WAY):
        raise InputError(
            'plant.physics = mujoco: expected a robot on wheels (robot.base differential), or an '
            'omnidirectional base; four wheels are put under one without robot.wheels'
        )
    # Those of the paper's robot are its two first joints.
    driving: Wheels | None = getattr(getattr(mechanism, 'robot', None), 'wheels', None)
    # The drives of three wheels are joints of the mechanism; more of them push the base.
    pushes = has_rollers and (driving is None or driving.push_base)
    forces = len(_ANY_WAY) if pushes else 0
    names = [joint.name for joint in mechanism.joints][forces:]
    followers = {
        name: Mimic(*follower) for name, follower in (driving.followers if driving else {}).items()
    }
    turned = [*followers]
    if driving and pushes:
        turned = [joint.name for joint in driving.joints]
    springs = np.zeros((len(mechanism.joints), 3)) if springs is None else springs
    if springs[:forces, 0].any():
        raise InputError(
            'plant.joint_stiffness: expected 0 for the first 3 joints, because with plant.physics '
            'mujoco they are forces on the base'
        )
    tree = _with_wheels(robot, [*turned, *names])
    mimics = {**tree.mimics, **followers}
    ground = 0.0
    if driving and has_rollers:
        wheels = _rolling_wheels(tree, driving)
        ground = wheels[0].centre[2] - wheels[0].radius
    elif has_rollers:
        wheels = _omni_wheels(castor_distance or _OMNI_DISTANCE)
    else:
        driven = [*names[:len(_PLACES)], *followers]
        wheels = [_wheel(tree, name, robot.values) for name in driven]
        ground = wheels[0].centre[2] - wheels[0].radius
    spec = mujoco.MjSpec()
    spec.compiler.autolimits = True
    option = spec.option
    option.timestep, option.cone = step, mujoco.mjtCone.mjCONE_ELLIPTIC
    # Of two frictions it means that in the first direction, which is the axle's.
    option.impratio = _IMPEDANCE_RATIO * (_ROLLER**2 if has_rollers else 1.0)
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # A reset to zero after a failure would hide the failure.
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    spec.worldbody.add_geom(
        name='ground', type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], condim=1,
        solref=[_SOFTNESS, 1.0],
    )
    bodies = _bodies(spec, tree, robot.values.get('armature', 0.0))
    # A robot with joint friction has coefficients of all joints, viscous ones first.
    coefficients = np.reshape(getattr(mechanism, 'friction', np.zeros(0)), (2, -1))
    of_joints = [*zip(names, *coefficients[:, forces:], strict=False)]
    if coefficients[:, :forces].any():
        if driving is None or robot.values.get('friction') != 'urdf':
            raise InputError(
                'robot.viscous_friction and robot.coulomb_friction: expected 0 for the first 3 '
                'joints, because with plant.physics mujoco they are forces on the base'
            )
        of_joints += [(joint.name, joint.damping, joint.friction) for joint in driving.joints]
    for name, viscous, coulomb in of_joints:
        joint = spec.joint(name)
        # The second and third are of its square and cube.
        joint.damping, joint.frictionloss = [viscous, 0.0, 0.0], coulomb
    for name, mimic in mimics.items():
        # The offset is part of the placement of the body.
        coupling = np.zeros(mujoco.mjNEQDATA)
        coupling[1] = mimic.multiplier
        spec.add_equality(
            name=name, type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=name, name2=mimic.source, data=coupling, solref=[2.0 * step, 1.0],
            solimp=_COUPLED,
        )
    rotors = [
        _add_rotor(spec, name, *spring) if spring[0] > 0.0 else name
        for name, spring in zip(names, springs[forces:], strict=True)
    ]
    for wheel in wheels:
        if not has_rollers:
            _add_wheel(bodies[_number(tree, wheel.name)], wheel, friction)
            continue
        body = bodies[_number(tree, wheel.name)] if driving else _add_omni_wheel(bodies[0], wheel)
        _add_rollers(spec, body, wheel, friction)
    if len(wheels) == len(_PLACES):
        distance = castor_distance or 0.5 * abs(wheels[0].centre[1] - wheels[1].centre[1])
        _add_castors(bodies[0], distance, _CASTOR * wheels[0].radius, ground)
    tip = tree.frames[mechanism.point_frame or mechanism.frames[-1][1]]
    # The payload always exists, so the state has one layout; without mass it has no effect.
    carried = bodies[tip.body].add_body(name='load', pos=tip.offset)
    carried.explicitinertial = True
    carried.mass, carried.ipos, carried.inertia = load, np.zeros(3), np.full(3, _POINT * load)
    try:
        model = spec.compile()
    except ValueError as error:
        raise InputError(f'plant.physics = mujoco: {error}') from error
    joints, turning, coupled = (
        [model.joint(name) for name in part] for part in (names, rotors, mimics)
    )
    numbers = [model.geom(wheel.name).id for wheel in wheels]
    # The directions of the geometries of rollers change.
    model.geom_sameframe[numbers] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    return ContactModel(
        model,
        np.array([joint.qposadr[0] for joint in joints]),
        np.array([joint.dofadr[0] for joint in joints]),
        np.array([joint.qposadr[0] for joint in turning]),
        np.array([joint.dofadr[0] for joint in turning]),
        np.array([joint.qposadr[0] for joint in coupled], np.int64),
        np.array([joint.dofadr[0] for joint in coupled], np.int64),
        np.array([names.index(mimic.source) for mimic in mimics.values()], np.int64),
        np.array([mimic.multiplier for mimic in mimics.values()]),
        forces,
        np.array([model.joint(wheel.name).dofadr[0] for wheel in wheels]),
        np.array([model.joint(wheel.name).qposadr[0] for wheel in wheels]),
        np.array([model.joint(wheel.name).axis for wheel in wheels]),
        np.array(numbers),
        np.array([wheel.radius * (1.0 if has_rollers else wheel.axle[1]) for wheel in wheels]),
        np.array([wheel.rolling for wheel in wheels]),
        has_rollers,
        driving if has_rollers else None,
        -ground,
    )


class _Wheel(NamedTuple):
    """A wheel, in the base's frame."""

    name: str
    centre: Array
    axle: Array
    """Unit vector of positive rotation."""
    radius: float
    free: Array
    """Unit vector without friction, if it has rollers, in the frame of its body."""
    rolling: Array
    """Rolling rate (3) per base velocity forwards, sideways and rotation."""


def _rolling(centre: Array, axle: Array, radius: float) -> Array:
    """Return the rates of a plain wheel."""
    ahead, left = axle[1] / radius, -axle[0] / radius
    return np.array([ahead, left, centre[0] * left - centre[1] * ahead])


def _wheel(tree: TreeRobot, joint: str, values: Values) -> _Wheel:
    """Return a driven wheel of the robot, with its axle along y of the base."""
    number = _number(tree, joint)
    centre = tree.tree.offset[number]
    axle = tree.tree.rotation[number].reshape(3, 3) @ tree.moving[number - 1].axis
    side = np.array([0.0, np.sign(axle[1]), 0.0])
    radius = float(values.get('wheel_radius') or centre[2])
    return _Wheel(joint, centre, side, radius, side, _rolling(centre, side, radius))


def _rolling_wheels(tree: TreeRobot, driving: Wheels) -> list[_Wheel]:
    """Return the wheels of an omnidirectional base, which have rollers."""
    wheels = []
    for joint, rates in zip(driving.joints, driving.matrix, strict=True):
        number = _number(tree, joint.name)
        rotation = tree.tree.rotation[number].reshape(3, 3)
        # The rates are those of a motion along the axis of the roller.
        across = np.array([-rates[1], rates[0], 0.0])
        wheels.append(
            _Wheel(
                joint.name, tree.tree.offset[number],
                rotation @ tree.moving[number - 1].axis, driving.radius,
                rotation.T @ across / np.linalg.norm(across), rates,
            )
        )  # fmt: skip
    return wheels


def _omni_wheels(distance: float) -> list[_Wheel]:
    """Return wheels that roll around the centre of the base, first the front left one."""
    wheels = []
    for number in range(_OMNI_COUNT):
        angle = (number + 0.5) * 2.0 * math.pi / _OMNI_COUNT
        outward = np.array([math.cos(angle), math.sin(angle), 0.0])
        centre = distance * outward + [0.0, 0.0, _OMNI_RADIUS]
        rolling = _rolling(centre, outward, _OMNI_RADIUS)
        name = f'omni_wheel_{number + 1}'
        wheels.append(_Wheel(name, centre, outward, _OMNI_RADIUS, outward, rolling))
    return wheels


def _with_wheels(robot: Robot, names: Sequence[str]) -> TreeRobot:
    """Return the bodies of a robot for these joints, including its wheels."""
    mechanism = robot.mechanism
    driven = [joint.name for joint in mechanism.joints]
    values = {f'robot.{name}': value for name, value in robot.values.items()}
    where = 'robot_description'
    text = mechanism.formulas.description(values, driven, '')
    return tree_robot(
        read_urdf(text, where),
        where,
        base_frame=mechanism.frames[0][1],
        joints=names,
        held=getattr(mechanism, 'held', {}),
    )


def _number(tree: TreeRobot, joint: str) -> int:
    """Return the number of the body that a joint moves."""
    return 1 + [candidate.name for candidate in tree.moving].index(joint)


def _bodies(spec: mujoco.MjSpec, tree: TreeRobot, armature: float) -> list[mujoco.MjsBody]:
    """Add the bodies, the base first, and return them."""
    bodies: list[mujoco.MjsBody] = []
    for number, inertial_parameters in enumerate(tree.inertial_parameters):
        if number == 0:
            body = spec.worldbody.add_body(name='base')
            body.add_freejoint()
        else:
            joint = tree.moving[number - 1]
            rotation = tree.tree.rotation[number].reshape(3, 3)
            quaternion = np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, rotation.ravel())
            body = bodies[tree.tree.parent[number]].add_body(
                name=joint.child, pos=tree.tree.offset[number], quat=quaternion
            )
            slides = joint.kind == 'prismatic'
            body.add_joint(
                name=joint.name,
                type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
                axis=joint.axis,
                armature=0.0 if joint.name in tree.mimics else armature,
            )
        _set_inertia(body, inertial_parameters)
        bodies.append(body)
    return bodies


def _add_rotor(
    spec: mujoco.MjSpec, joint: str, stiffness: float, damping: float, inertia: float
) -> str:
    """Add the rotor of an elastic joint and its spring; return the name of its joint."""
    name = f'{joint}_rotor'
    body = spec.worldbody.add_body(name=name)
    body.explicitinertial = True
    body.mass, body.ipos, body.inertia = inertia, np.zeros(3), np.full(3, inertia)
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
    # The second and third are of the square and the cube of its length.
    spring = spec.add_tendon(
        name=name, stiffness=[stiffness, 0.0, 0.0], damping=[damping, 0.0, 0.0],
        springlength=[0.0, 0.0],
    )
    spring.wrap_joint(name, 1.0)
    spring.wrap_joint(joint, -1.0)
    return name


def _set_inertia(body: mujoco.MjsBody, inertial_parameters: Array) -> None:
    """Set mass, centre of mass and inertia of a body from its inertial parameters (10)."""
    mass, first = inertial_parameters[0], inertial_parameters[1:4]
    body.explicitinertial = True
    body.mass = mass
    if mass <= 0.0:
        return
    centre = first / mass
    xx, yy, zz, xy, yz, zx = inertial_parameters[4:]
    second = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]) - mass * np.outer(centre, centre)
    inertia = np.trace(second) * (1.0 + _FLAT) * np.eye(3) - second
    body.ipos = centre
    body.fullinertia = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


def _add_wheel(body: mujoco.MjsBody, wheel: _Wheel, friction: float) -> None:
    """Add the contact geometry of a wheel: one point below its centre, like a thin disc."""
    body.add_geom(
        name=wheel.name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[wheel.radius, 0.0, 0.0],
        friction=[friction, 0.0, 0.0], priority=1, condim=3, solref=[_SOFTNESS, 1.0],
    )


def _add_omni_wheel(base: mujoco.MjsBody, wheel: _Wheel) -> mujoco.MjsBody:
    """Add a wheel with rollers across its rim to a base without own wheels."""
    body = base.add_body(name=wheel.name, pos=wheel.centre)
    body.explicitinertial = True
    body.mass, body.ipos, body.inertia = _OMNI_MASS, np.zeros(3), np.full(3, _OMNI_INERTIA)
    body.add_joint(name=wheel.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=wheel.axle)
    return body


def _add_rollers(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, wheel: _Wheel, friction: float
) -> None:
    """Add the contact of a wheel with rollers: a capsule along the direction without friction."""
    end = 0.5 * _FLATNESS * wheel.radius * wheel.free
    body.add_geom(
        name=wheel.name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[wheel.radius, 0.0, 0.0],
        fromto=[*-end, *end],
    )
    spec.add_pair(
        geomname1='ground', geomname2=wheel.name, condim=3, solref=[_SOFTNESS, 1.0],
        friction=[_ROLLER * friction, friction, 0.0, 0.0, 0.0],
    )


def _add_castors(base: mujoco.MjsBody, distance: float, size: float, ground: float) -> None:
    """Add castors at the front and back, which keep a base on two wheels upright."""
    for side in (-distance, distance):
        base.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[size, 0.0, 0.0], condim=1,
            pos=[side, 0.0, ground + size + _GAP], solref=[_SOFTNESS, 1.0],
        )
