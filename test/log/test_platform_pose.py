# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Logs of robots without platform joints: the pose follows from odometry."""

from __future__ import annotations

from collections.abc import Callable
import csv
from pathlib import Path
from typing import Any

from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import read_run
from masmc_ros.log.read.scan import scan
from masmc_ros.log.write.writer import LogWriter
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

PAPER = str(Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml')
STORE = get_typestore(Stores.ROS2_JAZZY)
STATE = 'sensor_msgs/msg/JointState'
ODOMETRY = 'nav_msgs/msg/Odometry'


@pytest.fixture(scope='module')
def computed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a log of two seconds with odometry at 100 Hz."""
    log = tmp_path_factory.mktemp('computed') / 'run.mcap'
    arguments = ['--set', 'duration=2.0', '--set', 'plant.odom_decimation=10']
    assert main(['simulate', PAPER, *arguments, '--output', str(log)]) == 0
    return log


def without_base_joints(
    log: Path, folder: Path, change: Callable[[Any], bool] = lambda _: True
) -> Path:
    """
    Return a log of the same run by a robot that publishes only its driven joints.

    `change` modifies every odometry message and returns True if it is kept.
    """
    path = folder / 'driven.mcap'
    with LogWriter(path) as writer:
        for topic in scan(log).topics.values():
            assert topic.schema is not None
            type_name = topic.schema.name
            channel = writer.channel(topic.name, type_name)
            for time, raw in zip(topic.log_times, topic.messages, strict=True):
                data = raw
                if type_name in (STATE, ODOMETRY):
                    message = STORE.deserialize_cdr(raw, type_name)
                    if type_name == ODOMETRY and not change(message):
                        continue
                    for field in ('name', 'position', 'velocity', 'effort') * (type_name == STATE):
                        setattr(message, field, getattr(message, field)[3:])
                    data = bytes(STORE.serialize_cdr(message, type_name))
                writer.write(channel, time, data)
    return path


def test_read_run_without_base_joints_uses_odometry(computed: Path, tmp_path: Path) -> None:
    run, known = read_run(without_base_joints(computed, tmp_path)), read_run(computed)
    assert np.array_equal(run.times, known.times)
    assert np.array_equal(run.position[:, 3:], known.position[:, 3:])
    assert np.array_equal(run.velocity[:, 3:], known.velocity[:, 3:])
    assert np.array_equal(run.applied_effort, known.applied_effort)
    # Extrapolated for up to 10 ms along the circle of the twist.
    assert np.abs(run.position[:, :3] - known.position[:, :3]).max() < 2e-3
    measured = slice(0, None, 10)
    assert np.abs(run.position[measured, :3] - known.position[measured, :3]).max() < 1e-12
    assert np.abs(run.velocity[measured, :3] - known.velocity[measured, :3]).max() < 1e-12


def test_read_run_odometry_before_reset_is_void(computed: Path, tmp_path: Path) -> None:
    """The odometry of the last pass starts a second after the states."""
    messages = sorted(
        (time, topic.name, raw)
        for topic in scan(without_base_joints(computed, tmp_path)).topics.values()
        for time, raw in zip(topic.log_times, topic.messages, strict=True)
        if topic.name in ('/joint_states', '/odom')
    )
    path = tmp_path / 'twice.mcap'
    with LogWriter(path) as log:
        channels = {
            '/joint_states': log.channel('/joint_states', STATE),
            '/odom': log.channel('/odom', ODOMETRY),
        }
        for is_last in (False, True):
            for time, name, raw in messages:
                if not (is_last and name == '/odom' and time < 10**9):
                    log.write(channels[name], time, raw)
    # A pose is used for 0.1 s before and after its stamp.
    assert read_run(path).times[0] == 0.9


def test_read_run_invalid_odometry_is_skipped(computed: Path, tmp_path: Path) -> None:
    def spoil(message: Any) -> bool:
        if message.header.stamp.nanosec == 500_000_000:
            message.pose.pose.position.x = float('nan')
        return True

    run, known = read_run(without_base_joints(computed, tmp_path, spoil)), read_run(computed)
    assert np.array_equal(run.times, known.times)
    assert np.abs(run.position - known.position).max() < 5e-3


def test_read_run_states_without_recent_odometry_are_dropped(
    computed: Path, tmp_path: Path
) -> None:
    def ends(message: Any) -> bool:
        return bool(message.header.stamp.sec == 0)

    run = read_run(without_base_joints(computed, tmp_path, ends))
    assert run.times[-1] == pytest.approx(0.99 + 0.1)

    def never(message: Any) -> bool:
        message.header.stamp.sec += 100
        return True

    with pytest.raises(InputError, match=r'/odom: nothing within 0\.1 s of a joint state'):
        read_run(without_base_joints(computed, tmp_path, never))
    with pytest.raises(InputError, match=r"joint 'base_x_joint' is missing"):
        read_run(without_base_joints(computed, tmp_path, lambda _: False))


@pytest.mark.slow
def test_report_log_without_base_joints_equals_complete_one(
    computed: Path, tmp_path: Path
) -> None:
    folder, log = tmp_path / 'report', without_base_joints(computed, tmp_path)
    assert main(['report', str(computed), str(log), '--output', str(folder)]) == 0
    with (folder / 'metrics.csv').open(encoding='utf-8') as file:
        known, row = csv.DictReader(file)
    names = [name for name in known if 'end_effector_rms' in name or 'platform_rms' in name]
    assert len(names) == 2
    for name in names:
        assert float(row[name]) == pytest.approx(float(known[name]), rel=0.01)
