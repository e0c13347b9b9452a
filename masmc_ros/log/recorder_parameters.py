# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the recorder."""

from __future__ import annotations

from masmc_ros.params.declaration import Parameter

_MOST = 1e9
"""Largest size in MB and time in s of a recording."""

_LEAST_PART = 1.0
"""Smallest size in MB and time in s of a part; less would give one file for each message."""


def _is_part(value: float) -> bool:
    """Return True for a valid size or time of a part, and for 0, which disables parts."""
    return value == 0.0 or value >= _LEAST_PART


def _are_parts(value: float) -> bool:
    """Return True for a number of parts that keeps a complete one, and for 0, which keeps all."""
    return value != 1


_PART_TEXT = f'0, or a number in [{_LEAST_PART:g}, {_MOST:g}]'

OUTPUT = Parameter(
    'output', '.',
    'Output file (*.mcap), or a folder for a new file named by namespace, date and time',
)

OVERWRITE = Parameter('overwrite', False, 'Replace an existing file')

COMPRESSION = Parameter(
    'compression', 'zstd', 'Compression of chunks', choices=('zstd', 'lz4', 'none')
)

EXTRA_TOPICS: Parameter[tuple[str, ...]] = Parameter(
    'extra_topics', (), 'Additional topics to record, as soon as they exist'
)

FLUSH_PERIOD = Parameter(
    'flush_period', 0.2,
    'Longest time until a received message is on disk, also if the recorder is killed',
    unit='s', minimum=0.01, maximum=3600.0,
)

MAX_SIZE = Parameter(
    'max_size', 0.0,
    'Size at which a new part of the recording starts, in a folder; 0: one file',
    unit='MB', minimum=0.0, maximum=_MOST, rule=_is_part, rule_text=_PART_TEXT,
)

MAX_DURATION = Parameter(
    'max_duration', 0.0,
    'Robot time, by its states, at which a new part of the recording starts; 0: one file',
    unit='s', minimum=0.0, maximum=_MOST, rule=_is_part, rule_text=_PART_TEXT,
)

MAX_PARTS = Parameter(
    'max_parts', 0,
    'Number of parts that are kept, the current one included; older ones are deleted; 0: all',
    minimum=0, rule=_are_parts, rule_text='0, or an integer >= 2',
)

QUEUE_SIZE = Parameter(
    'queue_size', 64.0,
    'Size of the queue for a slow or full disk; further messages are counted and lost',
    unit='MB', minimum=1.0, maximum=_MOST,
)

NODE = (
    OUTPUT, OVERWRITE, COMPRESSION, EXTRA_TOPICS, FLUSH_PERIOD, MAX_SIZE, MAX_DURATION, MAX_PARTS,
    QUEUE_SIZE,
)  # fmt: skip
