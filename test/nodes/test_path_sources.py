# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Errors of three robots on a path from every source: those that the documentation states."""

from __future__ import annotations

from pathlib import Path
import re
from typing import NamedTuple

from helpers.followed import Array, Followed
from helpers.pages import DOCS, ROOT
from masmc_ros.aliases import Numbers
from masmc_ros.loop.scenario import Scenario
from masmc_ros.nodes.trajectory.path_messages import PathRequest
from masmc_ros.reference.joint_path import JointPoints
from masmc_ros.reference.pose_path import PosePoints, TwistPoints
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

PAGE = DOCS / 'guides' / 'paths_from_messages.md'

DURATION = 8.0
"""Time in s of each path."""

REST = 0.5
"""Time in s after the end of a path, and of the blend at its start."""

SETTLED = 8.0
"""Time in s at the start; the paper's robot starts 0.5 m away from its path."""

PLANE = ('x_E', 'y_E', 'x_F', 'y_F')
"""Task of the paper's robot; that of the others is a pose."""

Points = JointPoints | PosePoints | TwistPoints | Trajectory


class Followable(NamedTuple):
    """Robot, with the joints of a plan."""

    file: str
    settings: tuple[str, ...]
    columns: tuple[int, ...]
    """Of the plan, among the positions of a joint state."""
    changes: Numbers
    """Of these joints, rad or m."""


ROBOTS = {
    'paper': Followable(
        'paper.yaml',
        ('controller.switching=implicit', 'controller.observer_gain=0.55'),
        (0, 2, 5), (0.2, 0.2, 0.2),
    ),
    'TIAGo': Followable('tiago.yaml', (), (0, 2, 5, 7), (0.1, 0.2, 0.02, 0.2)),
    'UR5': Followable('ur5.yaml', (), (3, 5), (0.2, 0.2)),
}  # fmt: skip


def parameters(start: Array, file: Path) -> dict[str, dict[str, object]]:
    """Return the parameters of trajectories from a task position (axes), by type."""
    along, across = np.zeros((2, len(start)))
    along[0], across[1] = 0.06, 0.03
    corners = np.array([start, start + along, start + along + across, start + across, start])
    times = np.linspace(0.0, DURATION, len(corners)).tolist()
    file.write_text(f'times: {times}\npoints: {corners.tolist()}\n', encoding='utf-8')
    # Each path but the last one ends where it starts.
    moves = (along > 0.0).astype(float)
    sine = {
        'offset': start + along, 'amplitude': along,
        'frequency': 2.0 * np.pi / (DURATION + REST) * moves, 'phase': -0.5 * np.pi * moves,
    }  # fmt: skip
    is_flat = len(start) == len(PLANE)
    if is_flat:
        sine['slope'] = np.zeros(len(PLANE))
    eight = {'start': start, 'along': along, 'across': across, 'duration': DURATION}
    centre = (start + across)[:2 if is_flat else 3]
    return {
        'line_sine': sine,
        'waypoints': {'times': times, 'points': corners.ravel()},
        'arc': {'start': start, 'centre': centre, 'duration': DURATION},
        'figure_eight': eight,
        'rounded_polygon': {'corners': corners[:-1].ravel(), 'duration': DURATION},
        'file': {'path': str(file)},
        'set_point': {'start': start, 'goal': start + along},
    }


def of_joints(robot: Followable, position: Array) -> JointPoints:
    """Return a plan of some joints from the positions of a joint state, and partly back."""
    columns, times = np.array(robot.columns), np.array([0.5, 1.0]) * DURATION
    points = position[columns] + np.outer([1.0, 0.3], robot.changes)
    return JointPoints(columns, times, points, None, None)


def of_end_effector(position: Array, duration: float | None) -> PosePoints:
    """Return three poses near a task position (axes), or one without times."""
    place, turn = np.zeros((2, 3))
    if len(position) == len(PLANE):
        place[:2] = position[:2]
    else:
        place, turn = np.split(position, 2)
    points = place + np.array([[0.06, 0.03, 0.0], [0.0, 0.03, 0.0], [0.0, 0.0, 0.0]])
    times = None
    if duration is None:
        points = points[:1]
    else:
        times = duration * np.array([0.3, 0.6, 1.0])
    quaternions = np.tile(Rotation.from_rotvec(turn).as_quat(), (len(points), 1))
    return PosePoints(False, points, quaternions, times)


def of_base(position: Array) -> PosePoints:
    """Return a pose of the base 0.2 m ahead of the position of a joint state."""
    heading = position[2]
    place = position[:2] + 0.2 * np.array([np.cos(heading), np.sin(heading)])
    turn = Rotation.from_rotvec([0.0, 0.0, heading + 0.1]).as_quat()
    return PosePoints(True, np.append(place, 0.0)[None], turn[None], None)


def largest_error(loop: Followed, name: str, points: Points) -> float:
    """Follow a path to its end; return the largest error of the first output with a place in m."""
    before = len(loop.used)
    if isinstance(points, TwistPoints):
        for _ in range(round(DURATION / 0.2)):
            loop.take(PathRequest(name, points, None))
            loop.follow(0.2)
        loop.follow(1.5)
    else:
        loop.take(PathRequest(name, points, None))
        loop.follow(DURATION + REST)
    mechanism = loop.controller.mechanism
    axes = mechanism.places[0].axes
    way = np.ptp(np.array(loop.used)[before:, axes], axis=0)
    assert np.linalg.norm(way) > 0.05, name
    return float(np.linalg.norm(loop.errors()[before:, axes], axis=1).max())


def stated(robot: str) -> dict[str, float]:
    """Return the errors in m of the table in the documentation, by source."""
    heads = ' | '.join(('path', *ROBOTS))
    table = PAGE.read_text(encoding='utf-8').split(f'| {heads} |')[1].split('\n\n')[0]
    column = list(ROBOTS).index(robot)
    cells = {
        source: row.split('|')[column].strip()
        for source, row in re.findall(r'^\| `(\w+)`[^|]*\|(.*)\|$', table, re.MULTILINE)
    }
    return {source: 1e-3 * float(cell) for source, cell in cells.items() if cell}


@pytest.mark.slow
@pytest.mark.parametrize('name', ROBOTS)
def test_path_of_every_source_has_the_stated_error(name: str, tmp_path: Path) -> None:
    robot = ROBOTS[name]
    if name != 'paper':
        pytest.importorskip('pinocchio')
    scenario = load_scenario(str(ROOT / 'config' / robot.file), robot.settings)
    values = {
        node: {**scenario[node], 'pacing': 'realtime', 'duration': 0.0}
        for node in ('plant', 'trajectory', 'controller')
    }
    own = values['trajectory']
    own['path_jerk'] = 2.0
    controlled = robot_of(values['controller'])
    period = own['control_period']
    start = Trajectory(own, period, controlled).sample(0, 1)[0]
    start = start[:len(controlled.mechanism.axes)]
    # Until the robot is on its path, the reference rests.
    own.update({'type': 'waypoints', 'waypoints.times': [0.0], 'waypoints.points': start.tolist()})
    loop = Followed(Scenario(**values))
    loop.follow(SETTLED)
    errors: dict[str, float] = {}
    for kind, settings in parameters(start, tmp_path / 'points.yaml').items():
        chosen = {f'{kind}.{key}': value for key, value in settings.items()}
        trajectory = Trajectory({**own, 'type': kind, **chosen}, period, controlled)
        errors[kind] = largest_error(loop, kind, trajectory)
    for topic, path in (
        ('joint_trajectory', lambda: of_joints(robot, loop.plant.position)),
        ('path', lambda: of_end_effector(loop.used[-1][:len(start)], DURATION)),
        ('goal', lambda: of_end_effector(loop.used[-1][:len(start)], None)),
        ('base_goal', lambda: of_base(loop.plant.position)),
        ('cmd_vel', lambda: TwistPoints(0.05, 0.0, 0.05)),
    ):
        if controlled.mechanism.is_planar or topic not in ('base_goal', 'cmd_vel'):
            errors[topic] = largest_error(loop, topic, path())
    assert [text for _, text in loop.reports] == ['active']
    assert errors == pytest.approx(stated(name), rel=0.05)
