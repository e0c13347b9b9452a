# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""std_msgs/String in CDR."""

from __future__ import annotations

from masmc_ros.errors import InputError
from masmc_ros.messages.cdr_layout import ENCAPSULATION, Layout


def string_message(text: str) -> bytes:
    """Return a serialised std_msgs/String, padded to 4 bytes as in received messages."""
    raw = Layout('std_msgs/msg/String', {'data': text}).template
    return raw + bytes(-len(raw) % 4)


def text_of(raw: bytes) -> str:
    """Return the text of a serialised std_msgs/String; InputError if it is invalid."""
    start = len(ENCAPSULATION) + 4
    size = int.from_bytes(raw[start - 4:start], 'little')
    if len(raw) < start + size:
        raise InputError(f'{len(raw)} bytes that are not a std_msgs/String')
    try:
        return raw[start:start + max(0, size - 1)].decode()
    except UnicodeDecodeError:
        raise InputError(f'a text of {size} bytes that is not UTF-8') from None
