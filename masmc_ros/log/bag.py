# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Folders of recordings: `metadata.yaml`, which makes their files one recording for ROS 2.

It contains the quality of service of each topic, which a player offers again. `check_apart`
rejects outputs that are inputs, also through links.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
import os
from pathlib import Path
from typing import NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.files import part_of, write_file
from masmc_ros.messages.cdr_layout import Definition, definition
import yaml

_INFINITE = 'sec: 9223372036\n    nsec: 854775807'


@dataclass(frozen=True)
class Qos:
    """
    Quality of service of a publisher, with the names of ROS 2's QoS policies.

    Attributes
    ----------
    depth
        number of messages in the history.
    history
        `keep_last` or `keep_all`.
    reliability
        `reliable` or `best_effort`.
    durability
        `volatile` or `transient_local`.

    """

    depth: int = 1000
    history: str = 'keep_last'
    reliability: str = 'reliable'
    durability: str = 'volatile'

    def to_yaml(self) -> str:
        """Return an entry of the list `offered_qos_profiles` of rosbag2."""
        return (
            f'- history: {self.history}\n'
            f'  depth: {self.depth}\n'
            f'  reliability: {self.reliability}\n'
            f'  durability: {self.durability}\n'
            f'  deadline:\n    {_INFINITE}\n'
            f'  lifespan:\n    {_INFINITE}\n'
            '  liveliness: automatic\n'
            f'  liveliness_lease_duration:\n    {_INFINITE}\n'
            '  avoid_ros_namespace_conventions: false'
        )


METADATA_FILE = 'metadata.yaml'

REPEATED = 'repeated_messages'
"""Metadata record of each part but the first: topics that start with an earlier message."""

_VERSION = 9
"""Version of the file that rosbag2 of Jazzy writes."""


@dataclass
class Part:
    """
    A file of a recording.

    Attributes
    ----------
    name
        name of the file.
    first, last
        first and last log time in ns.
    messages
        number of messages; 0 until the file is complete.
    counts
        number of messages by channel; empty until the file is complete.

    """

    name: str
    first: int = 0
    last: int = 0
    messages: int = 0
    counts: Mapping[int, int] = field(default_factory=dict)


class RecordedTopic(NamedTuple):
    """
    A topic of a recording, as the files declare it.

    Attributes
    ----------
    name, type_name
        full name, and type such as `sensor_msgs/msg/JointState`.
    qos
        quality of service of each publisher.
    defined
        definition of the type if it is not one of ROS 2 Jazzy.
    holds
        whether a message is valid until the next one.
    has_robot_time
        whether its log times are the robot's time.

    """

    name: str
    type_name: str
    qos: tuple[Qos, ...]
    defined: Definition | None
    holds: bool
    has_robot_time: bool


def write_bag_metadata(
    folder: Path, parts: Sequence[Part], topics: Iterable[tuple[RecordedTopic, int]]
) -> None:
    """
    Write the file; InputError if it cannot be written.

    Parameters
    ----------
    folder
        folder of the recording.
    parts
        its files.
    topics
        its topics, each with its number of messages.

    """
    first = min((part.first for part in parts if part.messages), default=0)
    last = max((part.last for part in parts if part.messages), default=0)
    content = {
        'rosbag2_bagfile_information': {
            'version': _VERSION,
            'storage_identifier': 'mcap',
            'duration': {'nanoseconds': last - first},
            'starting_time': {'nanoseconds_since_epoch': first},
            'message_count': sum(part.messages for part in parts),
            'topics_with_message_count': [_topic(*topic) for topic in topics],
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [part.name for part in parts],
            'files': [
                {
                    'path': part.name,
                    'starting_time': {'nanoseconds_since_epoch': part.first},
                    'duration': {'nanoseconds': part.last - part.first},
                    'message_count': part.messages,
                }
                for part in parts
            ],
            'custom_data': None,
            'ros_distro': 'jazzy',
        }
    }
    text = yaml.safe_dump(content, sort_keys=False)
    write_file(folder / METADATA_FILE, text.encode())


def part_names(folder: Path) -> list[str]:
    """
    Return the files of a recording in their order.

    Raises
    ------
    InputError
        if the folder has no such file, or metadata that cannot be read.

    """
    path = folder / METADATA_FILE
    if path.exists():
        try:
            content = yaml.safe_load(path.read_text(encoding='utf-8'))
            names = content['rosbag2_bagfile_information']['relative_file_paths']
            return [str(name) for name in names]
        except (OSError, ValueError, yaml.YAMLError, LookupError, TypeError, RecursionError) as e:
            raise InputError(
                f'{path}: is not the metadata of a recording; it takes'
                ' rosbag2_bagfile_information with relative_file_paths'
            ) from e
    # rosbag2 compresses whole files with this suffix.
    files = (*folder.glob('*.mcap'), *folder.glob('*.mcap.zstd'))
    names = sorted((path.name for path in files), key=_number)
    if not names:
        raise InputError(f'{folder}: has no .mcap file; name the folder of a recording')
    return names


def _number(name: str) -> tuple[str, int]:
    """Return a key that sorts `run_10.mcap` after `run_9.mcap`."""
    stem, _, number = name.removesuffix('.zstd').removesuffix('.mcap').rpartition('_')
    return (stem, int(number)) if number.isdecimal() else (name, 0)


def _topic(topic: RecordedTopic, messages: int) -> dict[str, object]:
    qos = yaml.safe_load('\n'.join(offered.to_yaml() for offered in topic.qos))
    return {
        'topic_metadata': {
            'name': topic.name,
            'type': topic.type_name,
            'serialization_format': 'cdr',
            'offered_qos_profiles': qos or [],
            'type_description_hash': (topic.defined or definition(topic.type_name)).type_hash,
        },
        'message_count': messages,
    }


def check_apart(outputs: Iterable[Path], inputs: Iterable[str | Path]) -> None:
    """
    Raise InputError if writing a file or a folder would change an input.

    The parts of a recording are inputs as well if its folder is.
    """
    written = [(output, path) for output in outputs for path in (output, part_of(output))]
    for source in inputs:
        for read in _files(Path(source)):
            for output, path in written:
                # One of them may be missing.
                with suppress(OSError, ValueError):
                    if os.path.samefile(path, read):
                        raise InputError(f'{output}: is what is read from {source}; name another')


def _files(source: Path) -> Iterator[Path]:
    yield source
    if os.path.isdir(source):
        yield source / METADATA_FILE
        with suppress(InputError):  # its reader reports it
            yield from (source / name for name in part_names(source))
