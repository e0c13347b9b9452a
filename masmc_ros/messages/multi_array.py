# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Layout of std_msgs/Float64MultiArray, the type of commands, references and telemetry."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

from masmc_ros.messages.cdr_layout import Layout


def multi_array_layout(dimensions: Sequence[tuple[str, int]], data_offset: int) -> Layout:
    """
    Return the layout of a Float64MultiArray with labelled dimensions.

    Its fields are `head`, the numbers before the array (if `data_offset` is not 0), and `data`, of
    the shape of the dimensions.

    Parameters
    ----------
    dimensions
        Label and size of each dimension, the slowest first.
    data_offset
        Number of entries before the array.

    """
    layout = Layout()
    layout.uint32(len(dimensions))
    sizes = [size for _, size in dimensions]
    for number, (label, size) in enumerate(dimensions):
        layout.string(label)
        layout.uint32(size)
        layout.uint32(prod(sizes[number:]))
    layout.uint32(data_offset)
    layout.uint32(data_offset + prod(sizes))
    if data_offset:
        layout.doubles('head', data_offset)
    layout.doubles('data', *sizes)
    return layout


def labelled_layout(label: str, characters: int, count: int) -> Layout:
    """
    Return the layout of `count` numbers whose label continues after `label`.

    Its fields are `characters`, the remaining characters of the label, `data_offset`, and `data`.
    """
    layout = Layout()
    layout.uint32(1)
    layout.string(label, 'characters', characters)
    layout.uint32(count)
    layout.uint32(count)
    layout.varying_uint32('data_offset')
    layout.sequence('data', count)
    return layout
