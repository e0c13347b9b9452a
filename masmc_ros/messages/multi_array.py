# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Layout of std_msgs/Float64MultiArray, the type of commands, references and telemetry."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

from masmc_ros.messages.cdr_layout import Layout


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
