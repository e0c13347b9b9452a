# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Serialised messages of std_msgs: Float64MultiArray of commands and telemetry, and String."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

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


def multi_array_layout(
    dimensions: Sequence[tuple[str | tuple[str, int], int]], data_offset: int | None
) -> Layout:
    """
    Return the layout of a Float64MultiArray with labelled dimensions.

    Its fields are `data`, `layout_dim_N_label` of labels that vary, and `layout_data_offset` if it
    varies.

    Parameters
    ----------
    dimensions
        Label and size of each dimension, the slowest first; a label that varies at its end is a
        pair of text and number of variable characters.
    data_offset
        Number of entries before the array; None for a variable one, without such entries.

    """
    sizes = [size for _, size in dimensions]
    dim = [
        {'label': label, 'size': size, 'stride': prod(sizes[number:])}
        for number, (label, size) in enumerate(dimensions)
    ]
    contents = {
        'layout': {'dim': dim, 'data_offset': data_offset},
        'data': (data_offset or 0) + prod(sizes),
    }
    return Layout('std_msgs/msg/Float64MultiArray', contents)
