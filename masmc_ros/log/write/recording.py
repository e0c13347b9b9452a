# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Recording of a running robot: a queue of messages, and the thread that writes them."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
import errno
import fcntl
from functools import partial
import math
from pathlib import Path
import threading
import time

from masmc_ros.errors import InputError
from masmc_ros.log.bag import METADATA_FILE, Part, Qos, RecordedTopic, REPEATED, write_bag_metadata
from masmc_ros.log.codec import arrived_records, Message, MessageRecords
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.cdr_layout import Definition
import numpy as np

_TURN = 0.02
"""Time in s between two checks of the queue."""

_SYNC = 1.0
"""Time in s between two flushes of the file to the disk (fsync)."""

_BATCH = 2**20
"""Size in bytes of complete chunks that are passed to the disk before the next flush is due."""

_OVERHEAD = 64
"""Memory of a queued message in bytes, in addition to its data."""

_LAST_TRIES = 3.0
"""Time in s for which a full disk is tried again at the end of the recording."""

_REASONS = {errno.ENOSPC: 'the disk is full', errno.EDQUOT: "the user's quota is used up"}

LOST = 'lost_messages'
"""Metadata record: number of messages of each topic for which the queue had no space."""

NOT_UNDERSTOOD = 'messages_not_understood'
"""Metadata record: number of messages of each topic that the recorder could not decode."""


@dataclass(frozen=True)
class Options:
    """
    Options of a recording.

    Attributes
    ----------
    compression
        compression of chunks: `zstd`, `lz4` or `none`.
    flush_period
        time in s after which a message is on the disk.
    max_size
        size in bytes after which a new part starts; 0: one file.
    max_duration
        duration in ns of the robot's time after which a new part starts; 0: one file.
    max_parts
        number of parts that are kept, and the oldest are deleted; 0: all.
    queue_size
        maximum size in bytes of the messages that wait for the disk.

    """

    compression: str = 'zstd'
    flush_period: float = 0.2
    max_size: int = 0
    max_duration: int = 0
    max_parts: int = 0
    queue_size: int = 64_000_000

    @property
    def is_split(self) -> bool:
        """Whether the recording is a folder of parts."""
        return bool(self.max_size or self.max_duration)


class Recording:
    """
    Messages that are written into one file, or into the parts of a folder.

    Messages that do not fit into the queue are counted and lost: a slow or full disk never
    delays the caller. A full disk is tried again until it has space.

    One part is `NAME.mcap`; several are `NAME/NAME_0.mcap`, `NAME/NAME_1.mcap`, ... with the
    `metadata.yaml` that makes them one recording for ROS 2. Every part can be read alone: it
    starts with the last message of each topic that `holds`.

    Attributes
    ----------
    path
        file, or folder of the parts.
    lost
        number of lost messages of each topic.
    not_understood
        number of messages of each topic that the caller could not decode.
    trouble
        error of the disk; None while it takes everything.
    failure
        exception that ended the writing thread; None if there was none.

    """

    def __init__(
        self,
        path: Path,
        options: Options,
        opening: Callable[[LogWriter], None] = lambda _: None,
        closing: Callable[[LogWriter], None] = lambda _: None,
    ) -> None:
        """
        Open the first file and start the thread.

        Parameters
        ----------
        path
            the file, `NAME.mcap`.
        options
            options of the recording.
        opening
            function that writes the data known at the start into each part.
        closing
            function that writes the data known at the end into each part; called from the
            writing thread.

        Raises
        ------
        InputError
            if the file cannot be written.

        """
        self.path = path
        self._options = options
        self._opening, self._closing = opening, closing
        if options.is_split:
            self.path = path.with_suffix('')
            _make(self.path)
        self._topics: list[RecordedTopic] = []
        # Last message of each channel that holds.
        self._held: dict[int, bytes] = {}
        self._parts: list[Part] = []
        self._opened = 0
        # Least robot's time in ns of the current part of a recording in parts.
        self._first: int | None = None
        self._has_messages = False
        self._queue: deque[Callable[[], object] | tuple[int, list[Message]]] = deque()
        self._queued = self._taken = self._last_channel = 0
        self._stop = threading.Event()
        self.lost: Counter[str] = Counter()
        self.not_understood: Mapping[str, int] = {}
        self.trouble: str | None = None
        self.failure: BaseException | None = None
        self._log = self._open()
        self._thread = threading.Thread(target=self._run, name='recording')
        self._thread.start()
        # A separate thread, because a disk may need seconds for it: flushes continue meanwhile.
        threading.Thread(target=self._sync, name='recording sync', daemon=True).start()

    def channel(
        self, topic: str, type_name: str, *qos: Qos, defined: Definition | None = None,
        holds: bool = False, has_robot_time: bool = True,
    ) -> int:
        """
        Add a topic, as `LogWriter.channel`; return the number of its channel for `write`.

        `holds` states that a message is valid until the next one, without a time limit.
        `has_robot_time` states that `max_duration` applies to its log times: stamps of another
        clock are arbitrarily far from them.
        """
        self._topics.append(RecordedTopic(topic, type_name, qos, defined, holds, has_robot_time))
        number = len(self._topics)
        self._queue.append(partial(self._add_channel, number))
        return number

    def write(self, channel: int, time_ns: int, data: bytes) -> bool:
        """Queue a message; return False if the queue has no space and the message is lost."""
        return self.write_all([(channel, time_ns, data)]) > 0

    def write_all(self, messages: list[Message]) -> int:
        """
        Queue messages, and return how many fitted; the others are lost.

        The caller does not change the list afterwards.
        """
        size = sum(len(data) for _, _, data in messages) + _OVERHEAD * len(messages)
        space = self._options.queue_size - self.backlog
        if size > space:
            size, messages = self._fitting(messages, space)
        self._queued += size
        self._queue.append((size, messages))
        return len(messages)

    def _fitting(self, messages: list[Message], space: int) -> tuple[int, list[Message]]:
        """Return the messages that fit into `space` bytes, their size first; count the others."""
        fitting, taken = [], 0
        for message in messages:
            size = len(message[2]) + _OVERHEAD
            if taken + size <= space:
                fitting.append(message)
                taken += size
            else:
                self.lost[self._topics[message[0] - 1].name] += 1
        return taken, fitting

    @property
    def backlog(self) -> int:
        """Bytes that wait in the queue or for the disk."""
        return self._queued - self._taken + self._log.pending

    @property
    def is_congested(self) -> bool:
        """Whether senders should send less because half of the queue is used."""
        return self.backlog > self._options.queue_size // 2

    def close(self) -> None:
        """
        Write all queued messages and complete the file.

        Raises
        ------
        InputError
            if the disk does not take it; its present content can be recovered.

        """
        self._stop.set()
        self._thread.join()
        if self.failure is not None:
            raise self.failure

    # In the writing thread.

    def _run(self) -> None:
        due = time.monotonic() + self._options.flush_period
        try:
            while not self._stop.wait(_TURN):
                self._drain()
                now = time.monotonic()
                if now >= due:
                    self._commit()
                    due = now + self._options.flush_period
            self._drain()
            self._end_part(self._parts[-1])
        except BaseException as error:  # close() raises it
            self.failure = error
            self._log.close_file()

    def _sync(self) -> None:
        """Flush the file to the disk periodically (fsync), in a separate thread."""
        while not self._stop.wait(_SYNC):
            with suppress(OSError):
                self._log.sync()

    def _drain(self) -> None:
        """Write all queued messages and channels."""
        while self._queue:
            item = self._queue.popleft()
            if callable(item):
                item()
                continue
            size, messages = item
            if messages:
                self._write(messages)
            self._taken += size

    def _write(self, messages: list[Message]) -> None:
        records, first = arrived_records(messages), 0
        while first < len(messages):
            count = self._space(records, first)
            if not count:
                self._next_part(messages[first][1])
                count = max(1, self._space(records, first))
            start, first = first, self._log.write_records(records, first, first + count)
            if self._options.is_split:
                self._note(messages[start:first])
            if self._log.pending > _BATCH and self.trouble is None:
                self._commit(whole=False)

    def _space(self, records: MessageRecords, start: int) -> int:
        """Return how many of the messages from `start` on belong to the current part."""
        size, duration = self._options.max_size, self._options.max_duration
        times = records.times[start:]
        if self.trouble is not None:
            return len(times)
        if size and self._log.size >= size:
            return int(not self._has_messages)
        if not duration:
            return len(times)
        is_timed = np.array([self._topics[n - 1].has_robot_time for n in records.channels[start:]])
        latest = np.iinfo(np.int64).max if self._first is None else self._first
        firsts = np.minimum(np.minimum.accumulate(np.where(is_timed, times, latest)), latest)
        is_late = is_timed & (times - firsts >= duration)
        return int(np.argmax(is_late)) if is_late.any() else len(times)

    def _note(self, messages: list[Message]) -> None:
        """Note data for the limits of a part and for the start of the next one."""
        self._has_messages = True
        times = [time for n, time, _ in messages if self._topics[n - 1].has_robot_time]
        if times:
            self._first = min(times if self._first is None else [*times, self._first])
        self._held.update({n: data for n, _, data in messages if self._topics[n - 1].holds})

    def _commit(self, *, whole: bool = True, durable: bool = False) -> bool:
        """Commit the log; note whether the disk takes it, and return True if it does."""
        try:
            self._log.commit(whole=whole, durable=durable)
        except OSError as error:
            self.trouble = _REASONS.get(error.errno or 0, error.strerror or str(error))
            return False
        self.trouble = None
        return True

    def _open(self) -> LogWriter:
        """Open the next part."""
        path = self.path
        if self._options.is_split:
            path = self.path / f'{self.path.name}_{self._opened}.mcap'
        log = LogWriter(path, self._options.compression, live=True)
        self._parts.append(Part(path.name))
        self._opened += 1
        self._first, self._has_messages = None, False
        self._opening(log)
        return log

    def _next_part(self, time_ns: int) -> None:
        """Complete the part and start the next; keep the old one if that fails."""
        try:
            log = self._open()
        except InputError as error:
            self.trouble = str(error)
            return
        try:
            self._end_part(self._parts[-2])
        except InputError:
            # Nothing of the new part is needed, and an empty file is no log.
            log.close_file()
            log.path.unlink(missing_ok=True)
            raise
        self._log = log
        log.metadata(REPEATED, {self._topics[number - 1].name: '1' for number in self._held})
        for number in range(1, self._last_channel + 1):
            self._add_channel(number)
        for channel, data in self._held.items():
            log.write(channel, time_ns, data)

    def _add_channel(self, number: int) -> None:
        # A log numbers its channels as the recording does: in order, from 1.
        topic = self._topics[number - 1]
        self._last_channel = self._log.channel(
            topic.name, topic.type_name, *topic.qos, defined=topic.defined
        )

    def _end_part(self, part: Part) -> None:
        """Complete the current file, and describe it in the metadata of the folder."""
        log = self._log
        for name, counts in ((LOST, self.lost), (NOT_UNDERSTOOD, self.not_understood)):
            # The caller's thread may add topics meanwhile.
            texts = {topic: str(count) for topic, count in dict(counts).items()}
            if texts:
                log.metadata(name, texts)
        self._closing(log)
        log.finish()
        if not self._succeeds(partial(self._commit, whole=False, durable=True)):
            raise InputError(
                f'{log.path}: {self.trouble}; what it took is there, and'
                f' `masmc recover {log.path}` completes it'
            )
        log.close_file()
        if self._options.is_split:
            statistics = log.statistics
            part.first, part.last = statistics.message_start_time, statistics.message_end_time
            part.messages = statistics.message_count
            part.counts = statistics.channel_message_counts
            most = self._options.max_parts or self._opened
            deleted, self._parts = self._parts[:-most], self._parts[-most:]
            messages: Counter[int] = Counter()
            for kept in self._parts:
                messages.update(kept.counts)
            topics = enumerate(self._topics[:self._last_channel], 1)
            counted = [(topic, messages[number]) for number, topic in topics]
            if not self._succeeds(partial(self._write_metadata, counted)):
                raise InputError(str(self.trouble))
            for old in deleted:
                # Another program may have moved it.
                with suppress(OSError):
                    (self.path / old.name).unlink()

    def _write_metadata(self, topics: list[tuple[RecordedTopic, int]]) -> bool:
        """Describe the folder; note whether the disk takes it, and return True if it does."""
        try:
            write_bag_metadata(self.path, self._parts, topics)
        except InputError as error:
            self.trouble = str(error)
            return False
        self.trouble = None
        return True

    def _succeeds(self, attempt: Callable[[], bool]) -> bool:
        """
        Repeat an attempt until it returns True.

        Messages wait in the queue meanwhile. Returns False if the recording has ended and 3 s of
        further attempts have failed.
        """
        limit = math.inf
        while not attempt():
            if self._stop.is_set():
                limit = min(limit, time.monotonic() + _LAST_TRIES)
            if time.monotonic() > limit:
                return False
            time.sleep(_TURN)
        return True


def clear_recording(folder: Path) -> None:
    """
    Remove the parts of an earlier recording from its folder.

    Raises
    ------
    InputError
        if the folder contains another file, if another recorder writes a part, or if a file
        cannot be removed.

    """
    try:
        if not folder.is_dir():
            raise InputError(f'{folder}: is not a folder; name another')
        paths = set(folder.iterdir())
        for path in paths:
            if path.suffix != '.mcap' and path.name != METADATA_FILE:
                raise InputError(f'{path}: is no part of a recording; name another folder')
        with ExitStack() as locks:
            for path in paths:
                if path.suffix == '.mcap':
                    stream = locks.enter_context(path.open('r+b'))
                    fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # A recorder may have started its next part, and completed the locked one.
            if set(folder.iterdir()) != paths:
                raise BlockingIOError
            for path in paths:
                path.unlink()
    except BlockingIOError as error:
        raise InputError(f'{folder}: another recorder writes it; name another folder') from error
    except OSError as error:
        raise InputError(f'{folder}: cannot be replaced: {error.strerror}') from error


def _make(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except FileNotFoundError as error:
        raise InputError(
            f'{folder}: folder {folder.parent} does not exist; create it or name another'
        ) from error
    except OSError as error:
        raise InputError(f'{folder}: cannot be made: {error.strerror}') from error
