# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Copies of logs whose robot description has meshes that a browser can load.

A browser cannot open packages and files. If the description names them, the copy of the log has
a second description at its end, on the same topic and a nanosecond later, with web addresses.
Viewers show the latest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import os
from pathlib import Path
import shutil
from typing import BinaryIO, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.log import codec
from masmc_ros.messages.message import string_message, text_of
from masmc_ros.messages.topics import DESCRIPTION_TOPIC
from masmc_ros.robot.visuals import mesh_files
from mcap.reader import make_reader
from mcap.records import Footer, Message

_DATA_END, _FOOTER = codec.RECORD_HEAD.size + 4, codec.RECORD_HEAD.size + 20
"""Sizes in bytes of the records around the summary."""


class Described(NamedTuple):
    """Last description in a log, and its meshes."""

    text: str
    meshes: Mapping[str, Path]
    message: Message


def described(path: Path) -> Described | None:
    """
    Return the robot description of a log with local meshes; None without one.

    Raises InputError if the log is damaged.
    """
    try:
        with path.open('rb') as stream:
            messages = _descriptions(stream)
    except Exception as error:  # mcap and the compressors raise many kinds for damaged bytes
        raise InputError(
            f'{path}: the log is damaged: {type(error).__name__} {error}; `masmc recover {path}`'
            ' completes it'
        ) from error
    try:
        text = text_of(messages[-1].data)
        meshes = mesh_files(text)
    except (IndexError, InputError):
        return None
    return Described(text, meshes, messages[-1]) if meshes else None


def _descriptions(stream: BinaryIO) -> list[Message]:
    """Return the messages of a log with robot descriptions, in the order of their times."""
    reader = make_reader(stream)
    summary = reader.get_summary()
    channels = {} if summary is None else summary.channels
    topics = [
        channel.topic
        for channel in channels.values()
        if channel.topic.endswith(f'/{DESCRIPTION_TOPIC}')
    ]
    return [message for _, _, message in reader.iter_messages(topics)] if topics else []


def write_with_addresses(
    path: Path, copy: Path, description: Described, address: Callable[[Path], str]
) -> None:
    """Write a copy of a log with a further description at its end, with web addresses."""
    text = description.text
    for name, file in description.meshes.items():
        for quote in '"\'':
            text = text.replace(f'{quote}{name}{quote}', f'{quote}{address(file)}{quote}')
    with path.open('rb') as source, copy.open('wb') as target:
        source.seek(-_FOOTER - len(codec.MAGIC), os.SEEK_END)
        footer = codec.parsed(source.read(_FOOTER))
        assert isinstance(footer, Footer)
        end = footer.summary_start - _DATA_END
        source.seek(0)
        summary = make_reader(source).get_summary()
        source.seek(0)
        shutil.copyfileobj(source, target)
        target.seek(end)
        target.truncate()
        last = description.message
        message = last.channel_id, last.log_time + 1, string_message(text)
        chunk = codec.OpenChunk()
        chunk.add_messages(codec.arrived_records([message]), 0, 1, 0)
        stream = codec.RecordStream(target.write, end, summary)
        stream.add_chunk(chunk.close(), chunk.indexes)
        stream.finish()
