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

"""Records on their way into an MCAP file, and the end that makes it a complete one."""

from __future__ import annotations

import struct
from typing import Protocol
import zlib

from masmc_ros import __version__
from masmc_ros.log.mcap.chunks import index_record, IndexedChunk
from masmc_ros.log.mcap.records import MAGIC, packed
from masmc_ros.log.mcap.summary import Summary
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    DataEnd,
    Footer,
    Header,
    Metadata,
    SummaryOffset,
)
from mcap.well_known import Profile


class Stream(Protocol):
    """What takes bytes, whole records at a time."""

    def write(self, data: bytes, /) -> object:
        """Take bytes."""


class RecordStream:
    """
    The records of a file, one after the other.

    Attributes
    ----------
    position
        where in the file the next record begins.
    summary
        what the end says of those before it.

    """

    def __init__(
        self, stream: Stream, position: int = 0, summary: Summary | None = None
    ) -> None:
        """Start at the beginning, or go on behind records of which a summary tells."""
        self._stream = stream
        self.position = position
        self.summary = summary or Summary()

    def start(self) -> None:
        """Begin a file."""
        self.write(MAGIC)
        self.write(packed(Header(Profile.ROS2, f'masmc_ros {__version__}')))

    def write(self, record: bytes) -> None:
        """Write whole records of which the end says nothing."""
        self._stream.write(record)
        self.position += len(record)

    def add_attachment(self, attachment: Attachment) -> None:
        """Write a file beside the messages."""
        record = packed(attachment)
        self.summary.note_attachment(attachment, self.position, len(record))
        self.write(record)

    def add_metadata(self, metadata: Metadata) -> None:
        """Write names and texts."""
        record = packed(metadata)
        self.summary.note_metadata(metadata.name, self.position, len(record))
        self.write(record)

    def add_chunk(self, indexed: IndexedChunk) -> None:
        """Write a chunk and the indexes of its messages behind it."""
        record = packed(indexed.chunk)
        told = self.summary.note_chunk(indexed, self.position, len(record))
        self.write(record)
        records, end = [], self.position
        for channel, index in indexed.indexes.items():
            told.message_index_offsets[channel] = end
            records.append(index_record(channel, index))
            end += len(records[-1])
        told.message_index_length = end - self.position
        self.write(b''.join(records))

    def finish(self) -> None:
        """Write the end, with all indexes; what remains is to close the file."""
        self.write(packed(DataEnd(0)))
        builder, begin, offsets = RecordBuilder(), self.position, []
        for opcode, group in self.summary.groups():
            start = builder.count
            for record in group:
                record.write(builder)
            offsets.append(SummaryOffset(opcode, begin + start, builder.count - start))
        summary_offsets = begin + builder.count
        for offset in offsets:
            offset.write(builder)
        summary = builder.end()
        head = struct.pack('<BQQQ', Opcode.FOOTER, 20, begin, summary_offsets)
        crc = zlib.crc32(head, zlib.crc32(summary))
        self.write(summary)
        self.write(packed(Footer(begin, summary_offsets, crc)))
        self.write(MAGIC)
