# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Compiled readers and writers of messages, compared with NumPy records."""

import re
from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st
from masmc_ros.messages.cdr_layout import END_OF_TIME, NANOSECONDS, stamps_of, UNREAD
from masmc_ros.messages.commands import ArmVelocityCdr, CommandWriter, EffortCdr, LabelledCdr
from masmc_ros.messages.joint_state import joint_state_layout, JointStateCdr
from masmc_ros.messages.telemetry import TelemetryCdr
import numpy as np
import pytest

ROBOTS = (
    ('base_x', 'base_y', 'base_yaw', 'left', 'right', 'shoulder', 'elbow'),
    ('slide', 'swing'),
    ('x', 'y', 'yaw', *(f'joint_{k}' for k in range(1, 12))),
)

STAMPS = st.integers(0, END_OF_TIME - 1) | st.builds(
    lambda digits, less: 10**digits * NANOSECONDS - less, st.integers(0, 9), st.integers(0, 1)
)
NUMBERS = st.floats(width=64)
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def drawn(data: st.DataObject, count: int, numbers: st.SearchStrategy[float]) -> Any:
    return np.array(data.draw(st.lists(numbers, min_size=count, max_size=count)))


def damaged(data: st.DataObject, raw: bytes) -> bytes:
    """Return a message with some bytes changed, more of them, or fewer."""
    changed = bytearray(raw)
    for _ in range(data.draw(st.integers(0, 3))):
        place = data.draw(st.integers(0, len(changed) - 1))
        changed[place] = data.draw(st.integers(0, 255))
    cut = data.draw(st.sampled_from([0, 0, 0, 1, 8]))
    kept = changed[:-cut] if cut else changed
    return bytes(kept) + data.draw(st.sampled_from([b'', b'', b'\0']))


# Joint states.


@pytest.mark.parametrize('names', ROBOTS)
@given(data=st.data(), stamp=STAMPS)
def test_state_writer_equals_record(
    names: tuple[str, ...], data: st.DataObject, stamp: int
) -> None:
    joints = len(names)
    position, velocity = drawn(data, joints, NUMBERS), drawn(data, joints, NUMBERS)
    effort = drawn(data, data.draw(st.integers(1, joints)), NUMBERS)
    message = JointStateCdr(names)
    message.position[:], message.velocity[:] = position, velocity
    message.effort[-len(effort):] = effort
    message.set_stamp(stamp)
    assert JointStateCdr(names).writer(position, velocity, effort)(stamp) == message.to_bytes()


def state_by_record(raw: bytes, names: tuple[str, ...]) -> tuple[int, Any]:
    """Return the stamp in ns, or UNREAD, and the record of a state."""
    layout = joint_state_layout(names)
    if len(raw) != layout.size:
        return UNREAD, None
    (is_ours,), (record,) = layout.read([raw])
    stamp = int(stamps_of(record['header_stamp']))
    is_usable = np.isfinite([record['position'], record['velocity']]).all() and stamp < END_OF_TIME
    # Seconds are signed: one that is negative reads as a time before 0.
    return (stamp, record) if is_ours and is_usable and stamp >= 0 else (UNREAD, None)


@pytest.mark.parametrize('names', ROBOTS)
@given(data=st.data(), stamp=st.integers(0, 2**32 - 1).map(lambda s: s * NANOSECONDS) | STAMPS)
def test_state_reader_equals_record(
    names: tuple[str, ...], data: st.DataObject, stamp: int
) -> None:
    message = JointStateCdr(names)
    numbers = data.draw(st.sampled_from([FINITE, NUMBERS]))
    for row in (message.position, message.velocity, message.effort):
        row[:] = drawn(data, len(names), numbers)
    raw = bytearray(message.to_bytes())
    raw[4:12] = np.array(divmod(stamp, NANOSECONDS), np.uint32).tobytes()
    received = damaged(data, bytes(raw))
    state = JointStateCdr(names)
    before = state.to_bytes()
    expected, record = state_by_record(received, names)
    assert state.read(received) == expected
    if record is None:
        assert state.to_bytes() == before
    else:
        assert state.stamp_ns == expected
        for field in ('position', 'velocity', 'effort'):
            assert getattr(state, field).tobytes() == record[field].tobytes()


def test_state_reader_foreign_padding_not_copied() -> None:
    names = ROBOTS[0]
    message, state = JointStateCdr(names), JointStateCdr(names)
    message.position[:] = range(7)
    message.set_stamp(5)
    raw = message.to_bytes()
    is_padding = ~joint_state_layout(names).forms[1:].any(axis=0)
    assert is_padding.any()
    foreign = np.where(is_padding, np.uint8(0xA5), np.frombuffer(raw, np.uint8)).tobytes()
    assert foreign != raw
    assert state.read(foreign) == 5
    assert state.to_bytes() == raw


# Commands.


@pytest.mark.parametrize('kind', [EffortCdr, ArmVelocityCdr])
@pytest.mark.parametrize('is_void', [False, True])
@given(data=st.data(), stamps=st.lists(STAMPS, min_size=1, max_size=4))
def test_command_writer_equals_record(
    kind: type[LabelledCdr], is_void: bool, data: st.DataObject, stamps: list[int]
) -> None:
    command = kind()
    command.is_void = is_void
    numbers = np.zeros(len(command.data))
    writer = CommandWriter(command.kind, numbers, is_void=is_void)
    for stamp in stamps:
        numbers[:] = drawn(data, len(numbers), NUMBERS)
        command.data[:] = numbers
        command.set_stamp(stamp)
        assert writer.to_bytes(stamp) == command.to_bytes()


def command_by_record(raw: bytes, kind: LabelledCdr) -> tuple[int, Any]:
    """Return the stamp in ns, or UNREAD, and the record of a command."""
    layout = kind.kind.layout_of(raw)
    if layout is None or len(raw) != layout.size:
        return UNREAD, None
    (is_ours,), (record,) = layout.read([raw])
    label = re.fullmatch(rb'(\d{1,10})\.(\d{9})', record['layout_dim_0_label'].tobytes())
    offset = record['layout_data_offset']
    is_usable = np.isfinite(record['data']).all() and offset in (0, len(kind.data))
    if not (is_ours and is_usable and label and int(label[1]) < END_OF_TIME // NANOSECONDS):
        return UNREAD, None
    return int(label[1]) * NANOSECONDS + int(label[2]), record


@pytest.mark.parametrize('kind', [EffortCdr, ArmVelocityCdr])
@given(data=st.data(), stamps=st.lists(STAMPS, min_size=1, max_size=4))
def test_command_reader_equals_record(
    kind: type[LabelledCdr], data: st.DataObject, stamps: list[int]
) -> None:
    message, command = kind(), kind()
    for stamp in stamps:
        some = data.draw(st.sampled_from([FINITE, FINITE, NUMBERS]))
        message.data[:] = drawn(data, len(message.data), some)
        message.is_void = data.draw(st.sampled_from([False, False, True]))
        message.set_stamp(stamp)
        raw = damaged(data, message.to_bytes())
        before = command.to_bytes()
        expected, record = command_by_record(raw, command)
        assert command.load(raw) is (record is not None)
        if record is None:
            assert command.to_bytes() == before
        else:
            assert command.stamp_ns == expected
            assert command.is_void is bool(record['layout_data_offset'])
            assert command.data.tobytes() == record['data'].tobytes()


@pytest.mark.parametrize('number', [np.nan, np.inf, -np.inf])
def test_readers_number_not_finite_left_to_rclpy(number: float) -> None:
    state = JointStateCdr(ROBOTS[0])
    for row in (state.position, state.velocity):
        row[3] = number
        assert JointStateCdr(ROBOTS[0]).read(state.to_bytes()) == UNREAD
        row[3] = 0.0
    state.effort[3] = number
    assert JointStateCdr(ROBOTS[0]).read(state.to_bytes()) == 0
    command = EffortCdr()
    command.data[2] = number
    assert not EffortCdr().load(command.to_bytes())


@pytest.mark.parametrize(
    'digits', [b'12.00000000x', b'1x.000000034', b'12,000000034', b'12.0000000 4', b'-2.000000034']
)
def test_command_reader_label_without_stamp_left_to_rclpy(digits: bytes) -> None:
    command = EffortCdr()
    command.set_stamp(12_000_000_034)
    raw = command.to_bytes()
    assert EffortCdr().load(raw)
    assert not EffortCdr().load(raw.replace(b'12.000000034', digits))


# Telemetry.


@given(data=st.data(), stamp=STAMPS, count=st.integers(1, 30))
@example(data=None, stamp=END_OF_TIME - 1, count=1)
def test_telemetry_writer_equals_record(
    data: st.DataObject | None, stamp: int, count: int
) -> None:
    values = np.ones(count) if data is None else drawn(data, count, NUMBERS)
    slow = TelemetryCdr('sliding_surface', count)
    slow.values[:] = values
    slow.set_stamp(stamp)
    assert TelemetryCdr('sliding_surface', count).writer(values)(stamp) == slow.to_bytes()
