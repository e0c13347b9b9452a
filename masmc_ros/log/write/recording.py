# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A live recording: messages are queued here, and a thread of its own writes them."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
import errno
from functools import partial
import os
from pathlib import Path
import threading
import time
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.log.bag import METADATA_FILE, Part, RecordedTopic, write_bag_metadata
from masmc_ros.log.mcap.chunks import arrived_records, Message
from masmc_ros.log.qos import Qos
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.definitions import Definition
import numpy as np
from numpy.typing import NDArray

_TURN = 0.02
"""Time in s between two looks into the queue."""

_SYNC = 1.0
"""Time in s between two times at which the file is made safe from a power cut."""

_BATCH = 2**20
"""Bytes of complete chunks that are handed to the disk without waiting for a flush."""

_OVERHEAD = 64
"""Bytes that a queued message takes beside its data."""

_LAST_TRIES = 3.0
"""Time in s for which a disk that takes nothing is asked again at the end."""

_REASONS = {errno.ENOSPC: 'the disk is full', errno.EDQUOT: "the user's quota is used up"}

LOST = 'lost_messages'
"""Metadata record: how many messages of each topic found no place in the queue."""

NOT_UNDERSTOOD = 'messages_not_understood'
"""Metadata record: how many messages of each topic are recorded as they came, unread."""


@dataclass(frozen=True)
class Options:
    """
    How a recording is written.

    Attributes
    ----------
    compression
        of chunks, `zstd`, `lz4` or `none`.
    flush_period
        time in s after which what came is on the disk.
    max_size
        bytes after which a new part begins; 0 is one file.
    max_duration
        time in ns of the messages after which a new part begins; 0 is one file.
    queue_size
        bytes of messages that wait for the disk at most.

    """

    compression: str = 'zstd'
    flush_period: float = 0.2
    max_size: int = 0
    max_duration: int = 0
    queue_size: int = 64_000_000

    @property
    def is_split(self) -> bool:
        """Whether the recording is a folder of parts."""
        return bool(self.max_size or self.max_duration)


class Recording:
    """
    Messages on their way into one file, or into the parts of a folder.

    What does not fit into the queue is counted and left out: a slow or full disk never holds
    up who records. A full disk is asked again and again, and the recording goes on where it
    was as soon as there is space.

    One part is `NAME.mcap`; several are `NAME/NAME_0.mcap`, `NAME/NAME_1.mcap`, ... beside the
    `metadata.yaml` by which ROS 2 knows them for one recording. Every part can be read alone:
    it begins with the last message of each topic that `holds`.
    """

    def __init__(
        self,
        path: Path,
        options: Options,
        opening: Callable[[LogWriter], None] = lambda _: None,
        closing: Callable[[LogWriter], None] = lambda _: None,
    ) -> None:
        """
        Open the first file.

        Parameters
        ----------
        path
            the file, `NAME.mcap`.
        options
            how to write.
        opening
            writes into each part what is known at its start.
        closing
            writes into each part what is known at its end; called from the thread
            that writes.

        Raises
        ------
        InputError
            where there can be no such file.

        """
        self.path = path
        self._options = options
        self._opening, self._closing = opening, closing
        if options.is_split:
            self.path = path.with_suffix('')
            _make(self.path)
        self._topics: list[RecordedTopic] = []
        self._held: dict[int, bytes] = {}
        """Last message of each channel that holds."""
        self._parts: list[Part] = []
        self._first: int | None = None
        """First log time of the current part in ns, for a recording in parts."""
        self._counts: Counter[int] = Counter()
        self._holding: set[int] = set()
        self._queue: deque[Any] = deque()
        self._queued = self._taken = self._last_channel = 0
        self._stop = threading.Event()
        self.lost: dict[str, int] = {}
        self.not_understood: Mapping[str, int] = {}
        """How many messages of each topic whoever records could not read."""
        self.trouble: str | None = None
        """What the disk says, None while it takes everything."""
        self.failure: BaseException | None = None
        """What ended the writing thread, None for nothing."""
        self._log = self._open()
        self._thread = threading.Thread(target=self._run, name='recording')
        self._thread.start()
        # A disk may take its time for this: a thread of its own, so that flushes go on.
        self._syncing = threading.Thread(target=self._sync, name='recording sync', daemon=True)
        self._syncing.start()

    def channel(
        self,
        topic: str,
        type_name: str,
        *qos: Qos,
        defined: Definition | None = None,
        holds: bool = False,
    ) -> int:
        """
        Add a topic, as `LogWriter.channel`; return the number by which `write` knows it.

        `holds` tells that a message is valid until the next one, however long that takes.
        """
        self._topics.append(RecordedTopic(topic, type_name, qos, defined))
        number = len(self._topics)
        if holds:
            self._holding.add(number)
        self._queue.append(partial(self._add_channel, number))
        return number

    def write(self, channel: int, time_ns: int, data: bytes) -> bool:
        """Queue a message; False where it found no place and is lost."""
        return self.write_all([(channel, time_ns, data)]) > 0

    def write_all(self, messages: list[Message]) -> int:
        """
        Queue messages, and return how many found a place; the others are lost.

        The list belongs to the recording from here on.
        """
        size = sum(len(data) for _, _, data in messages) + _OVERHEAD * len(messages)
        room = self._options.queue_size - self.backlog
        if size > room:
            size, messages = self._fitting(messages, room)
        self._queued += size
        self._queue.append((size, messages))
        return len(messages)

    def _fitting(self, messages: list[Message], room: int) -> tuple[int, list[Message]]:
        """Return messages that fit into so many bytes, their size first; count the others."""
        fitting, taken = [], 0
        for message in messages:
            size = len(message[2]) + _OVERHEAD
            if taken + size <= room:
                fitting.append(message)
                taken += size
            else:
                topic = self._topics[message[0] - 1].name
                self.lost[topic] = self.lost.get(topic, 0) + 1
        return taken, fitting

    @property
    def backlog(self) -> int:
        """Bytes that wait, in the queue or for the disk."""
        return self._queued - self._taken + self._log.pending

    @property
    def is_congested(self) -> bool:
        """Whether so much waits that whoever can should send less."""
        return self.backlog > self._options.queue_size // 2

    def close(self) -> None:
        """
        Write what is queued, complete the file.

        Raises
        ------
        InputError
            where the disk does not take it; what it has taken can be recovered.

        """
        self._stop.set()
        self._thread.join()
        if self.failure is not None:
            raise self.failure

    # In the thread that writes.

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
        except BaseException as error:  # told by close()
            self.failure = error
            self._log.discard()

    def _sync(self) -> None:
        """Bring what is in the file behind what a power cut can harm, now and then."""
        while not self._stop.wait(_SYNC):
            with suppress(OSError):
                self._log.sync()

    def _drain(self) -> None:
        queue = self._queue
        while queue:
            item = queue.popleft()
            if not isinstance(item, tuple):
                item()
                continue
            size, messages = item
            if messages:
                self._write(messages)
            self._taken += size

    def _write(self, messages: list[Message]) -> None:
        records, first = arrived_records(messages), 0
        while first < len(messages):
            count = self._room(records.times[first:])
            if not count:
                self._next_part(messages[first][1])
                count = max(1, self._room(records.times[first:]))
            begin, first = first, self._log.write_records(records, first, first + count)
            self._note(messages[begin:first])
            if self._log.pending > _BATCH and self.trouble is None:
                self._commit(whole=False)

    def _room(self, times: NDArray[np.int64]) -> int:
        """Return how many of the next messages, at times in ns, the part has room for."""
        size, duration = self._options.max_size, self._options.max_duration
        begin = self._first
        if self.trouble is not None:
            return len(times)
        if size and self._log.size >= size:
            return int(begin is None)
        if not duration:
            return len(times)
        begins = np.minimum.accumulate(times if begin is None else np.append(begin, times)[:-1])
        late = times - begins >= duration
        return int(np.argmax(late)) if late.any() else len(times)

    def _note(self, messages: list[Message]) -> None:
        """Note what the limits of a part and the start of the next one need."""
        if self._options.is_split:
            times = [time for _, time, _ in messages]
            self._first = min(times if self._first is None else (self._first, *times))
            self._held.update({each: data for each, _, data in messages if each in self._holding})

    def _commit(self, *, whole: bool = True) -> bool:
        try:
            self._log.commit(whole=whole)
        except OSError as error:
            self.trouble = _REASONS.get(error.errno or 0, error.strerror or str(error))
            return False
        self.trouble = None
        return True

    def _open(self) -> LogWriter:
        """Open the next part, with everything in it that the earlier ones had."""
        number = len(self._parts)
        path = self.path
        if self._options.is_split:
            path = self.path / f'{self.path.name}_{number}.mcap'
        log = LogWriter(path, self._options.compression, live=True)
        self._parts.append(Part(path.name))
        self._first = None
        self._opening(log)
        return log

    def _next_part(self, time_ns: int) -> None:
        """Complete the part and begin the next; go on with the old one where that fails."""
        try:
            new = self._open()
        except InputError as error:
            self.trouble = str(error)
            return
        self._end_part(self._parts[-2])
        self._log = new
        for number in range(1, self._last_channel + 1):
            self._add_channel(number)
        for channel, data in self._held.items():
            new.write(channel, time_ns, data)
            self._first = time_ns

    def _add_channel(self, number: int) -> None:
        # A log numbers its channels as they are numbered here: in order, from 1 on.
        topic, type_name, qos, defined = self._topics[number - 1]
        self._last_channel = self._log.channel(topic, type_name, *qos, defined=defined)

    def _end_part(self, part: Part) -> None:
        log = self._log
        if self.lost:
            log.metadata(LOST, {topic: str(count) for topic, count in self.lost.items()})
        unclear = dict(self.not_understood)
        if unclear:
            log.metadata(NOT_UNDERSTOOD, {topic: str(count) for topic, count in unclear.items()})
        self._closing(log)
        log.finish()
        limit = time.monotonic() + _LAST_TRIES
        while True:
            try:
                log.commit(whole=False, durable=True)
                break
            except OSError as error:
                reason = _REASONS.get(error.errno or 0, error.strerror or str(error))
                if time.monotonic() > limit:
                    log.discard()
                    raise InputError(
                        f'{log.path}: {reason}; what it took is there, and'
                        f' `masmc recover {log.path}` makes a complete log of it'
                    ) from error
                time.sleep(_TURN)
        log.close_file()
        if self._options.is_split:
            statistics = log.statistics
            part.first, part.last = statistics.message_start_time, statistics.message_end_time
            part.messages = statistics.message_count
            self._counts.update(statistics.channel_message_counts)
            topics = enumerate(self._topics[:self._last_channel], 1)
            counted = [(topic, self._counts[number]) for number, topic in topics]
            write_bag_metadata(self.path, self._parts, counted)


def clear_recording(folder: Path) -> None:
    """
    Remove the parts of an earlier recording from its folder.

    Raises
    ------
    InputError
        where something else is there, or where it cannot be removed.

    """
    try:
        if not folder.is_dir():
            raise InputError(f'{folder}: is not a folder; name another')
        for path in folder.iterdir():
            if path.suffix != '.mcap' and path.name != METADATA_FILE:
                raise InputError(f'{path}: is no part of a recording; name another folder')
        for path in folder.iterdir():
            path.unlink()
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
    if not os.access(folder, os.W_OK):
        raise InputError(f'{folder}: cannot be written; name a folder of yours')
