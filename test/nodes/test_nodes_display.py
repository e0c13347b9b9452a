# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Display topics: robot description, paths and frames for viewers that join late."""

from __future__ import annotations

import os
from pathlib import Path as File
import signal
import sys

from helpers.processes import BOUNDED, PAPER, peer, processes, ros_arguments
from helpers.state_transforms import StateTransforms
from masmc_ros.robot.robot import robot_description
from masmc_ros.scenario.scenario import load_scenario
from nav_msgs.msg import Path
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger


def stamp(message: Path, pose: int | None = None) -> int:
    """Return the stamp in ns of a path or of one of its poses."""
    header = message.header if pose is None else message.poses[pose].header
    return int(header.stamp.sec * 10**9 + header.stamp.nanosec)


def test_display_late_joining_viewer_gets_robot_and_paths(tmp_path: File) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        run = started.start(
            'composed',
            *ros_arguments(
                duration=0.0,
                frame_prefix='left/',
                plant__pacing='realtime',
                plant__wait_for='[controller, trajectory]',
                trajectory__window=0.2,
                trajectory__horizon=0.4,
                **BOUNDED,
            ),
        )
        driven = tester.collect(Path, 'path/actual')
        tester.until(lambda: driven and stamp(driven[-1]) >= 1_000_000_000, 'a second of path')
        # The description and the desired path were published before.
        described = tester.collect(String, 'robot_description')
        desired = tester.collect(Path, 'path/desired')
        tester.until(lambda: described and desired, 'latched messages')
        assert len(described) == 1
        values = load_scenario(str(PAPER), ['frame_prefix=left/'])['plant']
        assert described[0].data == robot_description(values, 'left/')
        first = desired[0]
        tester.until(lambda: stamp(desired[-1]) >= stamp(first) + 500_000_000, 'a later piece')
        for path in (*desired, *driven):
            assert path.header.frame_id == 'left/odom'
            assert {pose.header.frame_id for pose in path.poses} == {'left/odom'}
        for piece in desired:
            # The desired path is ahead of the robot's time by about the horizon.
            assert stamp(piece, -1) > stamp(piece)
        for path in driven:
            assert stamp(path, -1) == stamp(path)
            assert stamp(path, 0) == 0
        count = len(driven)
        assert tester.call(Trigger, 'plant/reset', Trigger.Request(), again=False).success
        new = tester.until(lambda: [p for p in driven[count:] if stamp(p) == 0], 'the new path')
        assert len(new[0].poses) == 1
        run.signal(signal.SIGINT)
        assert started.wait() == {'composed': 0}, started.output()


@pytest.mark.slow
def test_display_tf2_msgs_installed_frames_published(tmp_path: File) -> None:
    """PyPI has no tf2_msgs; another type replaces it, because the messages are raw bytes."""
    package = tmp_path / 'tf2_msgs'
    package.mkdir()
    (package / '__init__.py').touch()
    (package / 'msg.py').write_text('from std_msgs.msg import String as TFMessage\n')
    settings = ['duration=0.3', 'frame_prefix=left/', 'plant.tf_decimation=7']
    with processes(tmp_path) as started, peer(started.domain) as tester:
        frames = tester.collect(String, '/tf', raw=True)
        states = tester.collect(JointState, 'joint_states', raw=True)
        started.start(
            'composed',
            *ros_arguments(
                duration=0.3,
                frame_prefix='left/',
                plant__tf_decimation=7,
                plant__wait_for='[controller, trajectory, peer]',
            ),
            environment={'PYTHONPATH': os.pathsep.join([str(tmp_path), *sys.path])},
        )
        tester.until(lambda: len(states) == 301, 'every state')
        transforms = StateTransforms(load_scenario(str(PAPER), settings)['plant'])
        expected = [tf for raw in states if (tf := transforms.of_state(raw)) is not None]
        tester.until(lambda: len(frames) == len(expected), 'all frames')
        assert len(expected) == 44
        assert frames == expected
        assert started.wait() == {'composed': 0}, started.output()


@pytest.mark.parametrize('node', ['plant', 'trajectory'])
def test_frame_prefix_invalid_for_tf2_rejected(tmp_path: File, node: str) -> None:
    with processes(tmp_path) as started:
        rejected = started.start(node, *ros_arguments(frame_prefix='/left'))
        assert rejected.wait() == 2, started.output()
        assert [line for line in rejected.stderr() if 'frame_prefix' in line] == rejected.stderr()
        assert len(rejected.stderr()) == 1
