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

from dataclasses import dataclass, field
import mmap
import zlib

from masmc_ros.log.records import MAGIC, PRIVATE, RECORD_HEAD, records, stream_of
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)


@dataclass
class Summary:
    """What the end of a file says of what is before it."""

    schemas: list[Schema] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)
    chunks: list[ChunkIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    statistics: Statistics | None = None


def read_summary(data: mmap.mmap | bytes, position: int) -> Summary | None:
    """Return what stands behind the data of a file, from their end on; None if it is damaged."""
    summary, begin = Summary(), None
    try:
        for opcode, start, end in records(data, position):
            stream = stream_of(data[start + RECORD_HEAD.size:end])
            if begin is None:
                crc = DataEnd.read(stream).data_section_crc
                with memoryview(data) as whole, whole[:start] as before:
                    if crc and crc != zlib.crc32(before):
                        return None
                begin = end
            elif opcode == Opcode.SCHEMA:
                summary.schemas.append(Schema.read(stream))
            elif opcode == Opcode.CHANNEL:
                summary.channels.append(Channel.read(stream))
            elif opcode == Opcode.CHUNK_INDEX:
                summary.chunks.append(ChunkIndex.read(stream))
            elif opcode == Opcode.ATTACHMENT_INDEX:
                summary.attachments.append(AttachmentIndex.read(stream))
            elif opcode == Opcode.METADATA_INDEX:
                summary.metadata.append(MetadataIndex.read(stream))
            elif opcode == Opcode.STATISTICS:
                summary.statistics = Statistics.read(stream)
            elif opcode == Opcode.FOOTER:
                footer = Footer.read(stream)
                crc = zlib.crc32(data[begin:end - 4])
                is_right = footer.summary_start == (begin if begin < start else 0)
                is_right &= footer.summary_crc in (0, crc) and data[end:] == MAGIC
                return summary if is_right else None
            elif opcode == Opcode.SUMMARY_OFFSET:
                offset = SummaryOffset.read(stream)
                if data[offset.group_start] != offset.group_opcode and offset.group_length:
                    return None
            elif opcode < PRIVATE:
                return None
    except Exception:  # whatever a library says of bytes that were never written so
        return None
    return None
