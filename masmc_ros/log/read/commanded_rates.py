# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The commands of a log for a base that takes no torques: twists, stamped or plain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.log.read.contents import Topic
from masmc_ros.log.read.decode import message_decoder, Series
from masmc_ros.messages.platform_motion import twist_numbers, TwistCdr, TwistStampedCdr
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.messages.topics import TWIST_STAMPED
import numpy as np


def twists(topic: Topic, beside: Series | None, places: Sequence[int]) -> Series:
    """
    Read twists: as many of their six numbers as there are places, in m/s and rad/s.

    A plain one has no stamp, and in a recording the time at which it came may be a tick off.
    The controller sends one before every command for the other joints, so that those of the
    same number go together. Where there are more of either, the times of the log have to do.

    Parameters
    ----------
    topic
        of messages of either type, in the order of the log.
    beside
        all commands for the other joints in the same order; None where the log has none.
    places
        which numbers are read: linear x, y, z, then angular.

    Returns
    -------
        Those that are finite, with the stamps of the states that they answer.

    """
    if topic.schema is not None and topic.schema.name == TWIST_STAMPED:
        return _decode(topic, places, is_stamped=True)
    found = _decode(topic, places, is_stamped=False)
    if beside is None or len(beside.stamps) != len(found.stamps):
        return found
    return Series(beside.stamps, found.values)


def _decode(topic: Topic, places: Sequence[int], *, is_stamped: bool) -> Series:
    """
    Read numbers of twists; those that nobody takes are left out.

    Stamps are the messages' own, or of plain twists the times of the log.
    """
    message: Any = TwistStampedCdr() if is_stamped else TwistCdr()
    stamps, values = [], []
    make = None
    for log_time, raw in zip(topic.log_times, topic.messages, strict=True):
        try:
            twist, stamp = message, log_time
            if not message.load(raw):
                make = make or message_decoder(topic)
                twist = make(raw)
            if is_stamped:
                stamp = header_stamp(raw)
                twist = getattr(twist, 'twist', twist)
            six = [float(number) for number in twist_numbers(twist)]
        except (InputError, AttributeError, TypeError, ValueError):
            continue  # not InputError where the log's own definition of the type is another
        if np.isfinite(six).all():
            stamps.append(stamp)
            values.append([six[place] for place in places])
    return Series(np.array(stamps, np.int64), np.array(values).reshape(-1, len(places)))
