# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Content of a log, and arrays of the messages of a topic.

Known layouts are read in bulk, others one by one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TYPE_CHECKING

from masmc_ros.aliases import Array, Bytes, Flags, Integers, Stamps
from masmc_ros.errors import InputError
from masmc_ros.messages import cdr_layout, deserialised
from masmc_ros.messages.commands import CommandKind, LabelledCdr
from masmc_ros.messages.joint_state import FIELDS, joint_state_layout, JointStateCdr
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.telemetry import STAMP_NUMBERS, telemetry_layout, TelemetryCdr
from masmc_ros.messages.topics import JOINTS
import numpy as np

if TYPE_CHECKING:
    from mcap.records import Schema


NO_TIME = -(2**63)
"""Log time of a message whose time is not known."""

LATEST_TIME = 2**62
"""Latest log time in ns, of the year 2116: sums fit into 64 bits. Damaged logs have later ones."""


@dataclass
class Topic:
    """
    One topic of a log and its messages.

    Attributes
    ----------
    name
        full name.
    encoding
        encoding of the messages, `cdr` for ROS 2.
    schema
        definition of the messages; None if the log has none.
    log_times
        log time of each message in ns.
    messages
        received bytes of each message.
    orders
        position of each message among all messages of the log.

    """

    name: str
    encoding: str
    schema: Schema | None
    log_times: list[int] = field(default_factory=list)
    messages: list[bytes] = field(default_factory=list)
    orders: list[int] = field(default_factory=list)


@dataclass
class LogContents:
    """
    Content of a log, in the order of the file.

    Attributes
    ----------
    topics
        topics by name.
    metadata
        records of each name.
    attachments
        last file of each name.

    """

    topics: dict[str, Topic] = field(default_factory=dict)
    metadata: dict[str, list[dict[str, str]]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)


_STAMP_LIMITS = (cdr_layout.END_OF_TIME / cdr_layout.NANOSECONDS, cdr_layout.NANOSECONDS)
"""Upper limits of the seconds and nanoseconds of a stamp."""


@dataclass(frozen=True, eq=False)
class Series:
    """
    Stamped values in the order of the log.

    Attributes
    ----------
    stamps
        (n) in ns.
    values
        (n, k).
    orders
        (n) position of each among all messages of the log; None if it is not used.
    is_void
        (n) True for void commands, whose values are zero; None if the messages are no commands.

    """

    stamps: Stamps
    values: Array
    orders: Integers | None = None
    is_void: Flags | None = None

    def __len__(self) -> int:
        """Return the number of stamps."""
        return len(self.stamps)

    @cached_property
    def times(self) -> Array:
        """Return the stamps (n) in s."""
        return self.stamps / cdr_layout.NANOSECONDS


@dataclass
class MessageFormat:
    """
    Functions that read the messages of one kind.

    Attributes
    ----------
    width
        number of values of each message.
    layout
        layout of all messages; or a function that returns the layout of a message, None if this
        package has none for it.
    bulk
        reads messages of a layout: stamps in ns, values, and whether each stamp is usable; stamp
        and values have no meaning if it is not.
    single
        reads a decoded message and its log time in ns: stamp in ns and values.
    marks_void
        True if the last value of a message is 1 for a void command, and 0 for others.

    """

    width: int
    layout: cdr_layout.Layout | Callable[[bytes], cdr_layout.Layout | None]
    bulk: Callable[[cdr_layout.Messages], tuple[Stamps, Array, Flags | bool]]
    single: Callable[[Any, int], tuple[int, Array]]
    marks_void: bool = False


def message_decoder(topic: Topic) -> Callable[[bytes], Any]:
    """
    Return a function that decodes a message of a topic with the definition in the log.

    Raises
    ------
    InputError
        if the log has no ROS 2 definition.

    """
    # Imported here: only messages of other programs need it.
    from mcap_ros2.decoder import DecoderFactory

    try:
        decoder = DecoderFactory().decoder_for(topic.encoding, topic.schema)
    except Exception as error:  # the library raises many kinds for damaged definitions
        raise _undecodable(topic, error) from error
    if decoder is None:
        raise InputError(
            f"{topic.name}: messages in '{topic.encoding}' with definitions in"
            f" '{topic.schema.encoding if topic.schema else ''}';"
            ' expected cdr with ros2msg, as ROS 2 records them'
        )

    def decode(raw: bytes) -> Any:
        try:
            return decoder(raw)
        except Exception as error:  # the library raises many kinds for bytes of another type
            raise _undecodable(topic, error) from error

    return decode


def _undecodable(topic: Topic, error: Exception) -> InputError:
    return InputError(f'{topic.name}: a message cannot be decoded: {type(error).__name__} {error}')


def decode_topic(topic: Topic, kind: MessageFormat) -> Series:
    """
    Read a topic without the messages that every receiver rejects.

    Raises
    ------
    InputError
        if no message can be used: the reason of the first.

    """
    count = len(topic.messages)
    stamps, values = np.zeros(count, np.int64), np.zeros((count, kind.width))
    usable = np.zeros(count, bool)
    for layout, members in _by_layout(topic.messages, kind):
        matching, messages = layout.read(
            topic.messages if isinstance(members, slice) else [topic.messages[i] for i in members]
        )
        stamps[members], values[members], has_stamp = kind.bulk(messages)
        in_time = (stamps[members] >= 0) & (stamps[members] < cdr_layout.END_OF_TIME)
        usable[members] = matching & has_stamp & in_time
    others = np.flatnonzero(~usable).tolist()
    make = message_decoder(topic) if others else None
    first_error = None
    for index in others:
        assert make is not None
        try:
            stamp, values[index] = kind.single(make(topic.messages[index]), topic.log_times[index])
            stamps[index] = cdr_layout.checked_stamp(stamp)
            usable[index] = True
        except InputError as error:
            first_error = first_error or error
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            # The definition in the log has other fields, or fields of other types.
            first_error = first_error or _undecodable(topic, error)
    if first_error is not None and not usable.any():
        raise first_error
    is_void = None
    if kind.marks_void:
        values, is_void = values[:, :-1], values[usable, -1] != 0.0
    orders = np.array(topic.orders, np.int64)
    return Series(stamps[usable], values[usable], orders[usable], is_void)


def _by_layout(
    messages: Sequence[bytes], kind: MessageFormat
) -> Iterable[tuple[cdr_layout.Layout, list[int] | slice]]:
    """Return the layouts of messages with the indices of those of their size."""
    if isinstance(kind.layout, cdr_layout.Layout):
        size = kind.layout.size
        if set(map(len, messages)) == {size}:
            return [(kind.layout, slice(None))]
        members = [index for index, raw in enumerate(messages) if len(raw) == size]
        return [(kind.layout, members)] if members else []
    groups: dict[cdr_layout.Layout, list[int]] = defaultdict(list)
    latest = None
    for index, raw in enumerate(messages):
        layout = kind.layout(raw)
        if layout is not None and len(raw) == layout.size:
            # Nearly all messages have the layout of the one before; its hash takes long.
            if layout is not latest:
                latest, members = layout, groups[layout]
            members.append(index)
    return groups.items()


def joint_states(
    names: tuple[str, ...] = JOINTS, joints: tuple[str, ...] | None = None
) -> MessageFormat:
    """
    Return the format of joint states: positions, velocities and efforts by the joints' names.

    `joints` are those that a state must have, as in `JointStateCdr.load_message`; the numbers
    of others have no meaning.
    """
    message, layout = JointStateCdr(names), joint_state_layout(names)

    def bulk(states: cdr_layout.Messages) -> tuple[Stamps, Array, bool]:
        numbers = np.hstack([states[field] for field in FIELDS])
        return cdr_layout.stamps_of(states['header_stamp']), numbers, True

    def single(received: deserialised.JointState, _: int) -> tuple[int, Array]:
        message.load_message(received, joints, unknown_velocity=np.nan)
        return message.stamp_ns, np.hstack((message.position, message.velocity, message.effort))

    return MessageFormat(len(FIELDS) * len(names), layout, bulk, single)


def commands(kind: CommandKind) -> MessageFormat:
    """Return the format of commands, one number per joint; without a label, log time is used."""
    message, joints = LabelledCdr(kind), len(kind.joints)

    def layout(raw: bytes) -> cdr_layout.Layout | None:
        return kind.layout_of(raw)

    def bulk(messages: cdr_layout.Messages) -> tuple[Stamps, Array, Flags]:
        stamps, has_digits = _label_stamps(messages['layout_dim_0_label'])
        is_void = messages['layout_data_offset'] == joints
        return stamps, np.column_stack([messages['data'], is_void]), has_digits

    def single(received: deserialised.Float64MultiArray, log_time: int) -> tuple[int, Array]:
        message.load_message(received)
        stamp = log_time if message.stamp_ns is None else message.stamp_ns
        return stamp, np.append(message.data, message.is_void)

    return MessageFormat(joints + 1, layout, bulk, single, marks_void=True)


def _label_stamps(characters: Bytes) -> tuple[Stamps, Flags]:
    """Return the stamps in ns in labels, and which labels have nine digits of nanoseconds."""
    point = characters.shape[1] - cdr_layout.NANOSECOND_DIGITS - 1
    if point <= 0:
        return np.zeros(len(characters), np.int64), np.zeros(len(characters), bool)
    digits = np.delete(characters, point, axis=1).astype(np.int64) - ord('0')
    has_digits = ((digits >= 0) & (digits <= 9)).all(axis=1) & (characters[:, point] == ord('.'))
    return digits @ 10 ** np.arange(digits.shape[1] - 1, -1, -1), has_digits


def telemetry(label: str, count: int) -> MessageFormat:
    """Return the format of telemetry: `count` values called `label`."""
    message, layout = TelemetryCdr(label, count), telemetry_layout(label, count)

    def bulk(messages: cdr_layout.Messages) -> tuple[Stamps, Array, Flags]:
        head, values = np.split(messages['data'], [STAMP_NUMBERS], axis=1)
        # False for NaN, too.
        usable = np.all((head >= 0.0) & (head < _STAMP_LIMITS), axis=1, keepdims=True)
        seconds, nanoseconds = np.where(usable, head, 0.0).astype(np.int64).T
        return seconds * cdr_layout.NANOSECONDS + nanoseconds, values, usable[:, 0]

    def single(received: deserialised.Float64MultiArray, _: int) -> tuple[int, Array]:
        message.load_message(received)
        return message.stamp_ns, message.values

    return MessageFormat(count, layout, bulk, single)


def decode_references(topic: Topic, axes: int) -> list[tuple[int, ReferenceWindow]]:
    """Read windows and set-points without rejected ones, each with its log time in ns."""
    windows = []
    make = None
    for log_time, raw in zip(topic.log_times, topic.messages, strict=True):
        # Errors other than InputError: the definition in the log is that of another type.
        with suppress(InputError, AttributeError, TypeError, ValueError, OverflowError):
            window = ReferenceWindow.from_bytes(raw, axes)
            if window is None:
                make = make or message_decoder(topic)
                window = ReferenceWindow.from_message(make(raw), axes)
            if window.stamp_ns is not None or log_time != NO_TIME:
                windows.append((log_time, window))
    return windows
