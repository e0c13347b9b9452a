# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Rotation vectors of quaternions, and waypoints whose orientations are quaternions."""

from __future__ import annotations

import math

from helpers import small_tree
from helpers.robots import between, PROPERTY
from hypothesis import assume, given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.reference.rotations import rotation_vectors
from masmc_ros.reference.trajectory import parameters
from masmc_ros.reference.waypoints import Waypoints
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

POSE = tree_mechanism({**small_tree.parameters(), 'robot.task': ('pose',)})


@st.composite
def unit_quaternions(draw: st.DrawFn) -> Array:
    """Draw a quaternion x, y, z, w."""
    numbers = np.array(draw(st.tuples(*[between(-1.0, 1.0)] * 4)))
    assume(np.linalg.norm(numbers) > 0.1)
    unit: Array = numbers / np.linalg.norm(numbers)
    return unit


def quaternion_of(vector: Array) -> Array:
    """Return the quaternion of a rotation vector, by NumPy's functions."""
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle else vector
    return np.append(math.sin(0.5 * angle) * axis, math.cos(0.5 * angle))


@PROPERTY
@given(unit_quaternions())
def test_rotation_vector_of_both_signs_is_the_rotation(quaternion: Array) -> None:
    both = rotation_vectors(np.array([quaternion, -quaternion]))
    # The sign of a half turn is free.
    assume(abs(quaternion[3]) > 1e-9)
    assert both[0].tolist() == both[1].tolist()
    assert np.linalg.norm(both[0]) <= math.pi + 1e-12
    assert abs(quaternion_of(both[0]) @ quaternion) == pytest.approx(1.0, abs=1e-12)


def test_waypoints_of_quaternions_turn_on_without_unwinding() -> None:
    turns = np.linspace(0.0, 4.0 * math.pi, 13)
    axis = np.array([0.6, 0.0, 0.8])
    quaternions = np.array([quaternion_of(turn * axis) for turn in turns])
    quaternions[::2] *= -1.0  # the same orientations
    way = Waypoints.of(
        {
            'times': tuple(range(13)), 'points': (0.1, 0.2, 0.3) * 13, 'stops': False,
            'quaternions': tuple(quaternions.ravel()),
        },
        POSE,
    )  # fmt: skip
    samples = way.sample(np.arange(13.0))
    assert samples[:, :3] == pytest.approx(np.tile([0.1, 0.2, 0.3], (13, 1)))
    steps = np.diff(samples[:, 3:6], axis=0)
    # From the first point on each step is a twelfth of both turns, about the axis.
    assert steps[1:] == pytest.approx(np.tile(4.0 * math.pi / 12.0 * axis, (11, 1)), abs=1e-9)


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'quaternions': (0.0, 0.0, 0.0)}, '3 numbers; expected 4, x, y, z, w for each of 1'),
        ({'quaternions': (0.0,) * 4}, 'waypoint 1 has a quaternion of length 0'),
        ({'points': (0.0,) * 6}, '6 numbers; expected 3, for each of 1 times one of x_tip'),
    ],
)
def test_waypoints_of_wrong_quaternions_raise(changes: dict[str, object], words: str) -> None:
    values = {p.name.removeprefix('waypoints.'): p.default for p in parameters(POSE)
              if p.name.startswith('waypoints.')}  # fmt: skip
    values |= {'points': (0.0,) * 3, 'quaternions': (0.0, 0.0, 0.0, 1.0), **changes}
    with pytest.raises(InputError, match=words):
        Waypoints.of(values, POSE)
