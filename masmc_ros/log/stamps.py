# SPDX-License-Identifier: Apache-2.0
"""The time a serialised message speaks of, read without deserialising it."""

from __future__ import annotations

from collections.abc import Callable

from masmc_ros.errors import InputError
from masmc_ros.log.arm_velocity import ArmVelocityCdr
from masmc_ros.log.effort import EffortCdr
from masmc_ros.log.labelled_command import LabelledCdr
from masmc_ros.log.layout import ENCAPSULATION, NANOSECONDS, STAMP
from masmc_ros.log.names import ARM_VELOCITY_TOPIC, COMMAND_TOPIC, TELEMETRY, telemetry_topic
from masmc_ros.log.telemetry import TelemetryCdr

StampReader = Callable[[bytes], int | None]

TRANSFORMS_TYPE = 'tf2_msgs/msg/TFMessage'

_STAMPED = (
    'sensor_msgs/msg/JointState',
    'nav_msgs/msg/Odometry',
    'nav_msgs/msg/Path',
    'geometry_msgs/msg/TwistStamped',
    'rosgraph_msgs/msg/Clock',
)
"""Types that begin with a stamp on the robot's clock."""


def header_stamp(raw: bytes) -> int:
    """Return the stamp in ns of a message that begins with a header or a time.

    Raises InputError where the message is too short for one.
    """
    if len(raw) < len(ENCAPSULATION) + STAMP.size:
        raise InputError(f'a message of {len(raw)} bytes has no stamp')
    seconds, nanoseconds = STAMP.unpack_from(raw, len(ENCAPSULATION))
    return int(seconds * NANOSECONDS + nanoseconds)


def transforms_stamp(raw: bytes) -> int | None:
    """Return the stamp in ns of a TFMessage's first transform; None where it has none."""
    if len(raw) < len(ENCAPSULATION) + 4 + STAMP.size:
        return None
    seconds, nanoseconds = STAMP.unpack_from(raw, len(ENCAPSULATION) + 4)
    return int(seconds * NANOSECONDS + nanoseconds)


def stamp_reader(topic: str, type_name: str) -> StampReader:
    """Return how to read the stamp in ns of a topic's messages; None for one without.

    `topic` is relative to the robot. Commands have the stamp of the state that they answer,
    telemetry that of the state that it belongs to.
    """
    if type_name in _STAMPED:
        return _header_stamp_or_none
    if type_name == TRANSFORMS_TYPE:
        return transforms_stamp
    if topic == COMMAND_TOPIC:
        return _command_reader(EffortCdr())
    if topic == ARM_VELOCITY_TOPIC:
        return _command_reader(ArmVelocityCdr())
    for label, count in TELEMETRY.items():
        if topic == telemetry_topic(label):
            telemetry = TelemetryCdr(label, count)
            return _telemetry_reader(telemetry)
    return lambda _: None


def _header_stamp_or_none(raw: bytes) -> int | None:
    """Return the stamp in ns, None for one that no log can hold."""
    try:
        stamp = header_stamp(raw)
    except InputError:
        return None
    return stamp if stamp >= 0 else None


def _command_reader(command: LabelledCdr) -> StampReader:
    return lambda raw: command.stamp_ns if command.load(raw) else None


def _telemetry_reader(telemetry: TelemetryCdr) -> StampReader:
    return lambda raw: telemetry.stamp_ns if telemetry.load(raw) else None
