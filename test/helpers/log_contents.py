# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Contents of a log as serialised bytes, for comparisons."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from masmc_ros.messages.stamps import stamp_reader
from mcap.reader import make_reader
from mcap.summary import Summary


@dataclass(frozen=True)
class LogContents:
    """All contents of a log: topics without the robot's namespace, serialised messages."""

    summary: Summary
    types: dict[str, str]
    messages: dict[str, list[bytes]]
    log_times: dict[str, list[int]]
    metadata: dict[str, list[dict[str, str]]]
    attachments: dict[str, bytes]

    def stamps(self, topic: str) -> list[int | None]:
        """Return the stamp in ns of every message of a topic, None for one without."""
        stamp = stamp_reader(topic, self.types[topic])
        return [stamp(message) for message in self.messages[topic]]


def read_log(log: Path, namespace: str = '/') -> LogContents:
    """Return the contents of a complete log, in the order of writing."""
    with log.open('rb') as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert summary is not None, f'{log} has no summary'
        names = {
            channel.id: channel.topic.removeprefix(namespace).lstrip('/')
            for channel in summary.channels.values()
        }
        contents = LogContents(
            summary,
            {names[c.id]: summary.schemas[c.schema_id].name for c in summary.channels.values()},
            {name: [] for name in names.values()},
            {name: [] for name in names.values()},
            {},
            {a.name: a.data for a in reader.iter_attachments()},
        )
        for record in reader.iter_metadata():
            contents.metadata.setdefault(record.name, []).append(record.metadata)
        for _, channel, message in reader.iter_messages(log_time_order=False):
            name = names[channel.id]
            contents.messages[name].append(message.data)
            contents.log_times[name].append(message.log_time)
    return contents
