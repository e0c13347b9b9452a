# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Turns the messages of a topic into arrays: ours in bulk, those of others one by one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.log.read.contents import Topic
from masmc_ros.messages.commands import (
    CommandKind,
    LabelledCdr,
)
from masmc_ros.messages.joint_state import FIELDS, joint_state_layout, JointStateCdr
from masmc_ros.messages.layout import (
    checked_stamp,
    END_OF_TIME,
    Layout,
    Messages,
    NANOSECOND_DIGITS,
    NANOSECONDS,
    stamps_of,
)
from masmc_ros.messages.names import JOINTS
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.telemetry import telemetry_layout, TelemetryCdr
from masmc_ros.numerics.aliases import Array, Stamps
import numpy as np
from numpy.typing import NDArray

_STAMP_LIMITS = (END_OF_TIME / NANOSECONDS, NANOSECONDS)
"""Of the seconds and nanoseconds of a stamp."""


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

    """

    stamps: Stamps
    values: Array

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.stamps)

    @cached_property
    def times(self) -> Array:
        """Return the stamps (n) in s."""
        return self.stamps / NANOSECONDS


class Bulk(NamedTuple):
    """
    What messages of one layout say.

    Attributes
    ----------
    usable
        (n) which have a stamp that can be understood.
    series
        of all, meaningless where not usable.

    """

    usable: NDArray[np.bool_] | bool
    series: Series


@dataclass
class Topical:
    """
    How the messages of one kind are read.

    Attributes
    ----------
    width
        how many values each has.
    layout
        tells which layout a message has where it is one of ours, else None.
    bulk
        reads messages of a layout.
    single
        reads a decoded message and its log time in ns: stamp in ns and values.

    """

    width: int
    layout: Callable[[bytes], Layout | None]
    bulk: Callable[[Messages], Bulk]
    single: Callable[[Any, int], tuple[int, Array]]


def message_decoder(topic: Topic) -> Callable[[bytes], Any]:
    """
    Return what makes an object of each message of a topic by the log's own definition.

    Raises
    ------
    InputError
        where the log holds no ROS 2 definition.

    """
    # Imported here: only messages that others laid out need it.
    from mcap_ros2.decoder import DecoderFactory

    try:
        decoder = DecoderFactory().decoder_for(topic.encoding, topic.schema)
    except Exception as error:  # whatever the library says of a damaged definition
        raise _undecodable(topic, error) from error
    if decoder is None:
        raise InputError(
            f"{topic.name}: messages in '{topic.encoding}' with definitions in"
            f" '{topic.schema.encoding if topic.schema else ''}';"
            ' it takes cdr with ros2msg, as ROS 2 records them'
        )

    def decode(raw: bytes) -> Any:
        try:
            return decoder(raw)
        except Exception as error:  # whatever the library says of bytes of another type
            raise _undecodable(topic, error) from error

    return decode


def _undecodable(topic: Topic, error: Exception) -> InputError:
    return InputError(f'{topic.name}: a message cannot be decoded: {type(error).__name__} {error}')


def decode(topic: Topic, how: Topical) -> Series:
    """
    Read a topic, leaving out the messages that every receiver refuses.

    Raises
    ------
    InputError
        where no message at all can be used: why the first cannot.

    """
    return decode_placed(topic, how)[0]


def decode_placed(topic: Topic, how: Topical) -> tuple[Series, NDArray[np.int64]]:
    """Read a topic as `decode` does, and return where in the log each message is as well."""
    count = len(topic.messages)
    stamps = np.zeros(count, np.int64)
    values = np.zeros((count, how.width))
    usable = np.zeros(count, bool)
    groups: dict[Layout, list[int]] = defaultdict(list)
    for index, raw in enumerate(topic.messages):
        layout = how.layout(raw)
        if layout is not None and len(raw) == layout.size:
            groups[layout].append(index)
    for layout, members in groups.items():
        matching, messages = layout.read([topic.messages[index] for index in members])
        told, series = how.bulk(messages)
        usable[members] = matching & told & _are_times(series.stamps)
        stamps[members], values[members] = series.stamps, series.values
    others = np.flatnonzero(~usable).tolist()
    refusal = _decode_singly(topic, how, others, stamps, values, usable)
    if refusal is not None and not usable.any():
        raise refusal
    return Series(stamps[usable], values[usable]), np.array(topic.orders, np.int64)[usable]


def _decode_singly(
    topic: Topic,
    how: Topical,
    indices: list[int],
    stamps: Stamps,
    values: Array,
    usable: NDArray[np.bool_],
) -> InputError | None:
    """Read the messages at `indices` into the arrays; return the first refusal."""
    refusal = None
    make = message_decoder(topic) if indices else None
    for index in indices:
        assert make is not None
        try:
            message = make(topic.messages[index])
            stamp, numbers = how.single(message, topic.log_times[index])
            stamps[index] = checked_stamp(stamp)
            values[index] = numbers
        except InputError as error:
            refusal = refusal or error
            continue
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            # The log's own definition of the type has other fields, or fields of other types.
            refusal = refusal or _undecodable(topic, error)
            continue
        usable[index] = True
    return refusal


def _are_times(stamps: Stamps) -> NDArray[np.bool_]:
    """Tell which stamps (n) in ns are times, as `checked_stamp`."""
    return (stamps >= 0) & (stamps < END_OF_TIME)


def joint_states(
    names: tuple[str, ...] = JOINTS, joints: tuple[str, ...] | None = None
) -> Topical:
    """
    Read joint states: positions, velocities and efforts, one of each by the joints' names.

    `joints` are those that a state must have, as in `JointStateCdr.load_message`; the numbers
    of others mean nothing.
    """
    message = JointStateCdr(names)

    layout = joint_state_layout(names)

    def bulk(states: Messages) -> Bulk:
        numbers = np.hstack([states[field] for field in FIELDS])
        return Bulk(True, Series(stamps_of(states['stamp']), numbers))

    def single(received: Any, _: int) -> tuple[int, Array]:
        message.load_message(received, joints, unknown_velocity=np.nan)
        return message.stamp_ns, np.hstack((message.position, message.velocity, message.effort))

    return Topical(len(FIELDS) * len(names), lambda _: layout, bulk, single)


def commands(kind: CommandKind) -> Topical:
    """Read commands of a kind, a number a joint; those without a label take their log time."""
    message = LabelledCdr(kind)

    def layout(raw: bytes) -> Layout | None:
        return kind.layout_of(raw)

    def bulk(messages: Messages) -> Bulk:
        plain, stamps = _label_stamps(messages['characters'])
        return Bulk(plain, Series(stamps, messages['data']))

    def single(received: Any, log_time: int) -> tuple[int, Array]:
        message.load_message(received)
        stamp = log_time if message.stamp_ns is None else message.stamp_ns
        return stamp, message.data.copy()

    return Topical(len(kind.joints), layout, bulk, single)


def _label_stamps(characters: NDArray[np.uint8]) -> tuple[NDArray[np.bool_], Stamps]:
    """Return which labels have nine digits of nanoseconds, and the stamps in ns of those."""
    point = characters.shape[1] - NANOSECOND_DIGITS - 1
    if point <= 0:
        return np.zeros(len(characters), bool), np.zeros(len(characters), np.int64)
    text = np.delete(characters, point, axis=1)
    is_plain = ((text >= ord('0')) & (text <= ord('9'))).all(axis=1)
    powers = 10 ** np.arange(text.shape[1] - 1, -1, -1)
    stamps = (text.astype(np.int64) - ord('0')) @ powers
    return is_plain & (characters[:, point] == ord('.')), stamps


def telemetry(label: str, count: int) -> Topical:
    """Read telemetry: `count` values called `label`."""
    message = TelemetryCdr(label, count)

    layout = telemetry_layout(label, count)

    def bulk(messages: Messages) -> Bulk:
        parts = messages['head']
        # False for what is not a number, too.
        usable = np.all((parts >= 0.0) & (parts < _STAMP_LIMITS), axis=1, keepdims=True)
        seconds, nanoseconds = np.where(usable, parts, 0.0).astype(np.int64).T
        stamps = seconds * NANOSECONDS + nanoseconds
        return Bulk(usable[:, 0], Series(stamps, messages['data']))

    def single(received: Any, _: int) -> tuple[int, Array]:
        message.load_message(received)
        return message.stamp_ns, message.values.copy()

    return Topical(count, lambda _: layout, bulk, single)


def decode_references(topic: Topic, axes: int) -> list[tuple[int, ReferenceWindow]]:
    """Read windows and set-points, each with its log time in ns, leaving out refused ones."""
    windows = []
    make = None
    for log_time, raw in zip(topic.log_times, topic.messages, strict=True):
        try:
            window = ReferenceWindow.from_bytes(raw, axes)
            if window is None:
                make = make or message_decoder(topic)
                window = ReferenceWindow.from_message(make(raw), axes)
        except (InputError, AttributeError, TypeError, ValueError, OverflowError):
            continue  # the latter where the log's own definition of the type is another
        windows.append((log_time, window))
    return windows
