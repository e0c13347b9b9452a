# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Frames of the robot: transforms equal the kinematics of the state at any seek time."""

from __future__ import annotations

from bisect import bisect_right
from pathlib import Path

from helpers.robots import Array, between, DEFAULT, Machine, machines, PROPERTY, task_positions
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.robot.mechanisms import check_frame_prefix
from masmc_ros.robot.robot import Robot
from masmc_ros.robot.tree.frames import world_of
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
from masmc_ros.robot.two_link.frames import (
    frame_origins,
    frame_transforms,
)
from masmc_ros.robot.two_link.paper_robot import FRAMES, TWO_LINK
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

PAPER = Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml'
POSITION = st.tuples(between(-50.0, 50.0), between(-50.0, 50.0), *[between(-9.0, 9.0)] * 5)


def matrix(translation: Array, quaternion: Array) -> Array:
    """Return the 4 x 4 transform of a quaternion x, y, z, w and a translation."""
    x, y, z, w = quaternion
    assert np.isclose(np.dot(quaternion, quaternion), 1.0, rtol=0.0, atol=1e-14)
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = translation
    return out


def chained(transforms: dict[str, tuple[str, Array]], frame: str) -> Array:
    """Return the pose of a frame in the root frame."""
    if frame not in transforms:
        return np.eye(4)
    parent, place = transforms[frame]
    return np.asarray(chained(transforms, parent) @ place)


@PROPERTY
@given(machines(), POSITION)
def test_frame_transforms_chained_equal_kinematics(
    machine: Machine, position: tuple[float, ...]
) -> None:
    lengths = np.array(machine.geometry)
    states = np.array([np.zeros(7), position])
    rows = frame_transforms(frame_origins(lengths), states)[1]
    transforms = {
        child: (parent, matrix(row[:3], row[3:]))
        for (parent, child), row in zip(FRAMES, rows, strict=True)
    }
    task = task_positions(lengths, states)[1]
    tip, arm = chained(transforms, 'end_effector'), chained(transforms, 'link_1')
    np.testing.assert_allclose(tip[:2, 3], task[:2], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(arm[:2, 3], task[2:], rtol=0.0, atol=1e-12)
    robot = Robot(TWO_LINK, {}, lengths, np.array(machine.theta))
    assert np.isclose(tip[2, 3], robot.height, rtol=1e-14)
    # The end effector points along link 2; a wheel that turns forward carries its top forward.
    heading = position[2] + position[5] + position[6]
    np.testing.assert_allclose(tip[:2, 0], [np.cos(heading), np.sin(heading)], atol=1e-13)
    top = transforms['wheel_left'][1] @ np.array([0.0, 0.0, 1.0, 0.0])
    expected = [np.sin(position[4]), 0.0, np.cos(position[4])]
    np.testing.assert_allclose(top[:3], expected, atol=1e-13)


@pytest.mark.parametrize('prefix', ['', 'left/'])
def test_logged_frames_any_seek_time_match_latest_state(tmp_path: Path, prefix: str) -> None:
    """A third-party reader decodes the log with the definitions in the file."""
    log = tmp_path / 'run.mcap'
    settings = ['--set', 'duration=1.2', '--set', f"frame_prefix='{prefix}'"]
    assert main(['simulate', str(PAPER), '--output', str(log), *settings]) == 0
    messages_by_topic: dict[str, list[tuple[int, object]]] = {'/tf': [], '/joint_states': []}
    with AnyReader([log]) as reader:
        connections = [c for c in reader.connections if c.topic in messages_by_topic]
        for connection, time, raw in reader.messages(connections=connections):
            message = reader.deserialize(raw, connection.msgtype)
            messages_by_topic[connection.topic].append((time, message))
    times = {
        topic: [time for time, _ in messages] for topic, messages in messages_by_topic.items()
    }
    lengths = np.array(Machine(DEFAULT).geometry)
    random = np.random.default_rng(0)
    seeks = [0, 1_200_000_000, *random.integers(0, 1_300_000_000, 300).tolist()]
    for seek in seeks:
        latest = {
            topic: messages[bisect_right(times[topic], seek) - 1][1]
            for topic, messages in messages_by_topic.items()
        }
        transforms, state = latest['/tf'].transforms, latest['/joint_states']
        tree = {}
        for transform in transforms:
            assert transform.header.stamp == state.header.stamp
            t, q = transform.transform.translation, transform.transform.rotation
            place = matrix(np.array([t.x, t.y, t.z]), np.array([q.x, q.y, q.z, q.w]))
            tree[transform.child_frame_id] = (transform.header.frame_id, place)
        assert {frame for frame in tree if not frame.startswith(prefix)} == set()
        assert tree[f'{prefix}base_link'][0] == f'{prefix}odom'
        task = task_positions(lengths, state.position[None])[0]
        tip = chained(tree, f'{prefix}end_effector')
        np.testing.assert_allclose(tip[:2, 3], task[:2], rtol=0.0, atol=1e-9)
        arm = chained(tree, f'{prefix}link_1')
        np.testing.assert_allclose(arm[:2, 3], task[2:], rtol=0.0, atol=1e-9)
        x, y, yaw = state.position[:3]
        base = tree[f'{prefix}base_link'][1]
        np.testing.assert_allclose(base[:3, 3], [x, y, 0.0], rtol=0.0, atol=0.0)
        np.testing.assert_allclose(base[:2, 0], [np.cos(yaw), np.sin(yaw)], atol=1e-12)


@pytest.mark.parametrize(('kind', 'axis'), [('prismatic', '0 0 1'), ('revolute', '0.6 0 0.8')])
def test_tree_frames_held_joint_above_base_equal_dynamics(kind: str, axis: str) -> None:
    """The links above the base frame are where the model of the dynamics has them."""
    links = ''.join(f'<link name="{name}"/>' for name in ('root', 'mast', 'base_link'))
    joints = (
        ('mount', 'fixed', 'root', 'mast', '0.1 0.2 0.5'),
        ('lift', kind, 'mast', 'base_link', '-0.2 0 0.1'),
        ('turret_joint', 'revolute', 'root', 'turret', '0 0.1 0.2'),
    )
    inertia = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
    links += f'<link name="turret"><inertial><mass value="2"/>{inertia}</inertial></link>'
    links += ''.join(
        f"""<joint name="{name}" type="{type_}"><parent link="{parent}"/><child link="{child}"/>
        <origin xyz="{xyz}" rpy="0.3 -0.2 0.5"/><axis xyz="{axis}"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
        for name, type_, parent, child, xyz in joints
    )
    mechanism = tree_mechanism(
        {
            'robot.urdf': f'<robot name="r">{links}</robot>',
            'robot.base_frame': 'base_link',
            'robot.held_joints': ('lift',),
            'robot.held_positions': (0.3,),
            'robot.task': ('joints',),
        }
    )
    formulas = mechanism.formulas
    rows = formulas.frame_transforms(formulas.frame_origins(np.zeros(0)), np.zeros((1, 4)))[0]
    children = [child for _, child in mechanism.frames]
    places = dict(zip(children, world_of(mechanism.frames, rows), strict=True))
    for link in ('base_link', 'mast', 'root'):
        frame, (rotation, offset) = mechanism.robot.frames[link], places[link]
        np.testing.assert_allclose(rotation.ravel(), frame.rotation, rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(offset, frame.offset, rtol=0.0, atol=1e-14)
    expected = mechanism.robot.tree.offset[1]
    np.testing.assert_allclose(places['turret'][1], expected, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize('prefix', ['/left/', 'my robot/', 'left\n', '\x00'])
def test_frame_prefix_invalid_for_tf2_is_rejected(
    prefix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InputError, match='frame_prefix'):
        check_frame_prefix(prefix)
    if prefix.startswith('/'):
        log = tmp_path / 'run.mcap'
        arguments = ['simulate', str(PAPER), '--set', f'frame_prefix={prefix}', '--output']
        assert main([*arguments, str(log)]) == 2
        assert capsys.readouterr().err.count('\n') == 1
        assert list(tmp_path.iterdir()) == []
