# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Writes runs as MCAP files that ROS 2's player and the usual viewers open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import os
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from masmc_ros.errors import InputError, suggestion
from masmc_ros.log.mcap.chunks import (
    arrived_records,
    ChannelRows,
    COMPRESSIONS,
    indexed_chunk,
    merged_records,
    MessageRecords,
    OpenChunk,
)
from masmc_ros.log.mcap.record_stream import RecordStream
from masmc_ros.log.mcap.records import packed
from masmc_ros.log.qos import Qos
from masmc_ros.log.write.sink import RecordSink
from masmc_ros.messages.definitions import Definition, definition
from masmc_ros.whole_file import WholeFile
from mcap.records import Attachment, Channel, Metadata, Schema, Statistics
from mcap.well_known import MessageEncoding, SchemaEncoding

CHUNK_SIZE = 256 * 1024
"""Bytes of messages that are compressed together."""

LIVE_CHUNK_SIZE = 512 * 1024
"""Of a live recording, whose chunks end with each flush anyway: fewer to keep an index of."""


class LogWriter:
    """
    A log that is being written; a context manager.

    A computed run is written beside its place, as `NAME.part`, and takes its name when it is
    complete; where an exception ends it, nothing is left of it and an older file of that name
    is untouched. A live recording has its own name from the start and always ends on a whole
    record; an exception closes it properly: what was recorded can be read.
    """

    def __init__(self, path: str | Path, compression: str = 'zstd', *, live: bool = False) -> None:
        """
        Start a log.

        Parameters
        ----------
        path
            the file, in a folder that exists.
        compression
            `zstd`, `lz4` or `none`.
        live
            whether a running robot is recorded.

        Raises
        ------
        InputError
            where there can be no such file, before anything is written.

        """
        if compression not in COMPRESSIONS:
            raise InputError(
                f"compression '{compression}' is unknown: {suggestion(compression, COMPRESSIONS)}"
            )
        self.path = Path(path)
        check_log_path(self.path)
        self._file: WholeFile | None = None
        self._stream: RecordSink | BinaryIO
        try:
            if live:
                self._stream = RecordSink(self.path)
            else:
                self._file = WholeFile(self.path)
                self._stream = self._file.stream
        except BlockingIOError as error:
            raise InputError(f'{path}: another recorder writes it; name another file') from error
        except OSError as error:
            raise _not_written(self.path, error) from error
        self._limit = LIVE_CHUNK_SIZE if live else CHUNK_SIZE
        self._compression = compression
        self._records = RecordStream(self._stream)
        self._records.start()
        self._chunk = OpenChunk()
        self._schemas: dict[str, int] = {}

    def channel(
        self, topic: str, type_name: str, *qos: Qos, defined: Definition | None = None
    ) -> int:
        """
        Add a topic.

        Parameters
        ----------
        topic
            its full name.
        type_name
            such as `sensor_msgs/msg/JointState`.
        qos
            what each of its publishers offers.
        defined
            the type's definition, for one that is none of ROS 2 Jazzy's own.

        Returns
        -------
            The number by which messages name it, from 1 on in the order of the calls.

        Raises
        ------
        InputError
            for a type that is none of ROS 2 Jazzy's own, without a definition.

        """
        text, type_hash = defined or definition(type_name)
        summary = self._records.summary
        schema = self._schemas.get(type_name)
        if schema is None:
            schema = self._schemas[type_name] = len(summary.schemas) + 1
            self._define(Schema(schema, text.encode(), SchemaEncoding.ROS2, type_name))
        channel = len(summary.channels) + 1
        metadata = {
            'offered_qos_profiles': '\n'.join(each.to_yaml() for each in qos),
            'topic_type_hash': type_hash,
        }
        self._define(Channel(channel, topic, MessageEncoding.CDR, metadata, schema))
        return channel

    def _define(self, record: Schema | Channel) -> None:
        self._records.register(record)
        self._chunk.add_record(packed(record))
        self._end_full_chunk()

    def write(self, channel: int, time_ns: int, data: bytes) -> None:
        """
        Write one message with its log time in ns, as CDR with its encapsulation header.

        Raises OverflowError for a time that is not an int64, before anything is written.
        """
        self.write_records(arrived_records([(channel, time_ns, data)]), 0, 1)

    def write_rows(self, sources: Sequence[ChannelRows]) -> None:
        """
        Write many messages, merged in the order of their times.

        Those of one time are written in the order of `sources`. A long run is written in
        blocks of time, so that it need not be held in memory as a whole.
        """
        sources = [source for source in sources if len(source.times)]
        if not sources:
            return
        merged, first = merged_records(sources), 0
        while first < len(merged.times):
            first = self.write_records(merged, first, len(merged.times))

    def write_records(self, messages: MessageRecords, first: int, stop: int) -> int:
        """Write messages from `first` to before `stop` or a chunk's end; return the next one."""
        first = self._chunk.add_messages(messages, first, stop, self._limit)
        self._end_full_chunk()
        return first

    def _end_full_chunk(self) -> None:
        if self._chunk.size > self._limit:
            self._end_chunk()

    def _end_chunk(self) -> None:
        """Write the chunk under way; definitions alone wait for the first message."""
        chunk = self._chunk
        if chunk.indexes:
            self._chunk = OpenChunk()
            self._records.add_chunk(
                indexed_chunk(chunk.content(), chunk.indexes, self._compression)
            )

    def attach(self, name: str, media_type: str, data: bytes, time_ns: int = 0) -> None:
        """Add a file, such as the parameters or the robot description; its time in ns."""
        self._records.add_attachment(Attachment(time_ns, time_ns, name, media_type, data))

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a record of names and texts; several may have the same `name`."""
        self._records.add_metadata(Metadata(name, dict(values)))

    def commit(self, *, whole: bool = True, durable: bool = False) -> None:
        """
        Hand over to the operating system what was written so far.

        What a killed recording has committed can be recovered.

        Parameters
        ----------
        whole
            the chunk under way too; else complete chunks only.
        durable
            wait until a power cut can no longer harm it.

        Raises
        ------
        OSError
            where the disk does not take it; nothing is lost, and the next commit
            tries again.

        """
        if whole:
            self._end_chunk()
        if isinstance(self._stream, RecordSink):
            self._stream.commit(durable=durable)
        else:
            self._stream.flush()

    def sync(self) -> None:
        """Wait until a power cut can harm nothing of what was committed; OSError if it can."""
        if isinstance(self._stream, RecordSink):
            self._stream.sync()

    @property
    def size(self) -> int:
        """Bytes written, those of the chunk under way not counted."""
        return self._records.position

    @property
    def statistics(self) -> Statistics:
        """Return the numbers and times of the messages; complete after `finish`."""
        return self._records.statistics

    @property
    def pending(self) -> int:
        """Bytes that the disk has not taken."""
        return self._stream.pending if isinstance(self._stream, RecordSink) else 0

    def finish(self) -> None:
        """Write the indexes and the end; what remains is to commit and to close."""
        self._end_chunk()
        self._records.finish()

    def close(self) -> None:
        """Complete the file and give it its name; InputError where a disk takes no more."""
        if self._stream.closed:
            return
        try:
            self.finish()
            self.commit(whole=False, durable=True)
            if self._file is None:
                self.close_file()
            else:
                self._file.finish()
        except BaseException as error:
            self.discard()
            self._refuse(error)
            raise

    def close_file(self) -> None:
        """Close the file with what is in it."""
        self._stream.close()

    def discard(self) -> None:
        """Close the file as it is; nothing is left of a computed run."""
        if self._file is None:
            self._stream.close()
        else:
            self._file.discard()

    def __enter__(self) -> LogWriter:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Complete the file, or leave nothing of a computed run that failed."""
        if kind is None or self._file is None:
            self.close()
        else:
            self.discard()
            self._refuse(error)

    def _refuse(self, error: BaseException | None) -> None:
        """Raise InputError where the disk did not take a computed run."""
        if self._file is not None and isinstance(error, OSError):
            raise _not_written(self.path, error) from error


def _not_written(path: Path, error: OSError) -> InputError:
    return InputError(f'{path}: cannot be written: {error.strerror or error}')


def check_log_path(path: Path) -> None:
    """
    Check that a log can be written there, without writing anything.

    Parameters
    ----------
    path
        the file.

    Raises
    ------
    InputError
        where it is a folder or something else than a file, where its folder is
        missing, no folder, or not writable.

    """
    folder = path.parent
    # Not the methods of Path, some of which raise for a name that is too long.
    exists = os.path.exists(path)
    if exists and not os.path.isfile(path):
        kind = 'a folder' if os.path.isdir(path) else 'not a file'
        raise InputError(f'{path}: is {kind}; name the file to write, such as run.mcap')
    if not os.path.isdir(folder):
        fault = 'is not a folder' if os.path.exists(folder) else 'does not exist'
        raise InputError(f'{path}: folder {folder} {fault}; create it or name another')
    if not os.access(folder, os.W_OK) or (exists and not os.access(path, os.W_OK)):
        raise InputError(f'{path}: cannot be written; name a file in a folder of yours')
