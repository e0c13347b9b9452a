# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Trajectory node: windows before its start, and too many of them."""

from __future__ import annotations

import itertools
from pathlib import Path

from helpers.processes import peer, processes, ros_arguments
from masmc_ros.messages.platform_messages import OdometryCdr
from masmc_ros.messages.reference_window import ReferenceWindow
from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray


def test_trajectory_robot_before_start_time_windows_sent_once(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        raw = tester.collect(Float64MultiArray, 'reference', raw=True)
        node = started.start('trajectory', *ros_arguments(None, start_time=5.0, duration=0.0))
        publisher = tester.publisher(Odometry, 'odom')
        tester.wait_for_subscribers(publisher)
        odometry = OdometryCdr('', 'base_link')
        starts: list[int] = []
        ticks = itertools.count(0, 20)

        def has_advanced() -> bool:
            odometry.set_stamp(next(ticks) * 10_000_000)
            publisher.publish(odometry.to_bytes())
            starts[:] = [ReferenceWindow.from_bytes(message).stamp_ns or 0 for message in raw]
            return bool(starts) and starts[-1] > 8_000_000_000

        tester.until(has_advanced, 'windows after the start')
        assert starts[0] == 5_000_000_000
        assert len(set(starts)) == len(starts)
        assert not node.logged('INFO', 'set back')


def test_trajectory_too_many_windows_prints_error(tmp_path: Path) -> None:
    arguments = ros_arguments(None, horizon=10.0, window=0.002, control_period=0.001)
    with processes(tmp_path) as started:
        started.start('trajectory', *arguments)
        assert started.wait() == {'trajectory': 2}
        assert 'window = 0.002: 5000 windows ahead; expected at most 500' in started.output()
