# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Path messages: bytes and poses."""

from __future__ import annotations

from helpers.robots import DEFAULT, task_positions
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.log.traced_paths import ActualPath, DesiredPath, MOST_POSES, thinned
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.path import path_message, path_points
from masmc_ros.messages.stamps import stamp_reader
from masmc_ros.reference.trajectory import parameters, Trajectory
from masmc_ros.robot.mechanisms import DEFAULT as TWO_LINK
from masmc_ros.robot.robot import robot_of
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = 'nav_msgs/msg/Path'
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
FRAMES = st.text('abcdefg/_', min_size=1, max_size=9)
ROBOT = robot_of({f'robot.{name}': value for name, value in DEFAULT.items()})
VALUES = {parameter.name: parameter.default for parameter in parameters(TWO_LINK)}


def points(count: int) -> np.ndarray:
    """Return (count, 3) different numbers."""
    return np.random.default_rng(count).standard_normal((count, 3))


def serialised(frame: str, stamp: int, stamps: list[int]) -> bytes:
    """Return the message serialised by rosbags from `points`."""
    t = STORE.types

    def header(stamp_ns: int) -> object:
        time = t['builtin_interfaces/msg/Time'](*divmod(stamp_ns, 10**9))
        return t['std_msgs/msg/Header'](stamp=time, frame_id=frame)

    poses = [
        t['geometry_msgs/msg/PoseStamped'](
            header=header(pose_stamp),
            pose=t['geometry_msgs/msg/Pose'](
                position=t['geometry_msgs/msg/Point'](*point),
                orientation=t['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0),
            ),
        )
        for pose_stamp, point in zip(stamps, points(len(stamps)).tolist(), strict=True)
    ]
    return bytes(STORE.serialize_cdr(t[TYPE](header=header(stamp), poses=poses), TYPE))


@given(FRAMES, STAMPS, st.lists(STAMPS, max_size=5))
def test_path_message_equals_rosbags(frame: str, stamp: int, stamps: list[int]) -> None:
    raw = path_message(frame, stamp, np.array(stamps, dtype=np.int64), points(len(stamps)))
    assert raw == serialised(frame, stamp, stamps)
    assert stamp_reader('path/actual', TYPE)(raw) == stamp
    np.testing.assert_array_equal(path_points(raw), points(len(stamps)))


@pytest.mark.parametrize('count', [0, 2])
def test_path_points_of_other_bytes_are_none(count: int) -> None:
    raw = path_message('odom', 7, np.arange(count), points(count))
    others = [raw[:-1], raw + b'\0', raw[:10], b'', raw.replace(b'\0\1', b'\0\0', 1)]
    others += [raw.replace(b'odom', b'\xff\xfe\xfd\xfc'), raw[:-1].replace(b'odom', b'map')]
    if count:
        others.append(b'left'.join(raw.rsplit(b'odom', 1)))
    assert [path_points(other) for other in others] == [None] * len(others)


@pytest.mark.parametrize('count', [0, 1, 2, 1000])
@pytest.mark.parametrize('frame', ['odom', 'left/odom', 'right/odom'])
def test_path_message_is_read_by_rclpy(frame: str, count: int) -> None:
    serialization = pytest.importorskip('rclpy.serialization', reason='compares with ROS 2')
    from nav_msgs.msg import Path

    stamps = np.arange(count) * 50_000_000
    raw = path_message(frame, 7, stamps, points(count))
    message = serialization.deserialize_message(raw, Path)
    assert len(serialization.serialize_message(message)) == len(raw)
    assert message.header.frame_id == frame
    assert message.header.stamp.nanosec == 7
    headers = [
        (p.header.frame_id, p.header.stamp.sec * 10**9 + p.header.stamp.nanosec)
        for p in message.poses
    ]
    assert headers == [(frame, stamp) for stamp in stamps.tolist()]
    places = [(p.pose.position.x, p.pose.position.y, p.pose.position.z) for p in message.poses]
    assert places == [tuple(point) for point in points(count).tolist()]
    assert {p.pose.orientation.w for p in message.poses} == ({1.0} if count else set())


def read(raw: bytes) -> tuple[int, np.ndarray]:
    """Return a path's stamp in ns, and stamp in ns and position of its poses (n, 4)."""
    message = STORE.deserialize_cdr(raw, TYPE)
    assert message.header.frame_id == 'odom'

    def stamp(header: object) -> int:
        return header.stamp.sec * 10**9 + header.stamp.nanosec

    rows = [
        (stamp(p.header), p.pose.position.x, p.pose.position.y, p.pose.position.z)
        for p in message.poses
    ]
    return stamp(message.header), np.array(rows)


@given(st.integers(1, 10**8), st.integers(2, 2000))
def test_thinned_ticks_are_even_and_within_limit(last: int, limit: int) -> None:
    ticks = thinned(last, limit)
    assert ticks[0] == 0
    assert ticks[-1] == last
    assert 2 <= len(ticks) <= limit
    steps = np.diff(ticks)
    assert (steps[:-1] == steps[0]).all()
    assert 0 < steps[-1] <= steps[0]
    # Twice as many poses would exceed the limit.
    assert len(ticks) == last + 1 or len(ticks) > limit // 2


def test_desired_path_finite_run_equals_trajectory() -> None:
    timing = Timing(1e-3, 20_000)
    trajectory = Trajectory(VALUES, timing.period, ROBOT)
    raw = DesiredPath(timing, ROBOT).whole(trajectory, 5_000_000_000)
    assert raw is not None
    stamp, poses = read(raw)
    assert stamp == 5_000_000_000
    assert MOST_POSES // 2 < len(poses) <= MOST_POSES
    t = (poses[:, 0] - 5e9) * 1e-9
    assert t[0] == 0.0
    assert t[-1] == 20.0
    np.testing.assert_allclose(poses[:, 1], 0.3 + 0.2 * t, atol=1e-12)
    np.testing.assert_allclose(poses[:, 2], 0.5 + 0.25 * np.sin(0.2 * np.pi * t), atol=1e-12)
    assert set(poses[:, 3]) == {ROBOT.height}


def test_desired_path_endless_run_is_published_piecewise() -> None:
    timing = Timing(1e-3, None)
    trajectory = Trajectory(VALUES, timing.period, ROBOT)
    path = DesiredPath(timing, ROBOT)
    assert path.whole(trajectory) is None
    poses = np.empty(0)
    for window in range(120):
        samples = trajectory.sample(500 * window, 500)
        stamp, poses = read(path.piece(window, 500_000_000 * window, samples))
        assert stamp == window
        assert len(poses) == min(10 * (window + 1), MOST_POSES)
    times = np.arange(10 * 120 - MOST_POSES, 10 * 120) * 50
    assert poses[:, 0].tolist() == (times * 10**6).tolist()
    np.testing.assert_array_equal(poses[:, 1:3], trajectory.positions(times)[:, :2])
    # After a reset the path continues from there.
    samples = trajectory.sample(58_000, 500)
    _, poses = read(path.piece(0, 58_000_000_000, samples))
    assert poses[-1, 0] == 58_450_000_000
    assert (np.diff(poses[:, 0]) == 50_000_000).all()


@pytest.mark.parametrize(('period', 'last'), [(1e-3, 60_730), (3e-3, 1001), (0.2, 7), (1.0, 3)])
def test_actual_path_grows_to_its_limit(period: float, last: int) -> None:
    timing = Timing(period, last)
    path = ActualPath(timing, ROBOT)
    positions = np.random.default_rng(1).standard_normal((last + 1, 7))
    task = task_positions(ROBOT.geometry, positions)
    sent, latest = [], np.empty(0)
    for tick in range(last + 1):
        if path.takes(tick):
            raw = path.add(tick, positions[tick])
            if raw is not None:
                stamp, latest = read(raw)
                assert stamp == timing.stamp(tick) == latest[-1, 0]
                assert len(latest) <= MOST_POSES
                sent.append(tick)
        else:
            assert tick != last
    assert sent[0] == 0
    assert sent[-1] == last
    assert np.diff(sent).max() * period <= max(0.5, period) * 1.01
    ticks = np.rint(latest[:, 0] / (1e9 * period)).astype(int)
    assert np.diff(ticks).max() * period <= max(0.05, period) * 1.02
    assert ticks[0] == 0 or len(latest) == MOST_POSES
    np.testing.assert_array_equal(latest[:, 1:3], task[ticks, :2])
    assert set(latest[:, 3]) == {ROBOT.height}


def test_actual_path_after_reset_restarts() -> None:
    path = ActualPath(Timing(1e-3, None), ROBOT)
    states = np.random.default_rng(2).standard_normal((2, 7))
    for tick in range(0, 1001, 50):
        path.add(tick, states[0])
    raw = path.add(0, states[1])
    assert raw is not None
    _, poses = read(raw)
    assert poses[:, 1:3].tolist() == task_positions(ROBOT.geometry, states[1:])[:, :2].tolist()
