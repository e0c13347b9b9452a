# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What is in a log: topics with their messages, metadata and attachments."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mcap.records import Schema


@dataclass
class Topic:
    """
    One topic of a log and its messages.

    Attributes
    ----------
    name
        its full name.
    encoding
        of the messages, `cdr` for ROS 2.
    schema
        the definition of the messages; None for a log without.
    log_times
        of each message, ns.
    messages
        each as it was received.
    orders
        position of each among all messages of the log.

    """

    name: str
    encoding: str
    schema: Schema | None
    log_times: list[int] = field(default_factory=list)
    messages: list[bytes] = field(default_factory=list)
    orders: list[int] = field(default_factory=list)


@dataclass
class Records:
    """
    What a log holds, in the order of the file.

    Attributes
    ----------
    topics
        by name.
    metadata
        the records of each name.
    attachments
        the last file of each name.

    """

    topics: dict[str, Topic] = field(default_factory=dict)
    metadata: dict[str, list[dict[str, str]]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
