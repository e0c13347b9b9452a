# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What the end of an MCAP file says of the records before it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import IO

from masmc_ros.log.mcap.chunks import IndexedChunk
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    McapRecord,
    MetadataIndex,
    Schema,
    Statistics,
)


def _no_statistics() -> Statistics:
    return Statistics(
        attachment_count=0,
        channel_count=0,
        channel_message_counts=Counter(),
        chunk_count=0,
        message_count=0,
        message_end_time=0,
        message_start_time=0,
        metadata_count=0,
        schema_count=0,
    )


@dataclass
class Summary:
    """
    What the end of a file says of what is before it.

    Attributes
    ----------
    schemas, channels
        by their numbers.
    chunks, attachments, metadata
        where they are.
    statistics
        of all; of those that are counted here, complete after `groups`.
    has_statistics
        whether a file that was read has them.

    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    statistics: Statistics = field(default_factory=_no_statistics)
    has_statistics: bool = False

    def register(self, record: Schema | Channel) -> None:
        """Note a definition."""
        if isinstance(record, Schema):
            self.schemas[record.id] = record
        else:
            self.channels[record.id] = record

    def note_attachment(self, attachment: Attachment, start: int, length: int) -> None:
        """Note an attachment by where its record begins and by its length."""
        self.attachments.append(
            AttachmentIndex(
                offset=start,
                length=length,
                create_time=attachment.create_time,
                log_time=attachment.log_time,
                data_size=len(attachment.data),
                name=attachment.name,
                media_type=attachment.media_type,
            )
        )

    def note_metadata(self, name: str, start: int, length: int) -> None:
        """Note metadata by where their record begins and by its length."""
        self.metadata.append(MetadataIndex(offset=start, length=length, name=name))

    def note_chunk(self, indexed: IndexedChunk, start: int, length: int) -> ChunkIndex:
        """Note a chunk; return its index, to which those of its messages are added."""
        chunk, indexes = indexed
        begin, end = chunk.message_start_time, chunk.message_end_time
        told = ChunkIndex(
            message_start_time=begin,
            message_end_time=end,
            chunk_start_offset=start,
            chunk_length=length,
            message_index_offsets={},
            message_index_length=0,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
        )
        self.chunks.append(told)
        for channel, index in indexes.items():
            self.count(channel, len(index) // 2, begin, end)
        return told

    def count(self, channel: int, count: int, begin: int, end: int) -> None:
        """Count messages of a channel, from and to these log times in ns."""
        found = self.statistics
        is_first = not found.message_count
        found.message_start_time = begin if is_first else min(begin, found.message_start_time)
        found.message_end_time = max(end, found.message_end_time)
        found.message_count += count
        found.channel_message_counts[channel] += count

    def agrees_with(self, stated: Summary) -> bool:
        """
        Return True if the summary of a file agrees with this one, made from its records.

        Parts of the summary may be missing: some writers skip them.
        """
        counts = +Counter(self.statistics.channel_message_counts)
        _ = self.groups()  # completes the statistics
        own, other = self.statistics, stated.statistics
        return (
            stated.chunks in ([], self.chunks)
            and stated.attachments in ([], self.attachments)
            and stated.metadata in ([], self.metadata)
            and stated.schemas.items() <= self.schemas.items()
            and stated.channels.items() <= self.channels.items()
            and (not stated.chunks or counts.keys() <= stated.channels.keys())
            and (
                not stated.has_statistics
                or (
                    counts == +Counter(other.channel_message_counts)
                    and own.message_count == other.message_count
                    and own.chunk_count == other.chunk_count
                    and own.attachment_count == other.attachment_count
                    and own.metadata_count == other.metadata_count
                    and own.message_start_time == other.message_start_time
                    and own.message_end_time == other.message_end_time
                )
            )
        )

    def groups(self) -> Iterable[tuple[Opcode, Iterable[McapRecord]]]:
        """Return the records of the summary as they follow each other, by kind."""
        statistics = self.statistics
        statistics.attachment_count = len(self.attachments)
        statistics.metadata_count = len(self.metadata)
        statistics.chunk_count = len(self.chunks)
        statistics.channel_count = len(self.channels)
        statistics.schema_count = len(self.schemas)
        return (
            (Opcode.SCHEMA, self.schemas.values()),
            (Opcode.CHANNEL, self.channels.values()),
            (Opcode.STATISTICS, (statistics,)),
            (Opcode.CHUNK_INDEX, self.chunks),
            (Opcode.ATTACHMENT_INDEX, self.attachments),
            (Opcode.METADATA_INDEX, self.metadata),
        )


def read_summary(stream: IO[bytes]) -> Summary | None:
    """Return the summary of a complete file; None if it has none."""
    stream.seek(0)
    summary = make_reader(stream).get_summary()
    if summary is None:
        return None
    return Summary(
        summary.schemas,
        summary.channels,
        summary.chunk_indexes,
        summary.attachment_indexes,
        summary.metadata_indexes,
        summary.statistics or _no_statistics(),
        summary.statistics is not None,
    )
