# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Compiled readers and writers of the ticks against the message classes."""

from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.messages.commands import ArmVelocityCdr, EffortCdr, LabelledCdr
from masmc_ros.messages.hot_path import (
    CommandReader,
    CommandWriter,
    StateReader,
    StateWriter,
    TelemetryWriter,
    UNREAD,
)
from masmc_ros.messages.joint_state import joint_state_layout, JointStateCdr
from masmc_ros.messages.layout import checked_stamp, END_OF_TIME, NANOSECONDS
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


def same(first: Any, second: Any) -> bool:
    """Return True if two arrays are bitwise identical."""
    return bool(first.tobytes() == second.tobytes())


def damaged(data: st.DataObject, raw: bytes) -> bytes:
    """Return a message with changed, additional or missing bytes."""
    damaged_bytes = bytearray(raw)
    for _ in range(data.draw(st.integers(0, 3))):
        place = data.draw(st.integers(0, len(damaged_bytes) - 1))
        damaged_bytes[place] = data.draw(st.integers(0, 255))
    cut = data.draw(st.sampled_from([0, 0, 0, 1, 8]))
    end = data.draw(st.sampled_from([b'', b'', b'\0']))
    return bytes(damaged_bytes[:-cut] if cut else damaged_bytes) + end


# Joint states.


@pytest.mark.parametrize('names', ROBOTS)
@given(data=st.data(), stamp=STAMPS)
def test_state_writer_bytes_equal_message_class(
    names: tuple[str, ...], data: st.DataObject, stamp: int
) -> None:
    joints = len(names)
    position, velocity = drawn(data, joints, NUMBERS), drawn(data, joints, NUMBERS)
    effort = drawn(data, data.draw(st.integers(1, joints)), NUMBERS)
    slow = JointStateCdr(names)
    slow.position[:], slow.velocity[:], slow.effort[-len(effort):] = position, velocity, effort
    slow.set_stamp(stamp)
    writer = StateWriter(JointStateCdr(names), position, velocity, effort)
    assert writer.to_bytes(stamp) == slow.to_bytes()


def state_of(raw: bytes, names: tuple[str, ...]) -> tuple[int, JointStateCdr] | None:
    """Read a state with the message class; None for a rejected state."""
    state = JointStateCdr(names)
    if not (state.load(raw) and state.is_finite()):
        return None
    try:
        return checked_stamp(state.stamp_ns), state
    except InputError:
        return None


@pytest.mark.parametrize('names', ROBOTS)
@given(data=st.data(), stamp=st.integers(0, 2**32 - 1).map(lambda s: s * NANOSECONDS) | STAMPS)
def test_state_reader_result_equals_message_class(
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
    stamp_read = StateReader(state).read(received, state)
    expected = state_of(received, names)
    if expected is None:
        assert stamp_read == UNREAD
    else:
        assert stamp_read == expected[0]
        assert state.to_bytes() == expected[1].to_bytes()


def test_state_reader_foreign_padding_is_not_copied() -> None:
    names = ROBOTS[0]
    message, state = JointStateCdr(names), JointStateCdr(names)
    message.position[:] = range(7)
    message.set_stamp(5)
    layout = joint_state_layout(names)
    raw, varies = message.to_bytes(), np.zeros(layout.size, bool)
    for place in layout.places.values():
        varies[place] = True
    aligns = ~varies & (np.frombuffer(layout.mask, np.uint8) == 0)
    assert aligns.any()
    foreign = np.where(aligns, np.uint8(0xA5), np.frombuffer(raw, np.uint8)).tobytes()
    assert foreign != raw
    assert StateReader(state).read(foreign, state) == 5
    assert state.to_bytes() == raw


# Commands.


@pytest.mark.parametrize('kind', [EffortCdr, ArmVelocityCdr])
@given(data=st.data(), stamps=st.lists(STAMPS, min_size=1, max_size=4))
def test_command_writer_bytes_equal_message_class(
    kind: type[LabelledCdr], data: st.DataObject, stamps: list[int]
) -> None:
    slow = kind()
    numbers = np.zeros(len(slow.data))
    writer = CommandWriter(slow.kind, numbers)
    for stamp in stamps:
        numbers[:] = drawn(data, len(numbers), NUMBERS)
        slow.data[:] = numbers
        slow.set_stamp(stamp)
        assert writer.to_bytes(stamp) == slow.to_bytes()


def command_of(raw: bytes, kind: type[LabelledCdr]) -> LabelledCdr | None:
    """Read a command with the message class; None for a rejected or void command."""
    command = kind()
    try:
        is_ours = command.load(raw)
    except InputError:
        return None
    return command if is_ours and command.is_finite() and not command.is_void else None


@pytest.mark.parametrize('kind', [EffortCdr, ArmVelocityCdr])
@given(data=st.data(), stamps=st.lists(STAMPS, min_size=1, max_size=4))
def test_command_reader_result_equals_message_class(
    kind: type[LabelledCdr], data: st.DataObject, stamps: list[int]
) -> None:
    message, received = kind(), kind()
    reader = CommandReader(received)
    for stamp in stamps:
        some = data.draw(st.sampled_from([FINITE, FINITE, NUMBERS]))
        message.data[:] = drawn(data, len(message.data), some)
        message.is_void = data.draw(st.sampled_from([False, False, True]))
        message.set_stamp(stamp)
        raw = damaged(data, message.to_bytes())
        stamp_read, expected = reader.read(raw), command_of(raw, kind)
        if stamp_read == UNREAD:
            # Seconds with ten digits and incomplete fractions are left to the class.
            is_usual = len(str(stamp // NANOSECONDS)) < 10 and raw == message.to_bytes()
            assert expected is None or not is_usual
        else:
            assert expected is not None
            assert stamp_read == expected.stamp_ns
            assert same(received.data, expected.data)


@pytest.mark.parametrize('number', [np.nan, np.inf, -np.inf])
def test_compiled_readers_non_finite_numbers_are_unread(number: float) -> None:
    state = JointStateCdr(ROBOTS[0])
    reader = StateReader(state)
    for row in (state.position, state.velocity):
        row[3] = number
        assert reader.read(state.to_bytes(), JointStateCdr(ROBOTS[0])) == UNREAD
        row[3] = 0.0
    state.effort[3] = number
    assert reader.read(state.to_bytes(), JointStateCdr(ROBOTS[0])) == 0
    command = EffortCdr()
    command.data[2] = number
    assert CommandReader(EffortCdr()).read(command.to_bytes()) == UNREAD


@pytest.mark.parametrize(
    'digits', [b'12.00000000x', b'1x.000000034', b'12,000000034', b'12.0000000 4', b'-2.000000034']
)
def test_command_reader_label_without_stamp_is_unread(digits: bytes) -> None:
    command = EffortCdr()
    command.set_stamp(12_000_000_034)
    raw = command.to_bytes()
    reader = CommandReader(EffortCdr())
    assert reader.read(raw) == 12_000_000_034
    assert reader.read(raw.replace(b'12.000000034', digits)) == UNREAD


# Telemetry.


@given(data=st.data(), stamp=STAMPS, count=st.integers(1, 30))
@example(data=None, stamp=END_OF_TIME - 1, count=1)
def test_telemetry_writer_bytes_equal_message_class(
    data: st.DataObject | None, stamp: int, count: int
) -> None:
    values = np.ones(count) if data is None else drawn(data, count, NUMBERS)
    slow = TelemetryCdr('sliding_surface', count)
    slow.values[:] = values
    slow.set_stamp(stamp)
    writer = TelemetryWriter(TelemetryCdr('sliding_surface', count), values)
    assert writer.to_bytes(stamp) == slow.to_bytes()
