# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""TFMessages in fixed layouts against other serialisers."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.messages.stamps import stamp_reader
from masmc_ros.messages.transforms import (
    first_frames,
    is_of_robot,
    transforms_layout,
    transforms_messages,
    TransformsCdr,
)
from masmc_ros.robot.two_link.paper_robot import FRAMES
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = 'tf2_msgs/msg/TFMessage'
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
PREFIXES = st.text('abcdefg/_', max_size=9)


def numbers(seed: int) -> np.ndarray:
    """Return different numbers for all transforms."""
    return np.random.default_rng(seed).standard_normal((len(FRAMES), 7))


def serialised(prefix: str, stamp: int, transforms: np.ndarray) -> bytes:
    """Return the message serialised by rosbags."""
    t = STORE.types
    time = t['builtin_interfaces/msg/Time'](sec=stamp // 10**9, nanosec=stamp % 10**9)
    message = t[TYPE](
        transforms=[
            t['geometry_msgs/msg/TransformStamped'](
                header=t['std_msgs/msg/Header'](stamp=time, frame_id=prefix + parent),
                child_frame_id=prefix + child,
                transform=t['geometry_msgs/msg/Transform'](
                    translation=t['geometry_msgs/msg/Vector3'](*row[:3].tolist()),
                    rotation=t['geometry_msgs/msg/Quaternion'](*row[3:].tolist()),
                ),
            )
            for (parent, child), row in zip(FRAMES, transforms, strict=True)
        ]
    )
    return bytes(STORE.serialize_cdr(message, TYPE))


@given(PREFIXES, STAMPS, st.integers(0, 2**32))
def test_transforms_single_message_equals_rosbags(prefix: str, stamp: int, seed: int) -> None:
    ours = TransformsCdr(prefix)
    ours.fill(1, numbers(seed + 1))  # its numbers must not remain
    raw = ours.fill(stamp, numbers(seed))
    assert raw == serialised(prefix, stamp, numbers(seed))
    assert stamp_reader('/tf', TYPE)(raw) == stamp


@given(PREFIXES, st.lists(STAMPS, max_size=5))
def test_transforms_in_bulk_equal_rosbags(prefix: str, stamps: list[int]) -> None:
    transforms = np.array([numbers(k) for k in range(len(stamps))]).reshape(-1, len(FRAMES), 7)
    rows = transforms_messages(np.array(stamps, dtype=np.int64), transforms, prefix)
    assert len(rows) == len(stamps)
    for stamp, frame_rows, row in zip(stamps, transforms, rows, strict=True):
        assert row.tobytes() == serialised(prefix, stamp, frame_rows)


def test_transforms_empty_message_has_no_stamp() -> None:
    empty = bytes(STORE.serialize_cdr(STORE.types[TYPE](transforms=[]), TYPE))
    assert stamp_reader('/tf', TYPE)(empty) is None


def transform(parent: str, child: str) -> bytes:
    """Return a message of another sender with one transform."""
    t = STORE.types
    time = t['builtin_interfaces/msg/Time'](sec=1, nanosec=2)
    message = t[TYPE](
        transforms=[
            t['geometry_msgs/msg/TransformStamped'](
                header=t['std_msgs/msg/Header'](stamp=time, frame_id=parent),
                child_frame_id=child,
                transform=t['geometry_msgs/msg/Transform'](
                    translation=t['geometry_msgs/msg/Vector3'](1.0, 2.0, 3.0),
                    rotation=t['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0),
                ),
            )
        ]
    )
    return bytes(STORE.serialize_cdr(message, TYPE))


@given(st.text(max_size=20), st.text(max_size=20))
def test_first_frames_equal_those_of_message(parent: str, child: str) -> None:
    parent, child = parent.replace('\0', ''), child.replace('\0', '')
    assert first_frames(transform(parent, child)) == (parent, child)


@given(st.binary(max_size=60))
def test_first_frames_random_bytes_do_not_raise(raw: bytes) -> None:
    for frame in first_frames(raw):
        assert len(frame) <= len(raw)


@pytest.mark.parametrize(
    ('parent', 'child', 'owners'),
    [
        ('left/odom', 'left/base_link', {'left/'}),
        ('map', 'left/odom', {'left/', ''}),
        ('odom', 'base_link', {''}),
        ('right/odom', 'right/base_link', set()),
        ('leftover/odom', 'leftover/base_link', set()),
    ],
)
def test_is_of_robot_follows_frame_prefix(
    parent: str, child: str, owners: set[str]
) -> None:
    raw = transform(parent, child)
    assert {prefix for prefix in ('', 'left/') if is_of_robot(raw, prefix)} == owners


@pytest.mark.parametrize('prefix', ['', 'left/'])
def test_transforms_of_rclpy_are_loaded(prefix: str) -> None:
    messages = pytest.importorskip('tf2_msgs.msg', reason='compares with ROS 2')
    from rclpy.serialization import deserialize_message, serialize_message

    raw = TransformsCdr(prefix).fill(1_500_000_000, numbers(0))
    again = serialize_message(deserialize_message(raw, messages.TFMessage))
    # Padding bytes may have any value.
    assert transforms_layout(prefix).read([again])[0].all()
    ours = TransformsCdr(prefix)
    assert ours.load(again)
    assert ours.to_bytes() == raw
