# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Readers of command messages, one for each topic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

from geometry_msgs.msg import Twist, TwistStamped
from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.messages import deserialised
from masmc_ros.messages.cdr_layout import checked_stamp
from masmc_ros.messages.commands import ArmVelocityCdr, EffortCdr, LabelledCdr
from masmc_ros.messages.names import ARM_VELOCITY_TOPIC, CMD_VEL_TOPIC, COMMAND_TOPIC
from masmc_ros.messages.platform_messages import twist_numbers, TwistCdr, TwistStampedCdr
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.messages.topics import FLOAT_ARRAY, TWIST, TWIST_STAMPED
from masmc_ros.nodes.middleware.messages import deserialized
from masmc_ros.plant.latest_command import CommandPart
from masmc_ros.robot.declaration import Velocity
import numpy as np
from std_msgs.msg import Float64MultiArray

_COMPONENTS = tuple(f'{part}.{c}' for part in ('linear', 'angular') for c in 'xyz')


class ReceivedCommand(NamedTuple):
    """Command of a valid message."""

    numbers: Array | None
    """Numbers of the command; None for a void one."""
    stamp: int | None
    """Stamp in ns of the state to which it responds; None if it names none."""


class Source(NamedTuple):
    """A topic with commands for one part; `read` raises InputError."""

    part: CommandPart
    type_name: str
    message_type: type
    read: Callable[[bytes], ReceivedCommand]

    @property
    def topic(self) -> str:
        """Topic, relative to the robot."""
        return self.part.topic


def torque_sources(joints: tuple[str, ...]) -> list[Source]:
    """Return the source of torques of the driven joints."""
    part = CommandPart(COMMAND_TOPIC, len(joints))
    return [Source(part, FLOAT_ARRAY, Float64MultiArray, _labelled(EffortCdr(joints)))]


def base_sources(
    joints: tuple[str, ...],
    twist: Sequence[Velocity],
    frame_prefix: str,
    *,
    is_stamped: bool,
    is_hybrid: bool,
) -> list[Source]:
    """
    Return the sources of a twist of the base, and of velocities or torques of the other joints.

    Parameters
    ----------
    joints
        Names of the driven joints; those that the twist replaces come first.
    twist
        Velocities of the base.
    frame_prefix
        Prefix of frame names. A TwistStamped with this prefix is read by compiled code.
    is_stamped
        True if twists are TwistStamped.
    is_hybrid
        True if the other joints receive torques. Without them, drives hold the base as well.

    """
    places = [velocity.place for velocity in twist]
    others = joints[len(places):]
    base = CommandPart(
        CMD_VEL_TOPIC, len(places), names_state=is_stamped, is_zero_unlabelled=is_stamped
    )
    topic = COMMAND_TOPIC if is_hybrid else ARM_VELOCITY_TOPIC
    joints_part = CommandPart(topic, len(others), is_required=is_hybrid)
    reader = EffortCdr(others) if is_hybrid else ArmVelocityCdr(others)
    return [
        Source(base, TWIST_STAMPED, TwistStamped, _stamped_twist(frame_prefix, places))
        if is_stamped
        else Source(base, TWIST, Twist, _twist(places)),
        Source(joints_part, FLOAT_ARRAY, Float64MultiArray, _labelled(reader)),
    ]


def _labelled(command: LabelledCdr) -> Callable[[bytes], ReceivedCommand]:
    # The first call compiles the kernel, or loads it.
    command.load(command.to_bytes())

    def read(raw: bytes) -> ReceivedCommand:
        if not command.load(raw):
            command.load_message(deserialized(raw, Float64MultiArray))
        return ReceivedCommand(None if command.is_void else command.data, command.stamp_ns)

    return read


def _twist(places: Sequence[int]) -> Callable[[bytes], ReceivedCommand]:
    buffer = TwistCdr()
    buffer.load(buffer.to_bytes())

    def read(raw: bytes) -> ReceivedCommand:
        twist = buffer if buffer.load(raw) else deserialized(raw, Twist)
        return ReceivedCommand(_velocities(twist, places), None)

    return read


def _stamped_twist(
    frame_prefix: str, places: Sequence[int]
) -> Callable[[bytes], ReceivedCommand]:
    buffer = TwistStampedCdr(frame_prefix)
    buffer.load(buffer.to_bytes())

    def read(raw: bytes) -> ReceivedCommand:
        if buffer.load(raw):
            return ReceivedCommand(_velocities(buffer, places), checked_stamp(buffer.stamp_ns))
        message = deserialized(raw, TwistStamped)
        return ReceivedCommand(_velocities(message.twist, places), header_stamp(raw))

    return read


def _velocities(
    twist: TwistCdr | TwistStampedCdr | deserialised.Twist, places: Sequence[int]
) -> Array:
    """Return the components of a twist that move this base."""
    numbers = twist_numbers(twist)
    for name, number in zip(_COMPONENTS, numbers, strict=True):
        if not math.isfinite(number):
            raise InputError(f'{name} = {number}: expected a finite number')
    return np.array([numbers[place] for place in places])
