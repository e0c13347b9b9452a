# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Output of an MCAP file, from its header to its indexes and its footer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
import struct
import zlib

from masmc_ros import __version__
from masmc_ros.log.mcap.chunks import index_record, Indexes
from masmc_ros.log.mcap.codec import MAGIC, packed
from mcap import records as mcap
from mcap.opcode import Opcode
from mcap.summary import Summary
from mcap.well_known import Profile


class RecordStream:
    """
    The records of a file, one after the other.

    Attributes
    ----------
    position
        place in the file at which the next record starts.
    summary
        definitions and indexes of the records before it, without those of new chunks.
    statistics
        of the messages; the other counts are set by `finish`.

    """

    def __init__(
        self, write: Callable[[bytes], object], position: int = 0, summary: Summary | None = None
    ) -> None:
        """
        Initialise the output.

        Parameters
        ----------
        write
            function that writes whole records.
        position
            bytes of the file that precede those records.
        summary
            summary of these bytes.

        """
        self._write = write
        self.position = position
        self.summary = summary or Summary()
        self.statistics = self.summary.statistics or mcap.Statistics(
            message_count=0, channel_message_counts={}, message_start_time=0, message_end_time=0,
            chunk_count=0, channel_count=0, schema_count=0, attachment_count=0, metadata_count=0,
        )
        self._counts = Counter(self.statistics.channel_message_counts)
        # Bytes: an object for each chunk would take ten times the memory, and a recording of a
        # day has half a million chunks.
        self._chunk_indexes = bytearray(b''.join(map(packed, self.summary.chunk_indexes)))
        self._chunk_count = len(self.summary.chunk_indexes)

    def start(self, header: mcap.Header | None = None) -> None:
        """Start a file, with a header of this package by default."""
        self.write(MAGIC)
        self.write(packed(header or mcap.Header(Profile.ROS2, f'masmc_ros {__version__}')))

    def write(self, record: bytes) -> None:
        """Write whole records that the summary does not list."""
        self._write(record)
        self.position += len(record)

    def register(self, record: mcap.Schema | mcap.Channel) -> None:
        """Add a definition to the summary."""
        if isinstance(record, mcap.Schema):
            self.summary.schemas[record.id] = record
        else:
            self.summary.channels[record.id] = record

    def add_attachment(self, attachment: mcap.Attachment) -> None:
        """Write a file that accompanies the messages."""
        record = packed(attachment)
        self.summary.attachment_indexes.append(
            mcap.AttachmentIndex(
                offset=self.position,
                length=len(record),
                create_time=attachment.create_time,
                log_time=attachment.log_time,
                data_size=len(attachment.data),
                name=attachment.name,
                media_type=attachment.media_type,
            )
        )
        self.write(record)

    def add_metadata(self, metadata: mcap.Metadata) -> None:
        """Write names and texts."""
        record = packed(metadata)
        self.summary.metadata_indexes.append(
            mcap.MetadataIndex(self.position, len(record), metadata.name)
        )
        self.write(record)

    def add_chunk(self, chunk: mcap.Chunk, indexes: Indexes) -> None:
        """Write a chunk with at least one message, followed by the indexes of its messages."""
        record, start = packed(chunk), self.position
        self.write(record)
        records, offsets, end = [], {}, self.position
        for channel, entries in indexes.items():
            offsets[channel] = end
            records.append(index_record(channel, entries))
            end += len(records[-1])
            count = len(entries) // 2
            self.count(channel, count, chunk.message_start_time, chunk.message_end_time)
        index = mcap.ChunkIndex(
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            chunk_start_offset=start,
            chunk_length=len(record),
            message_index_offsets=offsets,
            message_index_length=end - self.position,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
        )
        self._chunk_indexes += packed(index)
        self._chunk_count += 1
        self.write(b''.join(records))

    def count(self, channel: int, count: int, first: int, last: int) -> None:
        """Count messages of a channel, with the first and the last log time in ns."""
        statistics = self.statistics
        start = min(first, statistics.message_start_time) if statistics.message_count else first
        statistics.message_start_time = start
        statistics.message_end_time = max(last, statistics.message_end_time)
        statistics.message_count += count
        self._counts[channel] += count

    def finish(self) -> None:
        """Write the end of the file, with all indexes."""
        self.write(packed(mcap.DataEnd(0)))
        start, summary, offsets = self.position, bytearray(), []
        for opcode, records in self._summary_records():
            offsets.append(mcap.SummaryOffset(opcode, start + len(summary), len(records)))
            summary += records
        summary_offsets = start + len(summary)
        summary += b''.join(map(packed, offsets))
        head = struct.pack('<BQQQ', Opcode.FOOTER, 20, start, summary_offsets)
        crc = zlib.crc32(head, zlib.crc32(summary))
        self.write(bytes(summary))
        self.write(packed(mcap.Footer(start, summary_offsets, crc)))
        self.write(MAGIC)

    def _summary_records(self) -> Iterable[tuple[Opcode, bytes | bytearray]]:
        """Return the records of the summary in their order, by kind."""
        summary, statistics = self.summary, self.statistics
        statistics.channel_message_counts = self._counts
        statistics.attachment_count = len(summary.attachment_indexes)
        statistics.metadata_count = len(summary.metadata_indexes)
        statistics.chunk_count = self._chunk_count
        statistics.channel_count = len(summary.channels)
        statistics.schema_count = len(summary.schemas)
        return (
            (Opcode.SCHEMA, _joined(summary.schemas.values())),
            (Opcode.CHANNEL, _joined(summary.channels.values())),
            (Opcode.STATISTICS, packed(statistics)),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.ATTACHMENT_INDEX, _joined(summary.attachment_indexes)),
            (Opcode.METADATA_INDEX, _joined(summary.metadata_indexes)),
        )


def _joined(records: Iterable[mcap.McapRecord]) -> bytes:
    return b''.join(map(packed, records))
