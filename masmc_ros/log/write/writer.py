# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Writer of MCAP files that ROS 2's player and the usual viewers open.

The file always ends with a complete record, even on a full disk (`RecordSink`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
import fcntl
import os
from pathlib import Path

from masmc_ros.errors import InputError, suggestion
from masmc_ros.files import WholeFile
from masmc_ros.log import codec
from masmc_ros.log.bag import Qos
from masmc_ros.log.codec import packed, RecordStream
from masmc_ros.messages.cdr_layout import Definition, definition
from mcap.records import Attachment, Channel, Metadata, Schema, Statistics
from mcap.well_known import MessageEncoding, SchemaEncoding


class RecordSink:
    """
    A file whose records stay in memory until `commit` has put them on the disk.

    If the disk takes a part of a record, the file is truncated to the end of the previous one,
    and the next commit tries again. The file is locked while the sink is open, so a recording
    in progress is not taken for a truncated log.

    Attributes
    ----------
    pending
        bytes that are not on the disk yet.
    closed
        whether the file is closed.

    """

    def __init__(self, path: Path) -> None:
        """Create or empty the file; OSError if that is not possible."""
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.ftruncate(self._descriptor, 0)
        except OSError:
            os.close(self._descriptor)
            raise
        self._records: deque[bytes] = deque()
        self._committed = self.pending = 0
        self.closed = False

    def write(self, records: bytes) -> None:
        """Keep complete records until the next commit."""
        self._records.append(records)
        self.pending += len(records)

    def commit(self, *, durable: bool = False) -> None:
        """
        Put all records into the file; with `durable`, wait until a power failure cannot lose them.

        Raises OSError if the disk does not take them. Nothing is lost then.
        """
        is_new = bool(self._records)
        try:
            while self._records:
                self._append(self._records[0])
                self.pending -= len(self._records.popleft())
        except OSError:
            os.ftruncate(self._descriptor, self._committed)
            raise
        if durable and is_new:
            self.sync()

    def sync(self) -> None:
        """Wait until a power failure cannot lose what was committed; OSError if it can."""
        os.fdatasync(self._descriptor)

    def _append(self, records: bytes) -> None:
        """Put records into the file; OSError if the disk takes a part of them or nothing."""
        done = 0
        with memoryview(records) as data:
            while done < len(data):
                done += os.pwrite(self._descriptor, data[done:], self._committed + done)
        self._committed += done

    def close(self) -> None:
        """Close the file with what was committed."""
        if not self.closed:
            self.closed = True
            os.close(self._descriptor)


CHUNK_SIZE = 256 * 1024
"""Size in bytes at which a chunk of a computed run ends."""

LIVE_CHUNK_SIZE = 512 * 1024
"""The same for a recording, whose chunks end with each flush: larger chunks need fewer indexes."""


class LogWriter:
    """
    Writer of one log; a context manager.

    A computed run is written to `NAME.part` and gets its name when it is complete. After an
    exception nothing is left of it, and an older file of that name is unchanged. A recording has
    its name from the start and always ends with a complete record; after an exception it is
    completed and can be read.
    """

    def __init__(self, path: str | Path, compression: str = 'zstd', *, live: bool = False) -> None:
        """
        Initialise the log.

        Parameters
        ----------
        path
            file in an existing folder.
        compression
            `zstd`, `lz4` or `none`.
        live
            True for the recording of a running robot, False for a computed run.

        Raises
        ------
        InputError
            if the file cannot be written; nothing is written then.

        """
        if compression not in codec.COMPRESSIONS:
            hint = suggestion(compression, codec.COMPRESSIONS)
            raise InputError(f"compression '{compression}' is unknown: {hint}")
        self.path = Path(path)
        check_log_path(self.path)
        try:
            self._file = None if live else WholeFile(self.path)
            self._sink = RecordSink(self._file.part if self._file else self.path)
        except BlockingIOError as error:
            raise InputError(f'{path}: another recorder writes it; name another file') from error
        except OSError as error:
            raise _not_written(self.path, error) from error
        self._limit = LIVE_CHUNK_SIZE if live else CHUNK_SIZE
        self._compression = compression
        self._records = RecordStream(self._sink.write)
        self._records.start()
        self._chunk = codec.OpenChunk()
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
            message type such as `sensor_msgs/msg/JointState`.
        qos
            quality of service of each publisher.
        defined
            definition of the type if it is not one of ROS 2 Jazzy.

        Returns
        -------
            Number of the channel for its messages, from 1 in the order of the calls.

        Raises
        ------
        InputError
            if the type is not one of ROS 2 Jazzy and has no definition.

        """
        text, type_hash = defined or definition(type_name)
        summary = self._records.summary
        schema = self._schemas.get(type_name)
        if schema is None:
            schema = self._schemas[type_name] = len(summary.schemas) + 1
            self._define(Schema(schema, text.encode(), SchemaEncoding.ROS2, type_name))
        channel = len(summary.channels) + 1
        metadata = {
            'offered_qos_profiles': '\n'.join(offered.to_yaml() for offered in qos),
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
        self.write_records(codec.arrived_records([(channel, time_ns, data)]), 0, 1)

    def write_rows(self, sources: Sequence[codec.ChannelRows]) -> None:
        """
        Write many messages, merged in the order of their times.

        Messages of the same time are written in the order of `sources`. A long run is written
        in several calls, because each call holds its messages in memory.
        """
        sources = [source for source in sources if len(source.times)]
        if sources:
            merged, first = codec.merged_records(sources), 0
            while first < len(merged.times):
                first = self.write_records(merged, first, len(merged.times))

    def write_records(self, messages: codec.MessageRecords, first: int, stop: int) -> int:
        """Write messages from `first` to before `stop` or a chunk's end; return the next one."""
        first = self._chunk.add_messages(messages, first, stop, self._limit)
        self._end_full_chunk()
        return first

    def _end_full_chunk(self) -> None:
        if self._chunk.size > self._limit:
            self._end_chunk()
            if self._file:
                self._sink.commit()

    def _end_chunk(self) -> None:
        """Write the open chunk; definitions without messages wait for the first message."""
        chunk = self._chunk
        if chunk.indexes:
            self._chunk = codec.OpenChunk()
            self._records.add_chunk(chunk.close(self._compression), chunk.indexes)

    def attach(self, name: str, media_type: str, data: bytes, time_ns: int = 0) -> None:
        """Add a file, such as the parameters or the robot description; its time in ns."""
        self._records.add_attachment(Attachment(time_ns, time_ns, name, media_type, data))

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a record of names and texts; several may have the same `name`."""
        self._records.add_metadata(Metadata(name, dict(values)))

    def commit(self, *, whole: bool = True, durable: bool = False) -> None:
        """
        Pass the records to the operating system.

        Committed records of a killed recording can be recovered.

        Parameters
        ----------
        whole
            True to end the open chunk, False for complete chunks only.
        durable
            True to wait until a power failure cannot lose them.

        Raises
        ------
        OSError
            if the disk does not take them; nothing is lost, and the next commit tries again.

        """
        if whole:
            self._end_chunk()
        self._sink.commit(durable=durable)

    def sync(self) -> None:
        """Wait until a power failure cannot lose what was committed; OSError if it can."""
        self._sink.sync()

    @property
    def size(self) -> int:
        """Size in bytes without the open chunk."""
        return self._records.position

    @property
    def statistics(self) -> Statistics:
        """Return the numbers and times of the messages; complete after `finish`."""
        return self._records.statistics

    @property
    def pending(self) -> int:
        """Bytes that are not on the disk yet."""
        return self._sink.pending

    def finish(self) -> None:
        """Write the indexes and the end; the caller commits and closes the file."""
        self._end_chunk()
        self._records.finish()

    def close(self) -> None:
        """Complete the file and give it its name; InputError if the disk is full."""
        if self._sink.closed:
            return
        try:
            self.finish()
            self.commit(whole=False, durable=self._file is None)
            self._sink.close()
            if self._file:
                self._file.finish()
        except BaseException as error:
            self._fail(error)
            raise

    def close_file(self) -> None:
        """Close the file in its present state; remove that of a computed run."""
        self._sink.close()
        if self._file:
            self._file.discard()

    def __enter__(self) -> LogWriter:
        """Return the writer."""
        return self

    def __exit__(self, _: object, error: BaseException | None, traceback: object) -> None:
        """Complete the file, or remove that of a computed run that failed."""
        if error is None or self._file is None:
            self.close()
        else:
            self._fail(error)

    def _fail(self, error: BaseException) -> None:
        """Close the file; InputError if the disk did not take a computed run."""
        self.close_file()
        if self._file and isinstance(error, OSError):
            raise _not_written(self.path, error) from error


def _not_written(path: Path, error: OSError) -> InputError:
    return InputError(f'{path}: cannot be written: {error.strerror or error}')


def check_log_path(path: Path) -> None:
    """
    Check that a log can be written to a file, without writing anything.

    Parameters
    ----------
    path
        the file.

    Raises
    ------
    InputError
        if it is a folder or not a regular file, or if its folder is missing, not a folder or
        not writable.

    """
    folder = path.parent
    # Some methods of Path raise for a name that is too long.
    exists = os.path.exists(path)
    if exists and not os.path.isfile(path):
        kind = 'a folder' if os.path.isdir(path) else 'not a file'
        raise InputError(f'{path}: is {kind}; name the file to write, such as run.mcap')
    if not os.path.isdir(folder):
        fault = 'is not a folder' if os.path.exists(folder) else 'does not exist'
        raise InputError(f'{path}: folder {folder} {fault}; create it or name another')
    if not os.access(folder, os.W_OK) or (exists and not os.access(path, os.W_OK)):
        raise InputError(f'{path}: cannot be written; name a file in a folder of yours')
