# SPDX-License-Identifier: Apache-2.0
"""The commands of a log for a platform that takes no torques: twists, stamped or plain."""

from __future__ import annotations

from typing import Any

import numpy as np

from masmc_ros.errors import InputError
from masmc_ros.log.decode import message_decoder, Series
from masmc_ros.log.layout import NANOSECONDS
from masmc_ros.log.platform_motion import TwistCdr, TwistStampedCdr
from masmc_ros.log.scan import Topic
from masmc_ros.log.topics import TWIST_STAMPED


def twists(topic: Topic, arm: Series | None) -> Series:
    """Read twists: forward speed in m/s and yaw rate in rad/s, 2.

    A plain one has no stamp, and in a recording the time at which it came may be a tick off.
    The controller sends one before every command for the arm, so that those of the same number
    go together. Where there are more of either, the times of the log have to do.

    Args:
        topic: of messages of either type, in the order of the log.
        arm: all commands for the arm in the same order; None where the log has none.

    Returns:
        Those that are finite, with the stamps of the states that they answer.
    """
    if topic.schema is not None and topic.schema.name == TWIST_STAMPED:
        return _decode(topic, is_stamped=True)
    found = _decode(topic, is_stamped=False)
    if arm is None or len(arm.stamps) != len(found.stamps):
        return found
    return Series(arm.stamps, found.values)


def _decode(topic: Topic, *, is_stamped: bool) -> Series:
    """Read twists: forward speed and yaw rate, 2; those that nobody takes are left out.

    Stamps are the messages' own, or of plain twists the times of the log.
    """
    message = TwistStampedCdr() if is_stamped else TwistCdr()
    stamps, values = [], []
    make = None
    for log_time, raw in zip(topic.log_times, topic.messages, strict=True):
        if message.load(raw):
            six = [*message.linear.tolist(), *message.angular.tolist()]
            stamp = message.stamp_ns if isinstance(message, TwistStampedCdr) else log_time
        else:
            make = make or message_decoder(topic)
            try:
                six, stamp = _twist(make(raw), log_time)
            except InputError:
                continue
        if np.isfinite(six).all():
            stamps.append(stamp)
            values.append((six[0], six[5]))
    return Series(np.array(stamps, np.int64), np.array(values).reshape(-1, 2))


def _twist(received: Any, log_time: int) -> tuple[list[float], int]:
    """Return the six numbers of a decoded Twist or TwistStamped, and its stamp in ns."""
    twist, stamp = received, log_time
    if hasattr(received, 'twist'):
        twist, time = received.twist, received.header.stamp
        stamp = time.sec * NANOSECONDS + time.nanosec
    return [getattr(part, c) for part in (twist.linear, twist.angular) for c in 'xyz'], stamp
