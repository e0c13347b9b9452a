# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Received messages: the project's layout is loaded, any other one is rejected."""

from functools import partial
from types import SimpleNamespace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.messages.commands import ARM_VELOCITY, ArmVelocityCdr, EFFORT, EffortCdr
from masmc_ros.messages.joint_state import joint_state_layout, JointStateCdr
from masmc_ros.messages.platform_messages import twist_stamped_layout, TwistStampedCdr
from masmc_ros.messages.reference_window import reference_layout, ReferenceWindow
from masmc_ros.messages.telemetry import telemetry_layout, TelemetryCdr
from masmc_ros.messages.topics import JOINTS
import numpy as np
import pytest


def state() -> JointStateCdr:
    """Return a state with different numbers in all fields."""
    message = JointStateCdr()
    message.position[:] = np.arange(1, 8)
    message.velocity[:] = np.arange(11, 18)
    message.effort[:] = np.arange(21, 28)
    message.set_stamp(12_000_000_034)
    return message


def command() -> EffortCdr:
    """Return a command with different numbers in all fields."""
    message = EffortCdr()
    message.data[:] = [1.0, 2.0, 3.0, 4.0]
    message.set_stamp(12_000_000_034)
    return message


def arm_command() -> ArmVelocityCdr:
    """Return an arm command with different numbers."""
    message = ArmVelocityCdr()
    message.data[:] = [1.0, 2.0]
    message.set_stamp(12_000_000_034)
    return message


def twist() -> TwistStampedCdr:
    """Return a stamped twist with different numbers in all fields."""
    message = TwistStampedCdr('left/')
    message.linear[:], message.angular[:] = [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]
    message.set_stamp(12_000_000_034)
    return message


def telemetry() -> TelemetryCdr:
    """Return telemetry with different numbers in all fields."""
    message = TelemetryCdr('tracking_error', 4)
    message.values[:] = [1.0, 2.0, 3.0, 4.0]
    message.set_stamp(12_000_000_034)
    return message


EMPTY = {
    state: JointStateCdr,
    command: EffortCdr,
    arm_command: ArmVelocityCdr,
    twist: partial(TwistStampedCdr, 'left/'),
    telemetry: partial(TelemetryCdr, 'tracking_error', 4),
}

MESSAGES = [
    (state, joint_state_layout()),
    (command, EFFORT.layout(12)),
    (arm_command, ARM_VELOCITY.layout(12)),
    (twist, twist_stamped_layout('left/')),
    (telemetry, telemetry_layout('tracking_error', 4)),
]


@pytest.mark.parametrize(('make', 'layout'), MESSAGES)
def test_layout_round_trip_restores_message(make: Any, layout: Any) -> None:
    raw = make().to_bytes()
    message = EMPTY[make]()
    assert message.to_bytes() != raw
    assert message.load(raw)
    assert message.to_bytes() == raw
    assert message.stamp_ns == 12_000_000_034


@pytest.mark.parametrize(('make', 'layout'), MESSAGES)
def test_layout_constant_byte_changed_is_not_loaded(make: Any, layout: Any) -> None:
    message = make()
    raw = message.to_bytes()
    for index in np.flatnonzero(layout.forms[1]):
        changed = bytearray(raw)
        changed[index] ^= 1
        assert not message.load(bytes(changed)), index
        assert message.to_bytes() == raw


@pytest.mark.parametrize(('make', 'layout'), MESSAGES)
@given(garbage=st.binary(min_size=1, max_size=1))
def test_layout_padding_bytes_are_ignored_and_not_copied(
    make: Any, layout: Any, garbage: bytes
) -> None:
    message = make()
    raw = message.to_bytes()
    flags = ~layout.forms[1:].any(axis=0)
    assert flags.any()
    changed = np.frombuffer(raw, np.uint8).copy()
    changed[flags] = garbage[0]
    assert message.load(changed.tobytes())
    assert message.to_bytes() == raw


@pytest.mark.parametrize(('make', 'layout'), MESSAGES)
@given(raw=st.binary(max_size=400))
def test_layout_random_bytes_are_not_loaded(make: Any, layout: Any, raw: bytes) -> None:
    message = make()
    before = message.to_bytes()
    assert not message.load(raw)
    assert not message.load(before[: len(raw) % len(before)])
    assert not message.load(before + b'\0')
    assert message.to_bytes() == before


def test_layout_number_fields_are_aligned_views() -> None:
    message = state()
    for view in (message.position, message.velocity, message.effort, telemetry().values):
        assert view.ctypes.data % 8 == 0
        assert view.flags.writeable
        assert view.base is not None
    before = message.position
    message.load(state().to_bytes())
    assert message.position is before


@given(st.integers(0, 2**31 - 1), st.integers(0, 10**9 - 1))
def test_command_label_without_padding_gives_stamp(seconds: int, nanoseconds: int) -> None:
    label = f'{seconds}.{nanoseconds}'
    layout = EFFORT.layout(len(label))
    raw = bytearray(layout.template)
    raw[layout.places['layout_dim_0_label']] = label.encode()
    message, stamp = command(), seconds * 10**9 + nanoseconds
    assert EFFORT.stamp_of(bytes(raw)) == stamp
    if not message.load(bytes(raw)):
        message.load_message(array([0.0] * 4, [(f'effort@{label}', 4)]))
    assert message.stamp_ns == stamp


@pytest.mark.parametrize(
    'label', ['12', '1.2.3', '-1.5', '1.-5', '.5', '5.', ' 1.5', '1_0.5', '1.0123456789', 'now']
)
def test_label_without_stamp_raises(label: str) -> None:
    layout = EFFORT.layout(len(label))
    raw = bytearray(layout.template)
    raw[layout.places['layout_dim_0_label']] = label.encode()
    message = command()
    before = message.to_bytes()
    assert not message.load(bytes(raw))
    assert message.to_bytes() == before
    with pytest.raises(InputError, match='is not effort@SECONDS'):
        message.load_message(array([4.0] * 4, [(f'effort@{label}', 4)]))


def array(
    data: list[float], dimensions: list[tuple[str, int]] | None = None, data_offset: int = 0
) -> Any:
    """Return a deserialised Float64MultiArray."""
    dim = [SimpleNamespace(label=label, size=size) for label, size in dimensions or []]
    return SimpleNamespace(layout=SimpleNamespace(dim=dim, data_offset=data_offset), data=data)


def joint_state(**fields: Any) -> Any:
    """Return a deserialised JointState of the project, with changes of `fields`."""
    numbers = [float(n) for n in range(7)]
    ours = {'name': list(JOINTS), 'position': numbers, 'velocity': numbers, 'effort': numbers}
    ours['header'] = header(1, 5)
    return SimpleNamespace(**(ours | fields))


def header(seconds: int, nanoseconds: int) -> Any:
    return SimpleNamespace(stamp=SimpleNamespace(sec=seconds, nanosec=nanoseconds))


@given(st.permutations(range(9)))
def test_joint_state_joints_in_any_order_are_read_by_name(order: list[int]) -> None:
    names = [*JOINTS, 'gripper', 'camera']
    message = joint_state(
        name=[names[n] for n in order],
        position=[float(n) for n in order],
        velocity=[10.0 + n for n in order],
        effort=[20.0 + n for n in order],
    )
    received = JointStateCdr()
    received.load_message(message)
    assert received.position.tolist() == [0, 1, 2, 3, 4, 5, 6]
    assert received.velocity.tolist() == [10, 11, 12, 13, 14, 15, 16]
    assert received.effort.tolist() == [20, 21, 22, 23, 24, 25, 26]
    assert received.stamp_ns == 1_000_000_005


def test_joint_state_nan_effort_is_read_as_zero() -> None:
    received = JointStateCdr()
    received.load_message(joint_state(effort=[float('nan')] * 6 + [3.0]))
    assert received.effort.tolist() == [0.0] * 6 + [3.0]


@pytest.mark.parametrize(
    ('fields', 'expected'),
    [
        ({'name': list(JOINTS[:-1])}, "joint 'arm_joint_2' is missing"),
        ({'name': [*JOINTS, 'arm_joint_1']}, "joint 'arm_joint_1' appears 2 times"),
        ({'position': [0.0] * 6}, 'position has 6 numbers for 7 joints'),
        ({'velocity': []}, 'velocity is empty; set velocity_source to estimated'),
        ({'velocity': [0.0] * 3}, 'velocity has 3 numbers for 7 joints'),
        ({'effort': [0.0] * 8}, 'effort has 8 numbers for 7 joints'),
        ({'position': [0.0] * 6 + [np.nan]}, "position of 'arm_joint_2' is not a finite"),
        ({'velocity': [np.inf] + [0.0] * 6}, "velocity of 'base_x_joint' is not a finite"),
        ({'effort': [np.inf] + [0.0] * 6}, "effort of 'base_x_joint' is not a finite"),
        ({'header': header(-1, 0)}, 'stamp -1000000000 ns is negative'),
        ({'header': header(2**31 - 1, 2**32 - 1)}, r'ns is beyond 2\*\*31 s'),
    ],
)
def test_joint_state_invalid_raises_and_keeps_content(
    fields: dict[str, Any], expected: str
) -> None:
    received = state()
    before = received.to_bytes()
    with pytest.raises(InputError, match=expected):
        received.load_message(joint_state(**fields))
    assert received.to_bytes() == before
    received.load_message(joint_state())
    assert received.position.tolist() == [0, 1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ('data', 'expected'),
    [
        ([1.0] * 4, '4 numbers; expected 2, the rates of arm_joint_1, arm_joint_2'),
        ([1.0, np.nan], "rate of 'arm_joint_2' is not a finite"),
    ],
)
def test_arm_velocity_command_invalid_raises(data: list[float], expected: str) -> None:
    received = arm_command()
    before = received.to_bytes()
    with pytest.raises(InputError, match=expected):
        received.load_message(array(data))
    assert received.to_bytes() == before


def test_command_of_other_kind_is_not_loaded() -> None:
    assert not arm_command().load(command().to_bytes())
    assert not command().load(arm_command().to_bytes())


@pytest.mark.parametrize(
    ('data', 'expected'),
    [
        ([1.0] * 3, '3 numbers; expected 4'),
        ([], '0 numbers; expected 4'),
        ([1.0, np.nan, 1.0, 1.0], "torque of 'wheel_left_joint' is not a finite"),
    ],
)
def test_effort_command_invalid_raises(data: list[float], expected: str) -> None:
    received = command()
    before = received.to_bytes()
    with pytest.raises(InputError, match=expected):
        received.load_message(array(data))
    assert received.to_bytes() == before


WINDOW = ReferenceWindow(3_000_000_007, 0.25, np.arange(24.0).reshape(2, 3, 4))
DIMENSIONS = [('samples', 2), ('derivative', 3), ('task', 4)]
HEAD = [3.0, 7.0, 0.25]


def assert_same_window(first: ReferenceWindow | None, second: ReferenceWindow) -> None:
    """Compare two windows."""
    assert first is not None
    assert (first.stamp_ns, first.period) == (second.stamp_ns, second.period)
    assert np.array_equal(first.samples, second.samples)


def test_reference_window_round_trip_restores_content() -> None:
    assert_same_window(ReferenceWindow.from_bytes(WINDOW.to_bytes()), WINDOW)
    message = array(HEAD + list(range(24)), DIMENSIONS, 3)
    assert_same_window(ReferenceWindow.from_message(message), WINDOW)
    assert WINDOW.stamps().tolist() == [3_000_000_007, 3_250_000_007]


def test_reference_window_other_label_or_length_is_not_read() -> None:
    raw = WINDOW.to_bytes()
    assert ReferenceWindow.from_bytes(raw.replace(b'samples', b'Samples')) is None
    for size in range(len(raw)):
        assert ReferenceWindow.from_bytes(raw[:size]) is None


@pytest.mark.parametrize(
    ('message', 'expected'),
    [
        (array([1.0] * 5), 'a set-point of 5 numbers; expected 4 positions, or 8'),
        (array([1.0, np.nan, 1.0, 1.0]), 'number 1 is not finite'),
        (array([*HEAD, *[0.0] * 23], DIMENSIONS, 3), '26 numbers'),
        (array([0.0] * 24, DIMENSIONS, 0), 'data_offset 0'),
        (array([*HEAD, *[0.0] * 24], DIMENSIONS[::-1], 3), 'task 4 x derivative 3 x samples 2'),
        (array([3.5, 7.0, 0.25, *[0.0] * 24], DIMENSIONS, 3), r'stamp \[3.5, 7\]'),
        (array([3.0, 1e9, 0.25, *[0.0] * 24], DIMENSIONS, 3), r'stamp \[3, 1e\+09\]'),
        (array([3.0, 7.0, 0.0, *[0.0] * 24], DIMENSIONS, 3), 'sample period 0 s'),
        (array([3.0, 7.0, 0.25, *[0.0] * 23, np.inf], DIMENSIONS, 3), 'number 26 is not finite'),
    ],
)
def test_reference_window_invalid_raises(message: Any, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        ReferenceWindow.from_message(message)


def test_reference_window_nan_in_own_layout_raises() -> None:
    layout = reference_layout(1)
    raw = layout.template[: layout.places['data'].start] + np.full(15, np.nan).tobytes()
    with pytest.raises(InputError, match='number 0 is not finite'):
        ReferenceWindow.from_bytes(raw)


def test_telemetry_other_label_is_read_by_size() -> None:
    received = telemetry()
    received.load_message(array([1.0, 5.0, 6.0, 7.0, 8.0, 9.0], [('s', 4)], 2))
    assert received.values.tolist() == [6.0, 7.0, 8.0, 9.0]
    assert received.stamp_ns == 1_000_000_005
    with pytest.raises(InputError, match='tracking_error: 4 numbers, data_offset 0'):
        received.load_message(array([6.0, 7.0, 8.0, 9.0]))
    assert received.values.tolist() == [6.0, 7.0, 8.0, 9.0]
