# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Content of a log: topics with their messages, metadata and attachments."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

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
