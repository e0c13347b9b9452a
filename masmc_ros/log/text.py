# SPDX-License-Identifier: Apache-2.0
"""std_msgs/String in CDR."""

from __future__ import annotations

from masmc_ros.log.layout import ENCAPSULATION


def string_message(text: str) -> bytes:
    """Return a serialised std_msgs/String, filled up to whole words as middleware delivers it."""
    data = text.encode() + b'\0'
    return ENCAPSULATION + len(data).to_bytes(4, 'little') + data + bytes(-len(data) % 4)


def text_of(raw: bytes) -> str:
    """Return the text of a serialised std_msgs/String."""
    start = len(ENCAPSULATION) + 4
    size = int.from_bytes(raw[start - 4 : start], 'little')
    return raw[start : start + size - 1].decode()
