# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Errors of poses: distances in x, y and z, and rotations, in every place that states them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from helpers.log_contents import read_log
from helpers.small_tree import hand_at_start, write_scenario
import masmc_ros as masmc
from masmc_ros.campaign.campaign import campaign_of
from masmc_ros.campaign.runs import rows
from masmc_ros.cli.main import main
from masmc_ros.compare.law_comparison import Row
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.report.measure.metrics import Metrics, metrics, MetricSamples
from masmc_ros.report.measure.parameters import run_robot
from masmc_ros.report.measure.table import distances_note
from masmc_ros.report.measure.tracking import tracking
from masmc_ros.report.panels import path_panel
from masmc_ros.robot.declaration import Point
from masmc_ros.robot.mechanisms import DEFAULT
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

TIP = Point('T', 'tip', 'tip', 'the tip', 0, 3)
TURN = Point(
    'R', 'orientation_of_tip', 'orientation of tip', 'the orientation of the tip', 3, 3, 'rad',
    is_place=False, is_rotation=True,
)  # fmt: skip


def test_metrics_of_pose_are_distance_in_space_and_angle() -> None:
    error = np.tile([0.0, 3.0, 4.0, 0.0, 0.6, 0.8], (10, 1))
    reached = MetricSamples.of_ticks(error, np.zeros((10, 2)), 0.1, (TIP, TURN)).metrics()
    assert reached.of('tip').rms == reached.of('tip').largest == 5.0
    assert reached.of('orientation_of_tip').rms == pytest.approx(1.0, rel=1e-15)


def test_note_of_errors_names_axes_and_angles() -> None:
    assert distances_note(DEFAULT.points) == (
        'E and F: distance of the end effector and of the platform point F from the reference in '
        'x and y.'
    )
    assert distances_note((TIP, TURN)) == (
        'T: distance of the tip from the reference in x, y and z. '
        'R: angle of the orientation of the tip from the reference, by its sine as in laws.'
    )


def test_ranking_error_has_unit_of_first_point() -> None:
    """A distance and an angle have no sum."""
    row = Row({'m': 2.0, 'rad': 7.0}, {'tip': 2.0, 'turn': 7.0}, 2.0, 3.0, {}, 1, 0)
    assert row.error == row.numbers()['error'] == 2.0


class Computed(NamedTuple):
    """Scenario of the hand of the small robot, and its logged run."""

    file: Path
    run: Run


@pytest.fixture(scope='module')
def computed(tmp_path_factory: pytest.TempPathFactory) -> Computed:
    """Return a run whose hand is 0.1 m above the start of its path, and turned."""
    folder = tmp_path_factory.mktemp('space')
    above = hand_at_start()
    above[2] += 0.1
    file = write_scenario(folder, above, 0.4)
    log = folder / 'run.mcap'
    assert main(['simulate', str(file), '--output', str(log)]) == 0
    return Computed(file, read_run(log))


def norms(error: np.ndarray) -> tuple[float, float]:
    """Return the RMS distance in m and angle in rad of errors (n, 6)."""
    distance, angle = (np.linalg.norm(part, axis=1) for part in (error[:, :3], error[:, 3:]))
    return float(np.sqrt((distance**2).mean())), float(np.sqrt((angle**2).mean()))


def rms(values: Metrics) -> tuple[float | None, float | None]:
    """Return the RMS values of both points."""
    return values.of('tip').rms, values.of('orientation_of_tip').rms


@pytest.mark.slow
def test_report_run_and_campaign_state_height_and_rotation(computed: Computed) -> None:
    published = computed.run.telemetry['error']
    time = published.times - published.times[0]
    window = (time[-1] / 2 <= time) & (time < time[-1])
    expected = pytest.approx(norms(published.values[window]), rel=1e-12)
    assert np.abs(published.values[window, 2]).max() > 1e-3  # height counts
    logged = rms(metrics(computed.run))
    assert logged == expected
    assert rms(masmc.simulate(computed.file).metrics) == logged
    row = rows(campaign_of(str(computed.file)), 0, 1)
    assert (row['tip_rms'][0], row['orientation_of_tip_rms'][0]) == logged


@pytest.mark.slow
def test_compare_states_rotation_apart(computed: Computed, tmp_path: Path) -> None:
    folder = tmp_path / 'out'
    options = ['--laws', 'rasmc,smc', '--trials', 'half model', '--output', str(folder)]
    assert main(['compare', str(computed.file), *options]) == 0
    for row in json.loads((folder / 'compare.json').read_text(encoding='utf-8')):
        assert row['error'] == row['tip_rms'] != row['orientation_of_tip_rms']
    text = (folder / 'compare.txt').read_text(encoding='utf-8')
    page = (folder / 'compare.html').read_text(encoding='utf-8')
    for head in ('RMS error of T, mm', 'RMS error of R, mrad'):
        assert head in text
        assert head in page


@pytest.mark.slow
def test_paths_of_pose_have_its_height(computed: Computed) -> None:
    contents = read_log(computed.run.path)
    store = get_typestore(Stores.ROS2_JAZZY)
    position = computed.run.position
    height = run_robot(computed.run).task_positions(position)[:, 2]
    for name, heights in (('path/actual', height), ('path/desired', computed.run.reference[:, 2])):
        raw = contents.messages[name][-1]
        poses = store.deserialize_cdr(raw, 'nav_msgs/msg/Path').poses
        ticks = [round(1e3 * p.header.stamp.sec + 1e-6 * p.header.stamp.nanosec) for p in poses]
        assert len(ticks) > 5
        assert [p.pose.position.z for p in poses] == heights[ticks].tolist()
    panel = path_panel(computed.run, tracking(computed.run))
    assert panel.title == 'Paths in top view, without z'
