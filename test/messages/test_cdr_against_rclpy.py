# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages in fixed layouts against the serialiser of ROS 2."""

from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, TwistStamped
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.messages.cdr_layout import Layout
from masmc_ros.messages.commands import ARM_VELOCITY, ArmVelocityCdr, EFFORT, EffortCdr
from masmc_ros.messages.joint_state import joint_state_layout, JointStateCdr
from masmc_ros.messages.message import multi_array_layout
from masmc_ros.messages.platform_messages import (
    odometry_layout,
    OdometryCdr,
    time_layout,
    TimeCdr,
    twist_layout,
    twist_stamped_layout,
    TwistCdr,
    TwistStampedCdr,
)
from masmc_ros.messages.reference_window import reference_layout, ReferenceWindow
from masmc_ros.messages.telemetry import telemetry_layout, TelemetryCdr
from masmc_ros.messages.topics import DRIVEN_JOINTS, JOINTS, TELEMETRY
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import get_typestore, Stores
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

STORE = get_typestore(Stores.ROS2_JAZZY)
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
NUMBERS = st.floats(allow_nan=False)


def vectors(count: int) -> st.SearchStrategy[list[float]]:
    """Return lists of `count` numbers."""
    return st.lists(NUMBERS, min_size=count, max_size=count)


def time(stamp_ns: int) -> Time:
    """Return a ROS time."""
    return Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)


def array(
    dimensions: list[tuple[str, int, int]], data_offset: int, data: list[float]
) -> Float64MultiArray:
    """Return an array of (label, size, stride)."""
    message = Float64MultiArray(data=data)
    message.layout.data_offset = data_offset
    message.layout.dim = [
        MultiArrayDimension(label=label, size=size, stride=stride)
        for label, size, stride in dimensions
    ]
    return message


def padding_mask(layout: Layout) -> np.ndarray:
    """Return a mask of the padding bytes of a layout."""
    return ~layout.forms[1:].any(axis=0)


def assert_same(ours: bytes, message: Any, layout: Layout) -> None:
    """
    Compare our bytes with those of two other serialisers.

    The serialiser of ROS 2 leaves earlier memory in padding bytes; rosbags zeroes them.
    """
    theirs = serialize_message(message)
    assert len(ours) == len(theirs) == layout.size
    differing = np.frombuffer(ours, np.uint8) != np.frombuffer(theirs, np.uint8)
    assert not differing[~padding_mask(layout)].any()
    assert deserialize_message(ours, type(message)) == message
    name = f'{type(message).__module__.split(".")[0]}/msg/{type(message).__name__}'
    again = STORE.serialize_cdr(STORE.deserialize_cdr(ours, name), name)
    assert ours == bytes(again)


@given(STAMPS, vectors(7), vectors(7), vectors(7))
def test_joint_state_serialised_equals_rclpy(
    stamp: int, position: list[float], velocity: list[float], effort: list[float]
) -> None:
    ours = JointStateCdr()
    ours.set_stamp(stamp)
    ours.position[:] = position
    ours.velocity[:] = velocity
    ours.effort[:] = effort
    message = JointState(name=list(JOINTS), position=position, velocity=velocity, effort=effort)
    message.header.stamp = time(stamp)
    assert_same(ours.to_bytes(), message, joint_state_layout())


@given(STAMPS, vectors(4))
def test_effort_command_serialised_equals_rclpy(stamp: int, torques: list[float]) -> None:
    ours = EffortCdr()
    ours.set_stamp(stamp)
    ours.data[:] = torques
    label = f'effort@{stamp // 10**9}.{stamp % 10**9:09d}'
    message = array([(label, 4, 4)], 0, torques)
    layout = EFFORT.layout(len(label) - len('effort@'))
    assert_same(ours.to_bytes(), message, layout)


@given(STAMPS, vectors(2))
def test_arm_velocity_command_serialised_equals_rclpy(stamp: int, rates: list[float]) -> None:
    ours = ArmVelocityCdr()
    ours.set_stamp(stamp)
    ours.data[:] = rates
    label = f'velocity@{stamp // 10**9}.{stamp % 10**9:09d}'
    layout = ARM_VELOCITY.layout(len(label) - len('velocity@'))
    assert_same(ours.to_bytes(), array([(label, 2, 2)], 0, rates), layout)


@pytest.mark.parametrize(('label', 'count'), TELEMETRY.items())
@given(st.data(), STAMPS)
def test_telemetry_serialised_equals_rclpy(
    label: str, count: int, data: st.DataObject, stamp: int
) -> None:
    values = data.draw(vectors(count))
    ours = TelemetryCdr(label, count)
    ours.set_stamp(stamp)
    ours.values[:] = values
    head = [float(stamp // 10**9), float(stamp % 10**9)]
    message = array([(label, count, count)], 2, head + values)
    assert_same(ours.to_bytes(), message, telemetry_layout(label, count))
    assert ours.stamp_ns == stamp


@given(st.data(), STAMPS, st.integers(1, 20))
def test_reference_window_serialised_equals_rclpy(
    data: st.DataObject, stamp: int, count: int
) -> None:
    samples = data.draw(vectors(12 * count))
    ours = ReferenceWindow(stamp, 0.001, np.reshape(samples, (count, 3, 4))).to_bytes()
    head = [float(stamp // 10**9), float(stamp % 10**9), 0.001]
    dimensions = [('samples', count, 12 * count), ('derivative', 3, 12), ('task', 4, 4)]
    assert_same(ours, array(dimensions, 3, head + samples), reference_layout(count))


@given(vectors(12))
def test_set_point_serialised_equals_rclpy(numbers: list[float]) -> None:
    ours = ReferenceWindow(None, 0.0, np.reshape(numbers, (1, 3, 4))).to_bytes()
    assert_same(ours, array([('', 12, 12)], 0, numbers), multi_array_layout([('', 12)], 0))


@given(vectors(6))
def test_twist_serialised_equals_rclpy(numbers: list[float]) -> None:
    ours = TwistCdr()
    ours.linear[:] = numbers[:3]
    ours.angular[:] = numbers[3:]
    message = Twist()
    message.linear.x, message.linear.y, message.linear.z = numbers[:3]
    message.angular.x, message.angular.y, message.angular.z = numbers[3:]
    assert_same(ours.to_bytes(), message, twist_layout())


@pytest.mark.parametrize('prefix', ['', 'left/'])
@given(STAMPS, vectors(6))
def test_stamped_twist_serialised_equals_rclpy(
    prefix: str, stamp: int, numbers: list[float]
) -> None:
    ours = TwistStampedCdr(prefix)
    ours.set_stamp(stamp)
    ours.linear[:] = numbers[:3]
    ours.angular[:] = numbers[3:]
    message = TwistStamped()
    message.header.frame_id = f'{prefix}base_link'
    message.header.stamp = time(stamp)
    twist = message.twist
    twist.linear.x, twist.linear.y, twist.linear.z = numbers[:3]
    twist.angular.x, twist.angular.y, twist.angular.z = numbers[3:]
    assert_same(ours.to_bytes(), message, twist_stamped_layout(prefix))


@given(STAMPS, vectors(13), vectors(72))
def test_odometry_serialised_equals_rclpy(
    stamp: int, numbers: list[float], covariances: list[float]
) -> None:
    ours = OdometryCdr()
    ours.set_stamp(stamp)
    ours.position[:] = numbers[:3]
    ours.orientation[:] = numbers[3:7]
    ours.linear[:] = numbers[7:10]
    ours.angular[:] = numbers[10:]
    ours.pose_covariance[:] = covariances[:36]
    ours.twist_covariance[:] = covariances[36:]
    message = Odometry(child_frame_id='base_link')
    message.header.frame_id = 'odom'
    message.header.stamp = time(stamp)
    pose, twist = message.pose.pose, message.twist.twist
    pose.position.x, pose.position.y, pose.position.z = numbers[:3]
    orientation = pose.orientation
    orientation.x, orientation.y, orientation.z, orientation.w = numbers[3:7]
    twist.linear.x, twist.linear.y, twist.linear.z = numbers[7:10]
    twist.angular.x, twist.angular.y, twist.angular.z = numbers[10:]
    message.pose.covariance = covariances[:36]
    message.twist.covariance = covariances[36:]
    assert_same(ours.to_bytes(), message, odometry_layout())


def test_odometry_new_message_has_identity_orientation() -> None:
    assert OdometryCdr().orientation.tolist() == [0.0, 0.0, 0.0, 1.0]


@given(STAMPS)
def test_time_and_clock_serialised_equal_rclpy(stamp: int) -> None:
    ours = TimeCdr()
    ours.set_stamp(stamp)
    assert_same(ours.to_bytes(), time(stamp), time_layout())
    assert_same(ours.to_bytes(), Clock(clock=time(stamp)), time_layout())


@pytest.mark.parametrize(
    'make',
    [
        JointStateCdr,
        EffortCdr,
        ArmVelocityCdr,
        OdometryCdr,
        TwistCdr,
        TwistStampedCdr,
        TimeCdr,
        lambda: TelemetryCdr('tracking_error', 4),
    ],
)
def test_layout_load_of_rclpy_message_succeeds(make: Callable[[], Any]) -> None:
    types = {
        JointStateCdr: JointState,
        EffortCdr: Float64MultiArray,
        ArmVelocityCdr: Float64MultiArray,
        TwistStampedCdr: TwistStamped,
        OdometryCdr: Odometry,
        TwistCdr: Twist,
        TimeCdr: Time,
        TelemetryCdr: Float64MultiArray,
    }
    ours = make()
    raw = ours.to_bytes()
    for _ in range(20):
        # A serialiser that leaves old memory between the fields does so in every attempt.
        sent = serialize_message(deserialize_message(raw, types[type(ours)]))
        assert ours.load(sent)
        assert ours.to_bytes() == raw


def test_joint_state_of_rclpy_is_read_by_joint_name() -> None:
    message = JointState(
        name=['gripper', *reversed(JOINTS)],
        position=[9.0, *map(float, range(7))],
        velocity=[9.0, *map(float, range(10, 17))],
    )
    message.header.stamp = time(1_500_000_000)
    state = JointStateCdr()
    raw = serialize_message(message)
    assert not state.load(raw)
    state.load_message(deserialize_message(raw, JointState))
    assert state.position.tolist() == [6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0]
    assert state.velocity.tolist() == [16.0, 15.0, 14.0, 13.0, 12.0, 11.0, 10.0]
    assert not state.effort.any()
    assert state.stamp_ns == 1_500_000_000


def test_effort_command_void_is_marked_by_offset() -> None:
    """Other readers see four zeros. Both the compiled reader and rclpy detect the offset."""
    ours = EffortCdr()
    ours.set_stamp(1_500_000_000)
    plain = ours.to_bytes()
    ours.is_void = True
    raw = ours.to_bytes()
    message = deserialize_message(raw, Float64MultiArray)
    assert list(message.data) == [0.0] * 4
    assert message.layout.data_offset == 4
    assert message.layout.dim[0].label == 'effort@1.500000000'
    for sent, is_void in ((plain, False), (raw, True)):
        quick, slow = EffortCdr(), EffortCdr()
        quick.is_void = slow.is_void = not is_void
        assert quick.load(sent)
        slow.load_message(deserialize_message(sent, Float64MultiArray))
        assert quick.is_void == slow.is_void == is_void
        assert quick.stamp_ns == slow.stamp_ns == 1_500_000_000
        assert quick.to_bytes() == sent
    # A command with any other offset is a normal command.
    message.layout.data_offset = 7
    other = EffortCdr()
    assert not other.load(serialize_message(message))
    other.load_message(message)
    assert not other.is_void


def test_effort_command_unlabelled_is_read() -> None:
    """Senders for ros2_control's effort controllers publish such messages."""
    raw = serialize_message(Float64MultiArray(data=[1.0, 2.0, 3.0, 4.0]))
    command = EffortCdr()
    assert not command.load(raw)
    command.load_message(deserialize_message(raw, Float64MultiArray))
    assert command.data.tolist() == [1.0, 2.0, 3.0, 4.0]
    assert command.stamp_ns is None
    assert len(DRIVEN_JOINTS) == len(command.data)


@pytest.mark.parametrize('count', [4, 8, 12])
def test_set_point_without_layout_is_read(count: int) -> None:
    raw = serialize_message(Float64MultiArray(data=[float(n) for n in range(count)]))
    assert ReferenceWindow.from_bytes(raw) is None
    window = ReferenceWindow.from_message(deserialize_message(raw, Float64MultiArray))
    assert window.stamp_ns is None
    assert window.samples.ravel().tolist() == [*range(count), *[0.0] * (12 - count)]
