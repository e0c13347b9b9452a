# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Paths from messages: wrong messages, start of a path, and runs of all nodes along a path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
import struct
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Transform, Twist, TwistStamped, Vector3
from helpers.processes import PAPER, peer, processes, ros_arguments
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.platform_messages import OdometryCdr
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.transforms import TransformsCdr
from masmc_ros.nodes.middleware.ros_topics import raw_class
from masmc_ros.nodes.trajectory.path_messages import PathMessages, PathRequest
from masmc_ros.nodes.trajectory.received_paths import ReceivedPaths
from masmc_ros.reference.joint_path import JointPoints
from masmc_ros.reference.pose_path import PosePoints
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.mechanisms import joint_names
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage
import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

JOINTS = 'trajectory/joint_trajectory'
MULTI_DOF = 'trajectory/multi_dof_trajectory'
CONFIG = PAPER.parent
ARM = ['arm_joint_1', 'arm_joint_2']


def joint_trajectory(
    names: Sequence[str], times: Sequence[float], positions: Sequence[Sequence[float]]
) -> JointTrajectory:
    """Return a path of joints that rests at every point."""
    message = JointTrajectory(joint_names=list(names))
    for at, position in zip(times, positions, strict=True):
        point = JointTrajectoryPoint(positions=list(position), velocities=[0.0] * len(names))
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(at * 1e9), 10**9)
        message.points.append(point)
    return message


def arm_path(**changes: Any) -> JointTrajectory:
    """Return a path of the paper's arm whose second point has other fields."""
    message = joint_trajectory(ARM, [1.0, 2.0], [[0.8, -1.5], [0.9, -1.4]])
    for name, value in changes.items():
        setattr(message.points[1], name, value)
    return message


def pose(x: float, y: float, *, frame: str = 'odom', w: float = 1.0, second: int = 0) -> Any:
    """Return a pose without a rotation."""
    message = PoseStamped()
    message.header.frame_id, message.header.stamp.sec = frame, second
    message.pose.position.x, message.pose.position.y = x, y
    message.pose.orientation.w = w
    return message


def path(*poses: PoseStamped, frame: str = 'odom') -> PathMessage:
    """Return a path through poses."""
    message = PathMessage(poses=list(poses))
    message.header.frame_id = frame
    return message


def twist(forward: float, turn: float, left: float = 0.0) -> Twist:
    """Return a velocity command of the base."""
    message = Twist()
    message.linear.x, message.linear.y, message.angular.z = forward, left, turn
    return message


def stamped(frame: str) -> TwistStamped:
    """Return a velocity command of the base in a frame."""
    message = TwistStamped(twist=twist(0.2, 0.3))
    message.header.frame_id = frame
    return message


def multi_dof(name: str, *places: tuple[float, float], count: int = 1) -> MultiDOFJointTrajectory:
    """Return a path of a frame through places, one a second from 1 s on."""
    message = MultiDOFJointTrajectory(joint_names=[name])
    for second, (x, y) in enumerate(places, 1):
        transform = Transform(translation=Vector3(x=x, y=y))
        point = MultiDOFJointTrajectoryPoint(transforms=[transform] * count)
        point.time_from_start.sec = second
        message.points.append(point)
    return message


def reader(file: Path = PAPER) -> Callable[[str, Any], PathRequest]:
    """Return a function that reads a message of a topic for the robot of a file."""
    values = load_scenario(str(file))['trajectory']
    messages = PathMessages(robot_of(values).mechanism, joint_names(values), '')

    def read(topic: str, message: Any) -> PathRequest:
        return messages.topics[topic][1](topic, serialize_message(message))

    return read


def renamed(*names: str) -> JointTrajectory:
    message = arm_path()
    message.joint_names = list(names)
    return message


WRONG = {
    'unknown joint': (JOINTS, renamed('arm_joint_1', 'arm_joint2'), 'did you mean arm_joint_2'),
    'twice': (JOINTS, renamed('arm_joint_1', 'arm_joint_1'), "'arm_joint_1' is named twice"),
    'wheel': (JOINTS, renamed('arm_joint_1', 'wheel_left_joint'), 'drives the base; expected the'),
    'no names': (JOINTS, renamed(), 'no joint_names; expected some of base_x_joint, '),
    'sizes': (JOINTS, arm_path(positions=[0.9]), 'point 2 has 1 positions for 2 joints'),
    'some velocities': (JOINTS, arm_path(velocities=[]), 'has 0 velocities for 2 joints'),
    'some accelerations': (JOINTS, arm_path(accelerations=[0.0] * 2), 'has 0 accelerations'),
    'nan': (JOINTS, arm_path(positions=[0.9, float('nan')]), 'point 2 has a number that is not'),
    'moving end': (JOINTS, arm_path(velocities=[0.0, 0.4]), 'the last point moves (0.4 rad/s'),
    'same time': (
        JOINTS, joint_trajectory(ARM, [1.0, 1.0], [[0.8, -1.5]] * 2),
        'point 2 at 1 s follows 1 s; expected times that ascend',
    ),
    'before start': (
        JOINTS, joint_trajectory(ARM, [-1.0, 1.0], [[0.8, -1.5]] * 2), 'point 1 is at -1 s'
    ),
    'no positions': (
        JOINTS, JointTrajectory(joint_names=ARM, points=[JointTrajectoryPoint()]), 'no positions'
    ),
    'frame': ('trajectory/goal', pose(1.0, 0.0, frame='map'), "'map': no transform to 'odom' on"),
    'frames': (
        'trajectory/path', path(pose(1.0, 0.0), pose(2.0, 0.0, frame='map')),
        "frame_id 'odom' and 'map'; expected one frame",
    ),
    'quaternion': ('trajectory/goal', pose(1.0, 0.0, w=0.0), 'quaternion of length 0; expected 1'),
    'nan pose': ('trajectory/base_goal', pose(float('nan'), 0.0), 'pose 1 has a number that'),
    'twist in a frame': (
        'reference/cmd_vel_stamped', stamped('odom'), "frame_id = 'odom': velocities are those of"
    ),
    'name of a frame': (
        MULTI_DOF, multi_dof('base', (1.0, 0.0)), "['base_link'] or ['end_effector']"
    ),
    'two transforms': (
        MULTI_DOF, multi_dof('base_link', (1.0, 0.0), count=2), 'point 1 has 2 transforms'
    ),
    'sideways': ('reference/cmd_vel', twist(0.0, 0.0, 0.1), 'linear.y = 0.1: the base cannot'),
    'stamps': (
        'trajectory/base_path', path(pose(1.0, 0.0, second=3), pose(2.0, 0.0, second=2)),
        'pose 2 is stamped -1 s after the first one',
    ),
}  # fmt: skip


@pytest.mark.parametrize(('topic', 'message', 'expected'), WRONG.values(), ids=list(WRONG))
def test_wrong_path_message_is_one_line(topic: str, message: Any, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        reader()(topic, message)
    assert expected in str(caught.value)
    assert len(str(caught.value)) < 250


@pytest.mark.parametrize(
    ('topic', 'message'),
    [
        ('trajectory/goal', pose(1.0, 2.0, frame='map')),
        ('trajectory/base_path', path(pose(1.0, 2.0, frame=''), frame='map')),
        (MULTI_DOF, multi_dof('end_effector', (1.0, 2.0))),
    ],
)
def test_poses_are_moved_to_frame_of_path(topic: str, message: Any) -> None:
    """A quarter of a turn about z, and 3 m along x."""
    values = load_scenario(str(PAPER))['trajectory']
    transform = np.array([3.0, 0.0, 0.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
    robot, names = robot_of(values).mechanism, joint_names(values)
    messages = PathMessages(robot, names, '', 'world', lambda *_: transform)
    if topic == MULTI_DOF:
        message.header.frame_id = 'map'
    points = messages.topics[topic][1](topic, serialize_message(message)).points
    assert isinstance(points, PosePoints)
    assert points.positions == pytest.approx(np.array([[1.0, 1.0, 0.0]]))
    assert points.quaternions == pytest.approx(transform[None, 3:])


@pytest.mark.parametrize(('topic', 'message'), [
    (JOINTS, joint_trajectory(ARM, [1.0], [[0.8, -1.5]])),
    ('trajectory/path', path(pose(1.0, 0.0))),
])  # fmt: skip
def test_million_points_are_rejected_unread(topic: str, message: Any) -> None:
    values = load_scenario(str(PAPER))['trajectory']
    messages = PathMessages(robot_of(values).mechanism, joint_names(values), '')
    raw = bytearray(serialize_message(message))
    # The count precedes the only point.
    at = raw.index(struct.pack('<I', 1), 16 if topic == JOINTS else 12 + len('odom'))
    struct.pack_into('<I', raw, at, 1_000_000)
    with pytest.raises(InputError, match='1000000 points; expected at most 10000'):
        messages.topics[topic][1](topic, bytes(raw))


def test_path_of_base_for_fixed_base_is_rejected() -> None:
    # The extra `robots` has its URDF.
    pytest.importorskip('pinocchio')
    file = CONFIG / 'ur5.yaml'
    with pytest.raises(InputError, match='no base that moves in the plane'):
        reader(file)('trajectory/base_goal', pose(1.0, 0.0))


class Started:
    """Reference of the paper's trajectory that continues with paths from messages."""

    def __init__(self, **changes: Any) -> None:
        values = {**load_scenario(str(PAPER))['trajectory'], **changes}
        self.timing = Timing.from_values(values)
        self.robot = robot_of(values)
        trajectory = Trajectory(values, self.timing.period, self.robot)
        self.paths = ReceivedPaths(trajectory, self.robot, self.timing, values)
        self.position = np.array([0.0, 0.0, 1.57, 0.0, 0.0, 0.8, -1.5])

    def wait(self, message: Any, topic: str = JOINTS, unsent: int = 2500) -> None:
        self.take(reader()(topic, message), unsent)

    def take(self, request: PathRequest, unsent: int = 2500) -> None:
        self.paths.wait(request, unsent=unsent, tick=500, origin_ns=0)
        deadline = time.monotonic() + 60.0
        while self.paths.is_loading:
            assert time.monotonic() < deadline
            time.sleep(0.001)

    def start(self, tick: int) -> int | None:
        return self.paths.start(tick, self.position)

    def check_continuous(self, first: int, count: int) -> None:
        """Compare positions and velocities with their derivatives; those of cubics step."""
        samples = self.paths.sample(first, count)
        axes, period = samples.shape[1] // 3, self.timing.period
        for order, tolerance in enumerate((1e-6, 1e-3)):
            values, rates = (samples[:, k * axes:(k + 1) * axes] for k in (order, order + 1))
            middle = 0.5 * period * (rates[1:] + rates[:-1])
            assert np.abs(np.diff(values, axis=0) - middle).max() < tolerance


def test_path_in_lockstep_starts_after_sent_samples() -> None:
    run = Started()
    before = run.paths.sample(2500, 1)
    run.wait(arm_path())
    assert run.paths.unsendable == 2500
    assert run.start(2499) is None
    assert run.start(2500) == 2500
    assert np.abs(run.paths.sample(2500, 1) - before).max() < 1e-12
    run.check_continuous(2500, 5000)
    assert run.paths.unsendable is None


def test_path_in_real_time_starts_a_lead_after_the_state() -> None:
    run = Started(pacing='realtime')
    before = run.paths.sample(720, 1)
    run.wait(arm_path())
    assert run.paths.unsendable is None
    assert run.start(520) == 720
    assert np.abs(run.paths.sample(720, 1) - before).max() < 1e-12
    run.check_continuous(720, 5000)


def test_path_with_stamps_starts_at_or_within_it() -> None:
    message = arm_path()
    message.header.stamp.sec = 4
    run = Started()
    run.wait(message)
    assert run.paths.unsendable == 4000
    assert run.start(4000) == 4000
    # 1.5 s of a path of 2 s have passed.
    message.header.stamp.sec = 1
    run = Started()
    run.wait(message)
    run.start(2500)
    run.check_continuous(2500, 1500)
    end = run.paths.sample(3000, 1)
    moving = run.robot.task_positions(np.array([[0.0, 0.0, 1.57, 0.0, 0.0, 0.9, -1.4]]))
    held = run.paths.sample(run.paths.end + 1, 1)
    assert held[0, :4] == pytest.approx(moving[0], abs=1e-9)
    assert not held[0, 4:].any()
    assert np.isfinite(end).all()


def test_path_wholly_in_the_past_changes_nothing() -> None:
    run = Started()
    message = arm_path()
    message.header.stamp.nanosec = 1
    expected = run.paths.sample(2500, 100)
    run.wait(message)
    with pytest.raises(InputError, match=r'it ended 0\.5 s before its first sample at t = 2\.5 s'):
        run.start(2500)
    assert run.paths.waiting is None
    assert (run.paths.sample(2500, 100) == expected).all()


def test_path_after_the_end_of_the_run_is_rejected() -> None:
    run = Started()
    with pytest.raises(InputError, match=r'start at 20\.001 s, and the run ends at 20 s'):
        run.wait(arm_path(), unsent=20_001)
    assert run.paths.waiting is None


def test_base_follows_a_goal_of_the_end_effector() -> None:
    run = Started()
    before = run.paths.sample(2500, 1)
    run.wait(pose(3.0, 0.5), 'trajectory/goal')
    assert run.start(2500) == 2500
    assert np.abs(run.paths.sample(2500, 1) - before).max() < 1e-12
    run.check_continuous(2500, run.paths.end + 10 - 2500)
    end = run.paths.sample(run.paths.end + 1, 1)[0]
    assert end[:2] == pytest.approx([3.0, 0.5], abs=1e-9)
    # F was at (0.5, 0), from where the arm reaches 0.876 m.
    assert 2.3 < end[2] < 2.7
    assert not end[4:].any()


def test_goal_out_of_reach_changes_nothing() -> None:
    run = Started(path_base='hold')
    expected = run.paths.sample(2500, 100)
    run.wait(pose(3.0, 0.0), 'trajectory/goal')
    with pytest.raises(InputError, match='outside its reach'):
        run.start(2500)
    assert (run.paths.sample(2500, 100) == expected).all()


def test_goal_with_a_limit_of_jerk_continues_the_reference() -> None:
    pytest.importorskip('ruckig')
    run = Started(path_jerk=2.0)
    before = run.paths.sample(2500, 1)
    run.wait(pose(0.9, 0.4), 'trajectory/goal')
    assert run.start(2500) == 2500
    samples = run.paths.sample(2500, run.paths.end - 2500)
    assert (samples[:1] == before).all()
    run.check_continuous(2500, len(samples))
    assert samples[-1, :2] == pytest.approx([0.9, 0.4], abs=1e-6)
    jerk = np.linalg.norm(np.diff(samples[:, 8:10], axis=0), axis=1).max() / run.timing.period
    assert jerk == pytest.approx(2.0, rel=0.3)


def test_changed_trajectory_continues_the_reference() -> None:
    run = Started()
    before = run.paths.sample(2500, 1)
    values = load_scenario(
        str(PAPER), ['trajectory.type=figure_eight', 'trajectory.figure_eight.delay=1.0']
    )['trajectory']
    eight = Trajectory(values, run.timing.period, run.robot)
    run.take(PathRequest('type', eight, None))
    assert run.start(2500) == 2500
    assert np.abs(run.paths.sample(2500, 1) - before).max() < 1e-12
    run.check_continuous(2500, 10_000)
    # The difference has decayed, and the time of the eight counts from the change.
    assert (run.paths.sample(9500, 100) == eight.sample(7000, 100)).all()


def test_trajectory_node_takes_and_rejects_another_type(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        raw = tester.collect(Float64MultiArray, 'reference', raw=True)
        records = tester.collect(String, 'trajectory/parameters')
        node = started.start('trajectory', *ros_arguments(PAPER))
        tester.until(lambda: len(raw) == 5, 'the windows before the start')

        def assign(**values: Any) -> Any:
            new = [Parameter(name, value=value).to_parameter_msg()
                   for name, value in values.items()]  # fmt: skip
            request = SetParametersAtomically.Request(parameters=new)
            name = '/trajectory/set_parameters_atomically'
            return tester.call(SetParametersAtomically, name, request).result

        far = assign(**{'type': 'arc', 'arc.centre': [3.0, 0.0]})
        assert (far.successful, 'outside its reach' in far.reason) == (False, True)
        unknown = assign(type='circel')
        assert (unknown.successful, 'expected one of' in unknown.reason) == (False, True)
        # Parameters of a type that is not followed change nothing yet.
        assert assign(**{'figure_eight.duration': 6.0}).reason == ''
        chosen = assign(type='figure_eight')
        assert (chosen.successful, 'starts at the next state' in chosen.reason) == (True, True)
        states = tester.publisher(JointState, 'joint_states', latched=True)
        state = JointStateCdr()
        state.position[:] = 0.0, 0.0, 1.5708, 0.0, 0.0, 0.8, -1.5
        state.set_stamp(2_500_000_000)
        states.publish(state.to_bytes())
        tester.until(lambda: len(raw) > 6, 'windows of the eight')
        assert node.logged('INFO', 'type: the trajectory figure_eight, from t = 2.5 s on')
        tester.until(lambda: any('"changed": ["type"]' in r.data for r in records), 'the record')
        assert not node.logged('WARN')


def test_empty_trajectory_stops_the_reference() -> None:
    run = Started()
    run.wait(JointTrajectory())
    run.start(2500)
    run.check_continuous(2500, 1200)
    assert not run.paths.sample(3501, 1)[0, 4:].any()
    # A path of joints stops in the coordinates of the joints, and continues from there.
    run.wait(joint_trajectory(['base_x_joint', *ARM], [4.0], [[0.5, 0.9, -1.4]]), unsent=4000)
    run.start(4000)
    run.wait(JointTrajectory(), unsent=6000)
    run.start(6000)
    run.check_continuous(6000, 3000)
    run.wait(pose(0.6, 0.2), 'trajectory/base_goal', unsent=9000)
    assert run.start(9000) == 9000
    run.check_continuous(9000, 8000)
    end = run.paths.sample(19_000, 1)[0]
    offset = run.robot.geometry
    assert end[2:4] == pytest.approx([0.6 + 0.116, 0.2], abs=1e-9), offset


def test_columns_are_in_the_order_of_the_message() -> None:
    points = reader()(JOINTS, renamed('arm_joint_2', 'arm_joint_1')).points
    assert isinstance(points, JointPoints)
    assert points.columns.tolist() == [6, 5]


def test_multi_dof_trajectory_moves_base_or_end_effector() -> None:
    run = Started()
    run.position[2] = 0.0
    run.wait(multi_dof('base_link', (0.1, 0.0), (0.3, 0.0)), MULTI_DOF, unsent=500)
    run.start(500)
    run.check_continuous(500, 3000)
    # F is 0.116 m ahead of the base.
    end = run.paths.sample(run.paths.end + 1, 1)[0]
    assert end[2:4] == pytest.approx([0.3 + 0.116, 0.0], abs=1e-9)
    run = Started()
    run.wait(multi_dof('end_effector', (0.8, 0.5), (0.9, 0.4)), MULTI_DOF)
    run.start(2500)
    run.check_continuous(2500, 3000)
    at_first = run.paths.sample(3500, 1)[0, :2]
    assert at_first == pytest.approx([0.8, 0.5], abs=1e-9)
    assert run.paths.sample(run.paths.end + 1, 1)[0, :2] == pytest.approx([0.9, 0.4], abs=1e-9)


def test_stamped_velocities_equal_velocities() -> None:
    topics = 'reference/cmd_vel', 'reference/cmd_vel_stamped'
    plain, same = reader()(topics[0], twist(0.2, 0.3)), reader()(topics[1], stamped('base_link'))
    assert plain.points == same.points
    assert same.is_command


@pytest.mark.parametrize(('topic', 'frame'), [('/tf', 'map'), ('/tf_static', 'odom/second')])
def test_goal_in_another_frame_waits_for_transform(
    tmp_path: Path, topic: str, frame: str
) -> None:
    """The frame is turned by half a turn: the goal is behind the robot."""
    transform = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]])
    raw = TransformsCdr('', ((frame, 'odom'),)).fill(0, transform)
    with processes(tmp_path) as started, peer(started.domain) as tester:
        windows = tester.collect(Float64MultiArray, 'reference', raw=True)
        node = started.start('trajectory', *ros_arguments(PAPER))
        kind = raw_class('tf2_msgs/msg/TFMessage')
        transforms = tester.publisher(kind, topic, latched=topic == '/tf_static')
        goals = tester.publisher(PoseStamped, 'trajectory/base_goal')
        states = tester.publisher(JointState, 'joint_states', latched=True)
        tester.wait_for_subscribers(goals)
        goals.publish(pose(1.0, 0.0, frame=frame))
        tester.wait_for_subscribers(transforms)
        transforms.publish(raw)
        state = JointStateCdr()
        state.position[:] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.8, -1.5
        state.set_stamp(2_500_000_000)
        states.publish(state.to_bytes())
        tester.until(lambda: node.logged('INFO', 'base_goal: 1 pose'), 'the start of the path')

        def end() -> float:
            window = ReferenceWindow.from_bytes(windows[-1])
            assert window is not None
            return float(window.samples[-1, 0, 2])

        odometry = OdometryCdr('', 'base_link')
        publisher = tester.publisher(Odometry, 'odom')
        tester.wait_for_subscribers(publisher)
        odometry.set_stamp(15_000_000_000)
        publisher.publish(odometry.to_bytes())
        # The goal is 1 m behind the robot.
        tester.until(lambda: end() < -0.5, lambda: f'x_F of the goal, not {end()}')
        assert not node.logged('WARN')


def test_older_odometry_after_the_start_of_a_path_is_no_reset(tmp_path: Path) -> None:
    """On a busy machine it arrives after newer joint states; a reset concerns both."""
    settings = {'pacing': 'realtime', 'duration': 0.0, 'path_lead': 1.0}
    with processes(tmp_path) as started, peer(started.domain) as tester:
        windows = tester.collect(Float64MultiArray, 'reference', raw=True)
        node = started.start('trajectory', *ros_arguments(PAPER, **settings))
        stops = tester.publisher(JointTrajectory, JOINTS)
        states = tester.publisher(JointState, 'joint_states', latched=True)
        positions = tester.publisher(Odometry, 'odom')
        for publisher in (stops, positions):
            tester.wait_for_subscribers(publisher)
        odometry, state = OdometryCdr('', 'base_link'), JointStateCdr()
        state.position[:] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.8, -1.5

        def odom(seconds: float) -> None:
            count = len(windows)
            odometry.set_stamp(round(seconds * 1e9))
            positions.publish(odometry.to_bytes())
            tester.until(lambda: len(windows) > count, f'windows for odometry at {seconds} s')

        odom(20.0)
        state.set_stamp(21_900_000_000)
        stops.publish(JointTrajectory())

        def has_started() -> bool:
            # In real time no path starts before its code is loaded.
            states.publish(state.to_bytes())
            return bool(node.logged('INFO', 'a stop, from t = 22.9 s on'))

        tester.until(has_started, started.output)
        # Older than the state by more than the windows that are sent ahead, and a newer one.
        odometry.set_stamp(20_010_000_000)
        positions.publish(odometry.to_bytes())
        # The node responds after it has read the message.
        tester.call(GetParameters, 'trajectory/get_parameters', GetParameters.Request())
        odom(24.0)
        assert not node.logged('INFO', 'set back')
        state.set_stamp(1_000_000_000)
        states.publish(state.to_bytes())
        odometry.set_stamp(1_000_000_000)
        positions.publish(odometry.to_bytes())
        tester.until(lambda: node.logged('INFO', 'set back'), 'the reset')
        tester.until(lambda: node.logged('INFO', 'which is dropped'), 'the end of the path')


def test_trajectory_node_follows_and_rejects_paths(tmp_path: Path) -> None:
    """The only state arrives while the code of paths compiles, because the cache is empty."""
    cache = {'XDG_CACHE_HOME': str(tmp_path / 'cache')}
    with processes(tmp_path) as started, peer(started.domain) as tester:
        raw = tester.collect(Float64MultiArray, 'reference', raw=True)
        reports = tester.collect(DiagnosticArray, '/diagnostics')
        node = started.start('trajectory', *ros_arguments(PAPER), environment=cache)
        sender = tester.publisher(JointTrajectory, JOINTS)
        goals = tester.publisher(PoseStamped, 'trajectory/goal')
        states = tester.publisher(JointState, 'joint_states', latched=True)
        for publisher in (sender, goals):
            tester.wait_for_subscribers(publisher)

        def windows() -> list[ReferenceWindow]:
            read = [ReferenceWindow.from_bytes(message) for message in raw]
            return [window for window in read if window is not None]

        goals.publish(pose(1.0, 0.0, frame='map'))
        tester.until(lambda: node.logged('WARN', "trajectory/goal rejected: frame_id = 'map'"))
        tester.until(
            lambda: any(
                "frame_id = 'map'" in status.message
                for report in reports
                for status in report.status
            ),
            'the rejection in /diagnostics',
        )
        tester.until(lambda: len(windows()) == 5, 'the windows before the start')
        sender.publish(arm_path())
        unsent = 2500
        state = JointStateCdr()
        state.position[:] = 0.0, 0.0, 1.5708, 0.0, 0.0, 0.8, -1.5
        state.set_stamp(unsent * 1_000_000)
        states.publish(state.to_bytes())
        tester.until(lambda: len(windows()) > 6, 'windows of the path')
        assert node.logged('INFO', '2 points of 2 joints, from t = 2.5 s on')
        before, after = windows()[4:6]
        assert after.stamp_ns == 2_500_000_000
        last, first = before.samples[-1], after.samples[0]
        assert np.abs(first[0] - last[0] - 5e-4 * (first[1] + last[1])).max() < 1e-6
        odometry = OdometryCdr('', 'base_link')
        odometry.set_stamp(3_000_000_000)
        publisher = tester.publisher(Odometry, 'odom')
        tester.wait_for_subscribers(publisher)
        publisher.publish(odometry.to_bytes())
        tester.until(lambda: (windows()[-1].stamp_ns or 0) >= 4_500_000_000, 'later windows')
        assert len(node.logged('WARN')) == 1


def test_trajectory_node_rejects_path_at_a_state_far_ahead(tmp_path: Path) -> None:
    """It does not send the windows of all times until then, but those after it."""
    with processes(tmp_path) as started, peer(started.domain) as tester:
        raw = tester.collect(Float64MultiArray, 'reference', raw=True)
        node = started.start('trajectory', *ros_arguments(PAPER, duration=0.0))
        sender = tester.publisher(JointTrajectory, JOINTS)
        states = tester.publisher(JointState, 'joint_states', latched=True)
        tester.wait_for_subscribers(sender)
        tester.until(lambda: len(raw) == 5, 'the windows before the start')
        message = arm_path()
        message.header.stamp.sec = 5
        sender.publish(message)
        state = JointStateCdr()
        state.position[:] = 0.0, 0.0, 1.5708, 0.0, 0.0, 0.8, -1.5
        state.set_stamp(10**18)
        states.publish(state.to_bytes())
        tester.until(lambda: node.logged('WARN', 'it ended'), 'the rejection')
        request = GetParameters.Request(names=['type'])
        tester.call(GetParameters, '/trajectory/get_parameters', request)
        assert len(raw) < 20


def test_velocities_move_the_base_and_it_stops_without_them() -> None:
    run = Started(pacing='realtime')
    run.wait(joint_trajectory(ARM, [0.5], [[0.8, -1.5]]), unsent=0)
    run.start(500)
    for tick in range(4000, 6000, 50):
        run.wait(twist(0.2, 0.3), 'reference/cmd_vel', unsent=0)
        first = run.start(tick)
        assert first == tick + 200
        run.check_continuous(first, 1000)
    motion = run.paths._joined
    assert motion is not None
    x, y, heading = motion.motion.path.state(0.0).velocity[:3]
    assert np.hypot(x, y) == pytest.approx(0.2, abs=1e-3)
    assert heading == pytest.approx(0.3, abs=1e-3)
    end = run.paths.end
    assert end <= first + 1201
    assert not run.paths.sample(end + 1, 1)[0, 4:].any()


def test_velocities_in_lockstep_are_rejected() -> None:
    with pytest.raises(InputError, match='pacing = lockstep: expected realtime'):
        Started().wait(twist(0.2, 0.0), 'reference/cmd_vel')


def start_stamps(raw: Sequence[bytes]) -> list[int]:
    """Return the stamps in ns of the first samples of windows."""
    windows = [ReferenceWindow.from_bytes(message) for message in raw]
    return [window.stamp_ns or 0 for window in windows if window is not None]


def test_trajectory_node_in_real_time_takes_the_base_from_odom(tmp_path: Path) -> None:
    settings = {'pacing': 'realtime', 'duration': 0.0, 'path_speed': 1.0}
    with processes(tmp_path) as started, peer(started.domain) as tester:
        raw = tester.collect(Float64MultiArray, 'reference', raw=True)
        node = started.start('trajectory', *ros_arguments(PAPER, **settings))
        sender = tester.publisher(JointTrajectory, JOINTS)
        states = tester.publisher(JointState, 'joint_states')
        poses = tester.publisher(Odometry, 'odom')
        tester.wait_for_subscribers(sender)
        # Only names and positions, as a driver of an arm sends them.
        state = JointState(name=ARM, position=[0.7, -1.4])
        state.header.stamp.sec = 1
        odometry = OdometryCdr('odom', 'base_link')
        odometry.position[:2], odometry.orientation[3] = (0.4, 0.1), 1.0
        odometry.set_stamp(1_000_000_000)

        def has_started() -> bool:
            poses.publish(odometry.to_bytes())
            states.publish(state)
            return bool(node.logged('INFO', 'from t = 1.2 s on'))

        sender.publish(joint_trajectory(['arm_joint_2'], [1.0], [[-1.2]]))
        tester.until(has_started, started.output)
        tester.until(
            lambda: start_stamps(raw)[-4:] == [1.2e9, 1.7e9, 2.2e9, 2.7e9],
            lambda: f'{start_stamps(raw)}',
        )
        # The base is held where it is, and F is 0.116 m ahead of it.
        end = ReferenceWindow.from_bytes(raw[-1])
        assert end is not None
        assert end.samples[-1, 0, 2:] == pytest.approx([0.516, 0.1], abs=1e-9)
        assert not node.logged('WARN')


def followed(
    folder: Path, file: Path, request: JointTrajectory | dict[str, Any], duration: float
) -> Run:
    """
    Return the log of a run of all nodes along a path from 0.5 s or later on.

    It is that of a message, or of parameters of the trajectory node.
    """
    log = folder / 'run.mcap'
    arguments = ros_arguments(
        file,
        duration=duration,
        trajectory__horizon=0.5,
        trajectory__window=0.25,
        plant__wait_for='[controller, trajectory, recorder]',
        recorder__output=log,
    )
    with processes(folder) as started, peer(started.domain) as tester:
        nodes = started.start_all(*arguments)
        sender = tester.publisher(JointTrajectory, JOINTS)
        tester.wait_for_subscribers(sender)
        stamps = tester.watch_time()
        tester.until(lambda: stamps[-1] > 0.5e9, started.output)
        source = JOINTS
        if isinstance(request, dict):
            source = 'type'
            tester.change('/trajectory', **request)
        else:
            sender.publish(request)
        for node in nodes.values():
            assert node.wait() == 0, started.output()
        assert nodes['trajectory'].logged('INFO', f'{source}: '), started.output()
        assert not nodes['trajectory'].logged('WARN'), started.output()
    return read_run(log)


def largest_error(run: Run, axes: slice, seconds: float) -> float:
    """Return the largest error on some task axes in the last seconds of a run, m or rad."""
    error = run.telemetry['error'].values
    return float(np.abs(error[-round(seconds * 1000):, axes]).max())


@pytest.mark.slow
def test_plan_of_base_and_arm_is_followed_and_recomputed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ['base_x_joint', 'base_yaw_joint', *ARM]
    points = [[0.5, 1.57, 0.78, -1.5], [0.8, 1.0, 0.9, -1.2], [1.0, 0.5, 0.5, -1.8]]
    message = joint_trajectory(names, [0.0, 3.0, 6.0], points)
    run = followed(tmp_path, PAPER, message, 10.0)
    # The law of the paper at rest under a disturbance; F oscillates by 30 mm.
    assert largest_error(run, slice(0, 2), 1.0) < 0.015
    assert run.reference is not None
    robot = robot_of(run.parameters['trajectory'])
    end = robot.task_positions(np.array([[1.0, 0.0, 0.5, 0.0, 0.0, 0.5, -1.8]]))
    assert run.reference[-1, [0, 2]] == pytest.approx(end[0, [0, 2]], abs=1e-9)
    capsys.readouterr()
    assert main(['simulate', str(tmp_path / 'run.mcap')]) == 0
    assert 'bitwise identical' in capsys.readouterr().out.partition('recomputed: all')[2]


@pytest.mark.slow
def test_changed_type_is_followed_and_recomputed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    request = {
        'type': 'figure_eight', 'figure_eight.start': [0.5, 0.5, 0.2, 0.0],
        'figure_eight.along': [0.1, 0.0, 0.0, 0.0], 'figure_eight.duration': 4.0,
    }  # fmt: skip
    run = followed(tmp_path, PAPER, request, 8.0)
    assert run.reference is not None
    assert run.reference[-1] == pytest.approx([0.5, 0.5, 0.2, *[0.0] * 9], abs=1e-9)
    # The steps of the acceleration are those of the jerk of a decaying difference.
    acceleration = run.reference[:, 8:]
    assert np.abs(np.diff(acceleration, axis=0)).max() < 0.05
    (change,) = [c for c in run.changes if c.changed and c.node == '/trajectory']
    assert change.changes['type'] == 'figure_eight'
    capsys.readouterr()
    assert main(['simulate', str(tmp_path / 'run.mcap')]) == 0
    assert 'bitwise identical' in capsys.readouterr().out.partition('recomputed: all')[2]


PLANS = {
    'tiago': (
        ['base_x_joint', 'torso_lift_joint', 'arm_1_joint', 'arm_4_joint'],
        [[0.15, 0.2, 1.2, 1.5], [0.3, 0.2, 1.0, 1.4]],
    ),
    'ur5': (['shoulder_pan_joint', 'elbow_joint'], [[0.4, 1.2], [0.6, 1.5]]),
}


@pytest.mark.slow
@pytest.mark.parametrize('name', PLANS)
def test_plan_of_pose_task_is_followed_and_recomputed(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip('pinocchio')
    message = joint_trajectory(PLANS[name][0], [3.0, 6.0], PLANS[name][1])
    run = followed(tmp_path, CONFIG / f'{name}.yaml', message, 9.0)
    # Measured: 0.006 mm and 0.05 mrad.
    assert largest_error(run, slice(0, 3), 8.0) < 5e-5
    assert largest_error(run, slice(3, 6), 8.0) < 2e-4
    capsys.readouterr()
    assert main(['simulate', str(tmp_path / 'run.mcap')]) == 0
    assert 'bitwise identical' in capsys.readouterr().out.partition('recomputed: all')[2]
