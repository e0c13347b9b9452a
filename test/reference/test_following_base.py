# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Base that follows a path of the end effector: tractrix, reach, smoothness, files and runs."""

from __future__ import annotations

import json
from pathlib import Path

from helpers.robots import between, DEFAULT
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.reference.following_base import _tractrix, follow_tip
from masmc_ros.reference.minimum_jerk import sample_knots, smooth_knots
from masmc_ros.reference.path_file import PathFile
from masmc_ros.reference.trajectory import parameters, Trajectory
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

ROBOT = robot_of({f'robot.{name}': value for name, value in DEFAULT.items()})
LEAST, MOST = 0.514 - 0.362, 0.514 + 0.362
TIPS = 'time_s,x_E_m,y_E_m\n0,0.3,0.5\n6,1.5,0.8\n12,1.2,-0.6\n16,0.4,0.0\n'


@st.composite
def tip_paths(draw: st.DrawFn) -> tuple[Array, Array]:
    """Return times (n) and knots (n, 12) of a path of E; those of F are noise."""
    count = draw(st.integers(1, 6))
    times = np.cumsum([draw(between(1.0, 6.0)) for _ in range(count)])
    points = np.zeros((count, 4))
    points[:, :2] = np.reshape([draw(between(-1.0, 1.0)) for _ in range(2 * count)], (-1, 2))
    points[:, 2:] = draw(between(-5.0, 5.0))
    knots = np.hstack([points, np.zeros((count, 8))])
    smooth_knots(times, knots)
    return times, knots


def test_curve_is_the_tractrix() -> None:
    """From (a, 0), pulled from the origin along y: x = a sech(s/a), y = s - a tanh(s/a)."""
    way = np.linspace(0.0, 2.0, 20_001)
    length = 0.6
    path = np.column_stack([np.zeros_like(way), way])
    curve = _tractrix(path, np.array([length, 0.0]), 0.1, length)
    x, y = length / np.cosh(way / length), way - length * np.tanh(way / length)
    assert np.abs(curve - np.column_stack([x, y])).max() < 1e-4


@given(path=tip_paths())
def test_base_keeps_the_tip_in_reach_and_its_path(path: tuple[Array, Array]) -> None:
    times, knots = path
    union, whole = follow_tip(ROBOT, times, knots)
    at = np.unique(np.concatenate([np.linspace(times[0], times[-1], 2000), times]))
    samples, before = sample_knots(union, whole, at), sample_knots(times, knots, at)
    tips = [0, 1, 4, 5, 8, 9]
    # Rounding in a piece of 1 ms.
    changes = np.abs(samples[:, tips] - before[:, tips]).max(axis=0)
    assert (changes < [1e-12, 1e-12, 1e-9, 1e-9, 1e-6, 1e-6]).all()
    assert (whole[np.isin(union, times)][:, tips] == knots[:, tips]).all()
    distance = np.linalg.norm(samples[:, :2] - samples[:, 2:4], axis=1)
    assert distance.min() > LEAST + 0.02
    assert distance.max() < MOST - 0.02
    # It starts and ends at rest, and positions, velocities and accelerations belong together.
    assert not samples[[0, -1]][:, [6, 7, 10, 11]].any()
    for order in (0, 4):
        steps = np.diff(at)[:, None]
        values, rates = samples[:, order + 2:order + 4], samples[:, order + 6:order + 8]
        change = np.diff(values, axis=0) - 0.5 * steps * (rates[1:] + rates[:-1])
        assert np.abs(change).max(initial=0.0) < 1e-3 * max(1.0, np.abs(rates).max())


def test_base_rests_while_the_tip_is_near() -> None:
    times = np.array([0.0, 4.0])
    knots = np.zeros((2, 12))
    knots[:, :2] = (0.5, 0.0), (0.5, 0.2)
    union, whole = follow_tip(ROBOT, times, knots, np.zeros(4))
    assert not whole[:, [2, 3, 6, 7, 10, 11]].any()
    assert len(union) > 2


@pytest.mark.parametrize('suffix', ['csv', 'yaml'])
def test_file_without_base_is_that_of_waypoints_without_it(tmp_path: Path, suffix: str) -> None:
    rows = [[float(cell) for cell in line.split(',')] for line in TIPS.split()[1:]]
    file = tmp_path / f'tips.{suffix}'
    if suffix == 'csv':
        file.write_text(TIPS)
    else:
        times, points = [row[0] for row in rows], [row[1:] for row in rows]
        file.write_text(f'axes: [x_E, y_E]\ntimes: {times}\npoints: {points}\n')
    values = {p.name: p.default for p in parameters(TWO_LINK)}
    of_file = Trajectory({**values, 'type': 'file', 'file.path': str(file)}, 0.01, ROBOT)
    points = {
        'type': 'waypoints',
        'waypoints.base_follows': True,
        'waypoints.times': tuple(row[0] for row in rows),
        'waypoints.points': tuple(number for row in rows for number in row[1:]),
    }
    of_points = Trajectory({**values, **points}, 0.01, ROBOT)
    assert np.abs(of_file.sample(0, 1800) - of_points.sample(0, 1800)).max() < 1e-12
    assert of_file.note == of_points.note
    assert of_file.note.startswith('the path lacks x_F, y_F, so the base follows')


def test_file_with_one_coordinate_of_the_base_is_rejected(tmp_path: Path) -> None:
    file = tmp_path / 'tips.csv'
    file.write_text('time_s,x_E_m,y_E_m,x_F_m\n0,0.3,0.5,0.0\n')
    with pytest.raises(InputError, match=r'no column y_F_m; expected columns time_s, x_E_m'):
        PathFile.of({'path': str(file), 'stops': False}, TWO_LINK)


def test_run_along_path_of_the_tip_names_what_it_assumes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'tips.csv'
    file.write_text(TIPS)
    settings = [
        'duration=18.0', 'controller.switching=implicit', 'controller.observer_gain=0.55'
    ]
    arguments = [word for setting in settings for word in ('--set', setting)]
    assert main(['simulate', 'paper', '--path', str(file), '--json', *arguments]) == 0
    seen = capsys.readouterr()
    assert 'the base follows the end effector' in seen.err
    (row,) = json.loads(seen.out)['runs']
    assert row['end_effector_rms'] < 3e-5
