# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Arcs: constant distance from their axis, from rest to rest."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

from helpers import small_tree
from helpers.robots import between, PROPERTY
from hypothesis import assume, given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.reference.arc import Arc
from masmc_ros.reference.trajectory import parameters, Trajectory
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

H = 1e-5
POINT = st.tuples(*[between(-1.0, 1.0)] * 3)
POSE = (0.9, 0.4, 0.8, 0.1, 0.2, 0.3)


@st.composite
def arcs(draw: st.DrawFn) -> dict[str, Any]:
    """Draw an arc of a pose with a start away from the axis."""
    normal, centre, start = draw(POINT), draw(POINT), draw(POINT)
    assume(np.linalg.norm(normal) > 0.1)
    assume(np.linalg.norm(np.cross(normal, np.subtract(start, centre))) > 0.1)
    return {
        'start': (*start, *draw(POINT)),
        'centre': centre,
        'normal': normal,
        'angle': draw(between(-7.0, 7.0)),
        'delay': draw(st.sampled_from((0.0, 0.7))),
        'duration': draw(between(0.5, 5.0)),
    }


def mechanism_of(*task: str) -> Mechanism:
    return tree_mechanism({**small_tree.parameters(), 'robot.task': task})


def turned(values: dict[str, Any], angle: float) -> Array:
    """Return the start rotated about the axis by NumPy's functions."""
    n = np.array(values['normal']) / np.linalg.norm(values['normal'])
    r = np.array(values['start'][:3]) - values['centre']
    along = n * (n @ r)
    circle = (r - along) * math.cos(angle) + np.cross(n, r) * math.sin(angle)
    rotated: Array = np.array(values['centre']) + along + circle
    return rotated


@PROPERTY
@given(arcs(), between(0.0, 1.0))
def test_arc_sample_is_start_rotated_about_axis(values: dict[str, Any], part: float) -> None:
    time = values['delay'] + part * values['duration']
    sample = Arc(values).sample(np.array([time]))[0]
    done = 10.0 * part**3 - 15.0 * part**4 + 6.0 * part**5
    assert sample[:3] == pytest.approx(turned(values, done * values['angle']), abs=1e-12)
    assert sample[3:6].tolist() == list(values['start'][3:])
    assert not sample[9:12].any()
    assert not sample[15:].any()


@PROPERTY
@given(arcs(), between(-0.3, 1.3))
def test_arc_velocities_and_accelerations_are_derivatives(
    values: dict[str, Any], part: float
) -> None:
    time = values['delay'] + part * values['duration']
    before, current, after = Arc(values).sample(np.array([time - H, time, time + H]))
    # The bound is the jerk of the profile and of the rotation at this distance from the axis.
    angle, duration = abs(values['angle']), values['duration']
    speed, change = 1.9 * angle / duration, 5.8 * angle / duration**2
    jerk = 4.0 * (60.0 * angle / duration**3 + 3.0 * speed * change + speed**3)
    velocity = (after[:3] - before[:3]) / (2.0 * H)
    acceleration = (after[6:9] - before[6:9]) / (2.0 * H)
    assert current[6:9] == pytest.approx(velocity, abs=H * H * jerk + 1e-9)
    assert current[12:15] == pytest.approx(acceleration, abs=H * jerk + 1e-9)


@PROPERTY
@given(arcs())
def test_arc_rests_at_both_ends(values: dict[str, Any]) -> None:
    start, end = values['delay'], values['delay'] + values['duration']
    samples = Arc(values).sample(np.array([0.0, start, end + 1e-9, 1e6]))
    assert samples[:2, :6].tolist() == [list(values['start'])] * 2
    assert samples[2:, :3] == pytest.approx(np.array([turned(values, values['angle'])] * 2))
    assert not samples[:, 6:].any()


@PROPERTY
@given(arcs(), st.lists(between(-1.0, 7.0), min_size=1, max_size=20))
def test_arc_single_samples_equal_samples_of_block(
    values: dict[str, Any], times: list[float]
) -> None:
    arc, at = Arc(values), np.array(times)
    single = np.vstack([arc.sample(at[k:k + 1]) for k in range(len(at))])
    assert arc.sample(at).tobytes() == single.tobytes()


def trajectory(task: Sequence[str], **given_: Any) -> Trajectory:
    mechanism = mechanism_of(*task)
    values = {p.name: p.default for p in mechanism.parameters}
    values |= {p.name: p.default for p in parameters(mechanism)}
    values |= {**small_tree.parameters(), 'robot.task': tuple(task), 'type': 'arc'}
    values |= {f'arc.{name}': value for name, value in given_.items()}
    return Trajectory(values, 0.01, robot_of(values))


def test_arc_moves_first_output_with_position() -> None:
    start = (0.3, 0.9, 0.4, 0.8)
    samples = trajectory(['heading', 'position'], start=start, duration=1.0).sample(0, 101)
    heading, x, y, z = samples[:, :4].T
    assert np.hypot(x, y) == pytest.approx(math.hypot(0.9, 0.4))
    assert np.ptp(x) > 1.0
    assert (heading == 0.3).all()
    assert (z == 0.8).all()


def test_arc_planar_task_has_no_normal() -> None:
    names = [p.name for p in parameters(mechanism_of('planar'))]
    assert 'arc.normal' not in names
    quarter = {'centre': (1.0, 0.0), 'angle': 0.5 * math.pi, 'duration': 1.0}
    last = trajectory(['planar'], start=(2.0, 0.0), **quarter).sample(100, 1)[0]
    assert last == pytest.approx([1.0, 1.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ('task', 'given_', 'words'),
    [
        (['joints'], {}, 'type = arc: a trajectory of x and y; .* turret_joint, lift_joint'),
        (['orientation'], {}, 'type = arc: a trajectory of x and y; .* rx_tip'),
        (['pose'], {'start': POSE, 'normal': (0.0, 0.0, 0.0)}, 'normal = .*: expected a dir'),
        (['pose'], {'start': (0.0, 0.0, *POSE[2:])}, 'on the axis of the circle'),
    ],
)
def test_arc_invalid_parameters_raise(task: list[str], given_: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        trajectory(task, **given_)
