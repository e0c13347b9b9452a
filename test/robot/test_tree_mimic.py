# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Mimic joints: kinematics, dynamics, limits and frames, against the robot with free joints."""

from __future__ import annotations

from pathlib import Path
import re
import sys
from typing import Any, NamedTuple

from helpers.tree_bits import model_of
from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.packages import resource_path
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.tree import articulated, dynamics, kinematics
from masmc_ros.robot.tree.assembly import tree_robot, TreeRobot
from masmc_ros.robot.tree.dynamics import GRAVITY
from masmc_ros.robot.tree.frames import world_of
from masmc_ros.robot.tree.identified import values_of
from masmc_ros.robot.tree.task.task import frame_pose
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
from masmc_ros.robot.urdf import read_urdf
from masmc_ros.scenario.scenario import activation, load_scenario
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

FEW = settings(max_examples=25, deadline=None)
SEED = st.integers(0, 2**32 - 1)

LINK = """<link name="{}"><inertial><origin xyz="{}" rpy="{}"/><mass value="{}"/>
<inertia ixx="0.03" ixy="0.002" ixz="-0.001" iyy="0.04" iyz="0.003" izz="0.05"/></inertial></link>
"""
JOINT = """<joint name="{0}_joint" type="{1}"><parent link="{2}"/><child link="{0}"/>
<origin xyz="{3}" rpy="{4}"/><axis xyz="{5}"/>
<limit lower="{6}" upper="{7}" effort="{8}" velocity="{9}"/>{10}</joint>
"""
ZERO, UP = '0 0 0', '0 0 1'


def stages(
    mimic: str,
    own: tuple[float, ...] = (0.0, 0.5, 300.0, 0.2),
    other: tuple[float, ...] = (0.0, 0.5, 300.0, 0.2),
    dynamics_: str = '',
) -> str:
    """
    Return a lift of two stages of 2 kg, whose second mimics the first, and an arm of 1 kg.

    The numbers of the stages are lower and upper limit, effort and velocity.
    """
    parts = [LINK.format(name, '0 0 0.1', ZERO, mass) for name, mass in zip(
        ('base', 'low', 'high', 'arm'), (1, 2, 2, 1), strict=True
    )]
    parts += [
        JOINT.format('low', 'prismatic', 'base', '0 0 0.2', ZERO, UP, *own, dynamics_),
        JOINT.format('high', 'prismatic', 'low', '0 0 0.2', ZERO, UP, *other, mimic + dynamics_),
        JOINT.format('arm', 'revolute', 'high', '0 0 0.2', ZERO, '0 1 0', -2, 2, 20, 3, ''),
    ]
    return f'<robot name="stages">{"".join(parts)}</robot>'


STAGES = stages('<mimic joint="low_joint"/>')


class Free(NamedTuple):
    """The same robot with free joints, and the map of its velocities."""

    robot: TreeRobot
    rates: Array
    """(n of free joints, n) G."""
    offsets: Array
    """Positions of all joints for controlled joints at zero."""

    def joints(self, position: Array) -> Array:
        """Return the positions of all joints for those of the controlled ones."""
        base = self.robot.tree.base
        return np.asarray(self.rates[base:, base:] @ position + self.offsets)


def drawn(seed: int) -> str:
    """Return the URDF of a random tree; half of the joints mimic others, also in chains."""
    draw = np.random.default_rng(seed)
    count = int(draw.integers(2, 9))

    def three() -> str:
        return ' '.join(map(str, draw.normal(size=3)))

    parts = [LINK.format('link_0', three(), three(), 1.0)]
    order = draw.permutation(np.arange(1, count + 1))
    for number in range(1, count + 1):
        mimic, before = '', order[:int(np.flatnonzero(order == number)[0])]
        if len(before) and draw.random() < 0.5:
            multiplier = draw.choice([-1.0, 1.0]) * draw.uniform(0.3, 2.0)
            mimic = f'<mimic joint="link_{draw.choice(before)}_joint" multiplier="{multiplier}"'
            mimic += f' offset="{draw.normal()}"/>'
        parts.append(LINK.format(f'link_{number}', three(), three(), draw.uniform(0.5, 2.0)))
        parts.append(
            JOINT.format(
                f'link_{number}', draw.choice(['revolute', 'prismatic']),
                f'link_{draw.integers(0, number)}', three(), three(), three(), -9, 9, 1, 1, mimic,
            )
        )
    return f'<robot name="drawn">{"".join(parts)}</robot>'


def free(text: str, robot: TreeRobot) -> Free:
    """Return the robot without the mimic elements of its description."""
    base = robot.tree.base
    kind = 'omnidirectional' if base else 'fixed'
    whole = tree_robot(read_urdf(re.sub('<mimic[^>]*>', '', text), 'x'), 'x', base=kind)
    names = [joint.name for joint in robot.joints]
    rates = np.zeros((base + len(whole.joints), base + len(names)))
    rates[:base, :base] = np.eye(base)
    offsets = np.zeros(len(whole.joints))
    for row, joint in enumerate(whole.joints):
        source, multiplier, offset = robot.mimics.get(joint.name, (joint.name, 1.0, 0.0))
        rates[base + row, base + names.index(source)], offsets[row] = multiplier, offset
    return Free(whole, rates, offsets)


def shuffled(text: str, seed: int) -> list[str]:
    """Return the controlled joints in a random possible order."""
    left, order = list(tree_robot(read_urdf(text, 'x'), 'x').joints), []
    above = {joint.child: joint for joint in read_urdf(text, 'x').joints.values()}
    draw = np.random.default_rng(seed)
    names = {joint.name for joint in left}

    def carriers(link: str) -> set[str]:
        if link not in above:
            return set()
        joint = above[link]
        return carriers(joint.parent) | ({joint.name} & names)

    while left:
        ready = [joint for joint in left if carriers(joint.parent) <= set(order)]
        joint = ready[draw.integers(len(ready))]
        order.append(joint.name)
        left.remove(joint)
    return order


def close(actual: Array, expected: Array, within: float = 1e-12) -> None:
    assert np.abs(actual - expected).max() <= within * (1.0 + np.abs(expected).max())


def test_mimic_two_stage_lift_equals_sums_by_hand() -> None:
    robot = tree_robot(read_urdf(STAGES, 'x'), 'x')
    assert [joint.name for joint in robot.joints] == ['low_joint', 'arm_joint']
    frame, still = robot.frames['arm'], np.zeros(2)
    model = model_of(robot, frame.body, frame.offset)
    posture = kinematics.place(model, 0.0, 0.0, 0.0, np.array([0.4, 0.0]), 0)
    arguments = model, posture, robot.inertial_parameters.ravel()
    assert frame_pose(model, posture, 0)[1] == pytest.approx((0.0, 0.0, 1.4))
    gravity = dynamics.inverse_dynamics(*arguments, still, still, still, GRAVITY)
    assert gravity == pytest.approx([78.48, 0.0])
    assert dynamics.inertia(*arguments)[0, 0] == pytest.approx(14.0)
    fall = articulated.forward_dynamics(*arguments, still, still, GRAVITY)
    assert fall == pytest.approx([-78.48 / 14.0, 0.0])


@FEW
@given(SEED, st.sampled_from(('fixed', 'omnidirectional')))
def test_mimic_dynamics_equal_mapped_free_joints(seed: int, base: str) -> None:
    text = drawn(seed)
    order = shuffled(text, seed)
    robot = tree_robot(read_urdf(text, 'x'), 'x', base=base, joints=order)
    assert [joint.name for joint in robot.joints] == order
    free_robot = free(text, robot)
    whole, g = free_robot.robot, free_robot.rates
    draw = np.random.default_rng(seed)
    position = draw.normal(size=len(robot.joints))
    velocity, reference, acceleration, forces = draw.normal(size=(4, g.shape[1]))
    tip = robot.moving[-1].child
    models = [model_of(r, r.frames[tip].body) for r in (robot, whole)]
    places = [
        kinematics.place(model, 0.0, 0.0, 0.0, at, 0)
        for model, at in zip(models, (position, free_robot.joints(position)), strict=True)
    ]
    of, of_whole = (
        (model, place, r.inertial_parameters.ravel())
        for model, place, r in zip(models, places, (robot, whole), strict=True)
    )
    inertia = g.T @ dynamics.inertia(*of_whole) @ g
    close(dynamics.inertia(*of), inertia)
    moved = g @ velocity, g @ reference, g @ acceleration
    torques = dynamics.inverse_dynamics(*of, velocity, reference, acceleration, GRAVITY)
    close(torques, g.T @ dynamics.inverse_dynamics(*of_whole, *moved, GRAVITY))
    bias = dynamics.inverse_dynamics(*of, velocity, velocity, 0.0 * velocity, GRAVITY)
    accelerations = articulated.forward_dynamics(*of, velocity, forces, GRAVITY)
    close(inertia @ accelerations, forces - bias, 1e-9)

    sigma = velocity - reference
    gradients = dynamics.moment_gradients(
        *of[:2], velocity, reference, acceleration, GRAVITY, sigma
    )
    assert gradients @ of[2] == pytest.approx(sigma @ torques, rel=1e-9, abs=1e-9)

    bodies = [r.frames[tip].body for r in (robot, whole)]
    point = (0.3, -0.2, 0.1)
    jacobians, derivatives = zip(*(
        (
            kinematics.point_jacobian(model, place, body, point).T,
            kinematics.point_jacobian_rate(model, place, rates, body, point).T,
        )
        for model, place, body, rates in zip(
            models, places, bodies, (velocity, g @ velocity), strict=True
        )
    ), strict=True)  # fmt: skip
    close(jacobians[0], jacobians[1] @ g)
    close(derivatives[0], derivatives[1] @ g)
    generalised = np.zeros(len(velocity))
    wrench = (1.0, 2.0, 3.0), (-1.0, 0.5, 0.2)
    kinematics.add_point_forces(models[0], places[0], bodies[0], point, *wrench, generalised)
    close(generalised, jacobians[0].T @ np.ravel(wrench))
    rotations, origins = zip(
        *(frame_pose(model, place, 0) for model, place in zip(models, places, strict=True)),
        strict=True,
    )
    close(np.array(origins[0]), np.array(origins[1]))
    close(np.array(rotations[0]), np.array(rotations[1]))


@FEW
@given(SEED)
def test_mimic_transforms_equal_placed_bodies(seed: int) -> None:
    mechanism = tree_mechanism({'robot.urdf': drawn(seed)})
    robot = mechanism.robot
    angles = np.random.default_rng(seed).normal(size=len(robot.joints))
    position = np.array([[0.0, 0.0, 0.0, *angles]])
    transforms = mechanism.formulas.frame_transforms(None, position)[0]
    poses = dict(zip(
        (child for _, child in mechanism.frames), world_of(mechanism.frames, transforms),
        strict=True,
    ))  # fmt: skip
    placed = kinematics.place(model_of(robot), 0.0, 0.0, 0.0, angles, 0).frames
    for number, joint in enumerate(robot.moving, 1):
        close(poses[joint.child][0].ravel(), placed[number, :9])
        close(poses[joint.child][1], placed[number, 9:12])


def test_mimic_chain_has_product_of_multipliers() -> None:
    text = stages('<mimic joint="low_joint" multiplier="-2" offset="0.1"/>')
    chain = '<mimic joint="high_joint" multiplier="3" offset="0.5"/></joint></robot>'
    text = text.replace('velocity="3"/></joint>\n</robot>', f'velocity="3"/>{chain}')
    robot = tree_robot(read_urdf(text, 'x'), 'x')
    assert robot.mimics['arm_joint'] == pytest.approx(('low_joint', -6.0, 0.8))
    assert robot.tree.multiplier.tolist() == [1.0, 1.0, -2.0, -6.0]


def test_mimic_multiplier_0_is_held_at_offset() -> None:
    text = stages('<mimic joint="low_joint" multiplier="0" offset="0.25"/>')
    robot = tree_robot(read_urdf(text, 'x'), 'x')
    assert (robot.mimics, robot.held, robot.notes) == ({}, {'high_joint': 0.25}, ())
    assert [joint.name for joint in robot.moving] == ['low_joint', 'arm_joint']


def test_mimic_infinite_multiplier_raises() -> None:
    text = stages('<mimic joint="low_joint" multiplier="1e200"/>')
    chain = '<mimic joint="high_joint" multiplier="1e200"/></joint></robot>'
    text = text.replace('velocity="3"/></joint>\n</robot>', f'velocity="3"/>{chain}')
    expected = "'arm_joint' mimics 'low_joint' with multiplier inf and offset 0, expected finite"
    with pytest.raises(InputError, match=expected):
        tree_robot(read_urdf(text, 'x'), 'x')


def test_mimic_listed_as_controlled_raises() -> None:
    with pytest.raises(InputError, match="joint 'high_joint' moves with 'low_joint'"):
        tree_robot(read_urdf(STAGES, 'x'), 'x', joints=['low_joint', 'high_joint', 'arm_joint'])


LOW = (0.0, 0.5, 300.0, 0.2)
LIMITS_TO = "mimic joint 'high_joint' limits 'low_joint' to "


@pytest.mark.parametrize(
    ('mimic', 'other', 'limits', 'notes'),
    [
        ('multiplier="0.5"', (0.0, 0.25, 300.0, 0.1), (0.0, 0.5, 0.2), ['effort']),
        ('multiplier="-1"', (-0.5, 0.0, 0.0, 0.0), (0.0, 0.5, 0.2), []),
        ('', (0.0, 0.3, 300.0, 0.1), (0.0, 0.3, 0.1), ['0 to 0.3 m', '0.1 m/s']),
        ('multiplier="2" offset="0.1"', (0.0, 0.5, 600.0, 0.4), (0.0, 0.2, 0.2), ['0 to 0.2 m']),
        ('multiplier="-1"', (0.0, 0.5, 300.0, 0.2), (0.0, 0.5, 0.2), ['range']),
        ('', (0.0, 0.0, 300.0, 0.2), (0.0, 0.5, 0.2), []),
    ],
)
def test_mimic_limits_narrow_those_of_source(
    mimic: str, other: tuple[float, ...], limits: tuple[float, ...], notes: list[str]
) -> None:
    text = stages(f'<mimic joint="low_joint" {mimic}/>', LOW, other)
    mechanism = tree_mechanism({'robot.urdf': text})
    ends = [mechanism.joint_limits[name][0] for name in ('lower', 'upper', 'speed')]
    assert ends == pytest.approx(limits)
    assert mechanism.robot.limits.effort[0] == 300.0
    expected = {
        'effort': "the effort limit of mimic joint 'high_joint', which the drive of 'low_joint'"
        ' moves, is ignored',
        'range': "the range of mimic joint 'high_joint', 0 to 0.5 m, leaves none to 'low_joint'"
        ' and is ignored',
    }
    assert list(mechanism.notes) == [expected.get(note, LIMITS_TO + note) for note in notes]


def test_mimic_friction_is_that_of_both_joints() -> None:
    text = stages(
        '<mimic joint="low_joint" multiplier="-2"/>', LOW, (-1.0, 0.0, 600.0, 0.4),
        '<dynamics damping="3" friction="5"/>',
    )  # fmt: skip
    mechanism = tree_mechanism({'robot.urdf': text, 'robot.friction': 'urdf'})
    assert mechanism.friction.tolist() == [3.0 + 4.0 * 3.0, 0.0, 5.0 + 2.0 * 5.0, 0.0]


def test_mimic_source_needs_inertia_of_one_body() -> None:
    # Without links the first stage has no inertia, but the second one, which mimics it.
    text = re.sub('<inertial>.*?</inertial>', '', STAGES, count=2, flags=re.DOTALL)
    assert tree_mechanism({'robot.urdf': text, 'robot.armature': 0.0}).joints


def test_mimic_bodies_have_identified_moments() -> None:
    values = {p.name: p.default for p in tree_mechanism({'robot.urdf': STAGES}).parameters}
    robot = robot_of({**values, 'robot.urdf': STAGES})
    assert [q.name for q in robot.mechanism.theta][::10] == [
        'base_mass', 'low_mass', 'high_mass', 'arm_mass',
    ]  # fmt: skip
    theta = robot.theta * np.repeat([1.0, 1.1, 1.2, 1.3], 10)
    identified = tree_mechanism(values_of(robot, theta)).robot
    assert len(identified.mimics) == 1
    close(identified.inertial_parameters.ravel(), theta)


def test_mimic_of_wheel_is_noted() -> None:
    mounted = '{0}', 'continuous', 'base', '0 {1} 0.1', ZERO
    wheel = JOINT.format(*mounted, '0 1 0', 0, 0, 1, 1, '{2}')
    parts = [LINK.format(name, ZERO, ZERO, 1) for name in ('base', 'right', 'left', 'rear', 'arm')]
    parts += [
        wheel.format('right', -0.2, ''),
        wheel.format('left', 0.2, ''),
        wheel.format('rear', 0.2, '<mimic joint="left_joint"/>'),
        JOINT.format('arm', 'revolute', 'base', ZERO, ZERO, UP, -1, 1, 1, 1, ''),
    ]
    robot = tree_robot(
        read_urdf(f'<robot>{"".join(parts)}</robot>', 'x'), 'x', base='differential',
        wheels=['right_joint', 'left_joint'],
    )  # fmt: skip
    assert robot.notes == (
        "'rear_joint' mimics the wheel 'left_joint', which is not supported: it is kept at 0 rad",
    )
    assert [joint.name for joint in robot.joints] == ['arm_joint']


def scenario(folder: Path) -> str:
    """Write the lift of two stages with an arm that keep their positions, and return the file."""
    (folder / 'robot.urdf').write_text(STAGES, encoding='utf-8')
    path = folder / 'robot.yaml'
    path.write_text(
        f"""/**:
  ros__parameters:
    robot: {{urdf: {folder / 'robot.urdf'}, task: joints}}
    control_period: 0.001
    duration: 0.2
plant:
  ros__parameters:
    initial_joints: [0.2, 0.1]
trajectory:
  ros__parameters:
    line_sine: {{offset: [0.2, 0.1], amplitude: [0.0, 0.0]}}
""",
        encoding='utf-8',
    )
    return str(path)


@pytest.mark.slow
def test_mimic_lift_keeps_position(tmp_path: Path) -> None:
    values = load_scenario(scenario(tmp_path))
    (block,) = Simulation(values, activation(values)).run(block=sys.maxsize)
    robot = robot_of(values['plant'])
    assert np.abs(block.true_error(robot)).max() < 1e-4
    # The force carries the first stage once, and the second one and the arm twice.
    assert block.torque[100:, 0].mean() == pytest.approx(78.48, rel=0.001)
    transforms = robot.frame_transforms(block.position[::100])
    children = [child for _, child in robot.mechanism.frames]
    arm = [
        world_of(robot.mechanism.frames, row)[children.index('arm')][1][2] for row in transforms
    ]
    assert arm == pytest.approx(0.6 + 2.0 * block.position[::100, 3])


PUBLISHED = {
    'panda': 'example-robot-data/robots/panda_description/urdf/panda.urdf',
    'baxter': 'example-robot-data/robots/baxter_description/urdf/baxter.urdf',
    'pr2': 'example-robot-data/robots/pr2_description/urdf/pr2.urdf',
    'tiago_pro': 'example-robot-data/robots/tiago_pro_description/robots/tiago_pro.urdf',
    'so101': 'example-robot-data/robots/so_arm_description/urdf/so101.urdf',
    'stretch': 'stretch_urdf/SE3/stretch_description_SE3_eoa_wrist_dw3_tool_sg3.urdf',
}
WITHOUT_MIMIC = ('so101', 'stretch')


def compare(pin: Any, model: Any, robot: TreeRobot, states: int) -> None:
    """Compare with mimic joints of Pinocchio at random states."""
    tip, draw = robot.moving[-1].child, np.random.default_rng(1)
    own = model_of(robot, robot.frames[tip].body)
    size, number = len(robot.joints), model.getFrameId(tip)
    select = np.zeros((model.nv, size))
    others = [model.joints[model.getJointId(joint.name)] for joint in robot.joints]
    assert model.nv == size
    for column, other in enumerate(others):
        select[other.idx_v, column] = 1.0
    for _ in range(states):
        position = draw.uniform(-1.5, 1.5, size)
        velocity, acceleration = draw.normal(size=(2, size))
        q = pin.neutral(model)
        for other, at in zip(others, position.tolist(), strict=True):
            q[other.idx_q:other.idx_q + other.nq] = (
                [np.cos(at), np.sin(at)] if other.nq == 2 else [at]
            )
        # The composite rigid body algorithm of Pinocchio 4.1 needs new data with mimic joints.
        data = model.createData()
        upper = np.triu(pin.crba(model, data, q))
        place = kinematics.place(own, 0.0, 0.0, 0.0, position, 0)
        of = own, place, robot.inertial_parameters.ravel()
        still = np.zeros(size)
        close(dynamics.inertia(*of), select.T @ (upper + np.triu(upper, 1).T) @ select)
        for v, a in ((still, still), (velocity, still), (velocity, acceleration)):
            expected = select.T @ pin.rnea(model, data, q, select @ v, select @ a)
            close(dynamics.inverse_dynamics(*of, v, v, a, GRAVITY), expected)
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacements(model, data)
        rotation, origin = frame_pose(own, place, 0)
        at = robot.frames[tip]
        close(np.array(origin), data.oMf[number].translation)
        turned = np.reshape(rotation, (3, 3)) @ np.reshape(at.rotation, (3, 3))
        close(turned, data.oMf[number].rotation)


@pytest.mark.slow
@pytest.mark.parametrize('name', PUBLISHED)
def test_published_robot_equals_pinocchio(name: str) -> None:
    pin = pytest.importorskip('pinocchio')
    path = resource_path(f'package://{PUBLISHED[name]}')
    robot = tree_robot(read_urdf(path.read_bytes(), str(path)), str(path))
    assert (len(robot.mimics) == 0) == (name in WITHOUT_MIMIC)
    compare(pin, pin.buildModelFromUrdf(str(path), mimic=True), robot, 100)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(SEED)
def test_mimic_random_tree_equals_pinocchio(seed: int) -> None:
    pin = pytest.importorskip('pinocchio')
    text = drawn(seed)
    robot = tree_robot(read_urdf(text, 'x'), 'x')
    whole, g, offsets = free(text, robot)
    model = pin.buildModelFromXML(re.sub('<mimic[^>]*>', '', text))
    rows = [model.joints[model.getJointId(joint.name)].idx_v for joint in whole.joints]
    draw = np.random.default_rng(seed)
    position, velocity, acceleration = draw.normal(size=(3, g.shape[1]))
    q, v, a = np.zeros((3, model.nv))
    q[rows], v[rows], a[rows] = g @ position + offsets, g @ velocity, g @ acceleration
    own = model_of(robot)
    place = kinematics.place(own, 0.0, 0.0, 0.0, position, 0)
    of = own, place, robot.inertial_parameters.ravel()
    upper = np.triu(pin.crba(model, model.createData(), q))
    whole_inertia = (upper + np.triu(upper, 1).T)[np.ix_(rows, rows)]
    close(dynamics.inertia(*of), g.T @ whole_inertia @ g)
    expected = g.T @ pin.rnea(model, model.createData(), q, v, a)[rows]
    close(dynamics.inverse_dynamics(*of, velocity, velocity, acceleration, GRAVITY), expected)
