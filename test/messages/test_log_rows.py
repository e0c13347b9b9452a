# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages written in bulk against messages written one by one."""

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from masmc_ros.messages.commands import ARM_VELOCITY, ArmVelocityCdr, EFFORT, EffortCdr
from masmc_ros.messages.joint_state import joint_state_layout, JointStateCdr
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
from masmc_ros.messages.telemetry import telemetry_messages, TelemetryCdr
import numpy as np

STAMPS = hnp.arrays(np.int64, st.integers(0, 12), elements=st.integers(0, 2**31 * 10**9 - 1))


def numbers(count: int, width: int) -> np.ndarray:
    """Return (count, width) different numbers."""
    return np.random.default_rng(width).standard_normal((count, width))


@given(STAMPS)
def test_joint_states_in_bulk_equal_single_messages(stamps: np.ndarray) -> None:
    values = numbers(len(stamps), 21)
    position, velocity, effort = np.split(values, 3, axis=1)
    rows = joint_state_layout().messages(
        header_stamp=stamps, position=position, velocity=velocity, effort=effort
    )
    message = JointStateCdr()
    assert len(rows) == len(stamps)
    for stamp, value, row in zip(stamps.tolist(), values, rows, strict=True):
        message.set_stamp(stamp)
        message.position[:], message.velocity[:], message.effort[:] = np.split(value, 3)
        assert row.tobytes() == message.to_bytes()


@given(STAMPS)
def test_effort_commands_in_bulk_equal_single_messages(stamps: np.ndarray) -> None:
    values = numbers(len(stamps), 4)
    message = EffortCdr()
    seen = []
    is_void = values[:, 0] > 0.0
    for indices, rows in EFFORT.messages(stamps, values, is_void):
        seen += indices.tolist()
        for index, row in zip(indices.tolist(), rows, strict=True):
            message.set_stamp(int(stamps[index]))
            message.data[:] = values[index]
            message.is_void = bool(is_void[index])
            assert row.tobytes() == message.to_bytes()
    assert sorted(seen) == list(range(len(stamps)))


@given(STAMPS)
def test_arm_velocities_and_twists_in_bulk_equal_single_messages(stamps: np.ndarray) -> None:
    values = numbers(len(stamps), 8)
    arm, twist = ArmVelocityCdr(), TwistStampedCdr('left/')
    twists = twist_stamped_layout('left/').messages(
        header_stamp=stamps, twist=values[:, 2:]
    )
    for indices, rows in ARM_VELOCITY.messages(stamps, values[:, :2]):
        for index, row in zip(indices.tolist(), rows, strict=True):
            for message in (arm, twist):
                message.set_stamp(int(stamps[index]))
            arm.data[:] = values[index, :2]
            twist.linear[:], twist.angular[:] = values[index, 2:5], values[index, 5:]
            assert row.tobytes() == arm.to_bytes()
            assert twists[index].tobytes() == twist.to_bytes()


@given(STAMPS)
def test_telemetry_in_bulk_equals_single_messages(stamps: np.ndarray) -> None:
    values = numbers(len(stamps), 7)
    rows = telemetry_messages('parameter_estimate', stamps, values)
    message = TelemetryCdr('parameter_estimate', 7)
    for stamp, value, row in zip(stamps.tolist(), values, rows, strict=True):
        message.set_stamp(stamp)
        message.values[:] = value
        assert row.tobytes() == message.to_bytes()


@given(STAMPS)
def test_odometry_twist_and_clock_in_bulk_equal_single_messages(stamps: np.ndarray) -> None:
    values = numbers(len(stamps), 13)
    odometry, twist, clock = OdometryCdr(), TwistCdr(), TimeCdr()
    all_rows = zip(
        odometry_layout().messages(
            header_stamp=stamps, pose_pose=values[:, :7], twist_twist=values[:, 7:]
        ),
        twist_layout().messages(numbers=values[:, 7:]),
        time_layout().messages(clock=stamps),
        strict=True,
    )
    for stamp, value, (odometry_row, twist_row, time_row) in zip(
        stamps.tolist(), values, all_rows, strict=True
    ):
        odometry.set_stamp(stamp)
        clock.set_stamp(stamp)
        odometry.position[:] = value[:3]
        odometry.orientation[:] = value[3:7]
        odometry.linear[:] = twist.linear[:] = value[7:10]
        odometry.angular[:] = twist.angular[:] = value[10:]
        assert odometry_row.tobytes() == odometry.to_bytes()
        assert twist_row.tobytes() == twist.to_bytes()
        assert time_row.tobytes() == clock.to_bytes()
