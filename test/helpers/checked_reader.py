# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reading of a log with all checks of the library mcap."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from mcap.reader import make_reader
from mcap.records import ChunkIndex

Messages = list[tuple[str, int, bytes]]


def read(path: Path) -> tuple[Messages, list[ChunkIndex]]:
    """Return messages and chunk indexes of a log; its statistics and indexes must be right."""
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages, counts = [], Counter()
        for _, channel, message in reader.iter_messages(log_time_order=False):
            messages.append((channel.topic, message.log_time, message.data))
            counts[channel.id] += 1
        attachments, metadata = list(reader.iter_attachments()), list(reader.iter_metadata())
    statistics = summary.statistics
    assert statistics.message_count == len(messages)
    assert statistics.chunk_count == len(summary.chunk_indexes)
    assert statistics.attachment_count == len(attachments) == len(summary.attachment_indexes)
    assert statistics.metadata_count == len(metadata) == len(summary.metadata_indexes)
    if messages:
        times = [time for _, time, _ in messages]
        assert statistics.message_start_time == min(times)
        assert statistics.message_end_time == max(times)
    assert counts.keys() <= summary.channels.keys()
    stated = {number: n for number, n in statistics.channel_message_counts.items() if n}
    assert stated == counts
    return messages, summary.chunk_indexes
