# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Poses of frames in other frames, compared with homogeneous matrices."""

from __future__ import annotations

from helpers.robots import Array, PROPERTY
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.messages.transforms import FrameTree, moved, TransformsCdr
import numpy as np
import pytest


def homogeneous(pose: Array) -> Array:
    """Return the matrix (4, 4) of a pose, by Rodrigues' formula."""
    x, y, z, w = pose[3:]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(4)
    matrix[:3, :3] += 2.0 * w * cross + 2.0 * cross @ cross
    matrix[:3, 3] = pose[:3]
    return matrix


def message(*edges: tuple[str, str], poses: Array) -> bytes:
    return TransformsCdr('', edges).fill(0, np.atleast_2d(poses))


def random_poses(seed: int, count: int) -> Array:
    draws = np.random.default_rng(seed).standard_normal((count, 7))
    draws[:, 3:] /= np.linalg.norm(draws[:, 3:], axis=1, keepdims=True)
    return draws


@PROPERTY
@given(st.integers(0, 2**32), st.lists(st.integers(0, 5), min_size=1, max_size=6))
def test_pose_of_frame_equals_product_of_matrices(seed: int, above: list[int]) -> None:
    """Frame k + 1 is below one of the frames before it."""
    parents = [min(parent, k) for k, parent in enumerate(above)]
    poses = random_poses(seed, len(parents))
    tree, world = FrameTree(), [np.eye(4)]
    for k, (parent, pose) in enumerate(zip(parents, poses, strict=True)):
        raw = message((f'frame{parent}', f'/frame{k + 1}'), poses=pose)
        tree.add(raw, is_static=k % 2 == 0)
        world.append(world[parent] @ homogeneous(pose))
    for first in range(len(world)):
        for second in range(len(world)):
            found = tree.pose(f'frame{first}', f'frame{second}')
            assert found is not None
            expected = np.linalg.solve(world[second], world[first])
            assert homogeneous(found) == pytest.approx(expected, abs=1e-12)


def test_many_poses_are_moved_like_each_one() -> None:
    transform, *others = random_poses(0, 5)
    expected = [homogeneous(transform) @ homogeneous(other) for other in others]
    found = [homogeneous(pose) for pose in moved(transform, np.array(others))]
    assert found == pytest.approx(np.array(expected), abs=1e-12)


def test_unknown_forgotten_and_looping_frames_have_no_pose() -> None:
    tree = FrameTree()
    pose = random_poses(0, 1)
    tree.add(message(('map', 'odom'), poses=pose), is_static=False)
    assert tree.pose('map', 'odom') is not None
    assert tree.pose('map', 'base_link') is None
    tree.add(message(('odom', 'map'), poses=pose), is_static=False)
    assert tree.pose('map', 'base_link') is None
    tree.forget_moving()
    assert tree.pose('map', 'odom') is None
