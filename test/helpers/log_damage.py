# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Damaged logs: errors of a disk, of a transfer and of a faulty program."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
import random

from masmc_ros.log.codec import RECORD_HEAD, records
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import Writer

Mutation = Callable[[random.Random, bytes], bytes]


def flips(draw: random.Random, data: bytes) -> bytes:
    """Change single bits."""
    changed = bytearray(data)
    for _ in range(draw.choice([1, 1, 3, 20])):
        changed[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    return bytes(changed)


def zeroed_run(draw: random.Random, data: bytes) -> bytes:
    start = draw.randrange(len(data))
    size = min(draw.choice([1, 8, 100, 4096]), len(data) - start)
    return data[:start] + bytes(size) + data[start + size:]


def dropped_piece(draw: random.Random, data: bytes) -> bytes:
    start = draw.randrange(len(data))
    return data[:start] + data[start + draw.choice([1, 3, 9, 200, 5000]):]


def doubled_piece(draw: random.Random, data: bytes) -> bytes:
    start = draw.randrange(len(data))
    end = start + draw.choice([1, 3, 9, 200, 5000, len(data)])
    return data[:end] + data[start:]


def swapped_pieces(draw: random.Random, data: bytes) -> bytes:
    first, second, third = sorted(draw.sample(range(len(data)), 3))
    return data[:first] + data[second:third] + data[first:second] + data[third:]


def wrong_length(draw: random.Random, data: bytes) -> bytes:
    """Write a wrong length into the head of a record."""
    start = draw.choice([start for _, start, _ in records(data)])
    opcode, length = RECORD_HEAD.unpack_from(data, start)
    wrong = draw.choice([0, length - 1, length + 1, length + 100, 2**31, 2**63, 2**64 - 1])
    head = RECORD_HEAD.pack(opcode, max(0, wrong))
    return data[:start] + head + data[start + len(head):]


def wrong_opcode(draw: random.Random, data: bytes) -> bytes:
    """Write a wrong kind into the head of a record."""
    start = draw.choice([start for _, start, _ in records(data)])
    return data[:start] + bytes([draw.choice([0, *range(1, 18), 128, 255])]) + data[start + 1:]


def wrong_opcode_of_a_chunk(draw: random.Random, data: bytes) -> bytes:
    start = draw.choice([start for opcode, start, _ in records(data) if opcode == Opcode.CHUNK])
    return data[:start] + bytes([draw.choice([0, *range(1, 18), 128, 255])]) + data[start + 1:]


def flips_in_heads(draw: random.Random, data: bytes) -> bytes:
    """Change bits in the heads of records: their kind, and the lengths of their fields."""
    changed = bytearray(data)
    for _ in range(draw.choice([1, 1, 2])):
        start = draw.choice([start for _, start, _ in records(data)])
        place = min(start + draw.randrange(48), len(data) - 1)
        changed[place] ^= 1 << draw.randrange(8)
    return bytes(changed)


def truncated_and_flipped(draw: random.Random, data: bytes) -> bytes:
    return flips(draw, data)[: draw.randrange(len(data))]


BYTES: tuple[Mutation, ...] = (
    flips,
    zeroed_run,
    dropped_piece,
    doubled_piece,
    swapped_pieces,
    wrong_length,
    wrong_opcode,
    wrong_opcode_of_a_chunk,
    flips_in_heads,
    truncated_and_flipped,
)
"""Changes of a file's bytes; checksums reveal most of them."""


def wrong_contents(draw: random.Random, data: bytes) -> bytes:
    """Return a copy of a log with wrong contents but valid checksums and indexes."""
    reader = make_reader(BytesIO(data))
    kinds = ('schema', 'type', 'encoding', 'topic', 'message', 'time', 'metadata', 'missing')
    kind = draw.choice(kinds)
    stream = BytesIO()
    writer = Writer(stream, chunk_size=64 * 1024)
    writer.start(profile='ros2', library='damaged')
    summary = reader.get_summary()
    assert summary is not None
    chosen = draw.choice(sorted(summary.channels))
    channels = {}
    for number, channel in summary.channels.items():
        schema = summary.schemas[channel.schema_id]
        text, name, encoding = schema.data, schema.name, 'ros2msg'
        topic, of_messages = channel.topic, channel.message_encoding
        if number == chosen:
            if kind == 'schema':
                text = draw.choice([flips, zeroed_run, dropped_piece])(draw, text)
            elif kind == 'type':
                name = draw.choice(['std_msgs/msg/Float64', 'x', '', 'a/b/c/d'])
            elif kind == 'encoding':
                unusual = [('', 'cdr'), ('ros2idl', 'cdr'), ('', 'json'), ('ros2msg', '')]
                encoding, of_messages = draw.choice(unusual)
            elif kind == 'topic':
                others = [channel.topic for channel in summary.channels.values()]
                topic = draw.choice([*others, '', '/x' + topic, '\0'])
        schema_id = writer.register_schema(name, encoding, text)
        channels[number] = writer.register_channel(topic, of_messages, schema_id)
    for _, channel, message in reader.iter_messages(log_time_order=False):
        content, time = message.data, message.log_time
        if channel.id == chosen:
            if kind == 'missing':
                continue
            if kind == 'message' and draw.random() < 0.5:
                content = draw.choice([flips, zeroed_run, dropped_piece])(draw, content)
            elif kind == 'time' and draw.random() < 0.5:
                time = draw.choice([0, 2**63, 2**64 - 1, draw.randrange(2**64)])
        writer.add_message(channels[channel.id], time, content, time)
    for metadata in reader.iter_metadata():
        values = metadata.metadata
        if kind == 'metadata':
            unusual = ['', '{', '[]', '{"a": [[1]]}', '[' * 10000, 'NaN', '1e999', '\0', 'null']
            values = {name: draw.choice([*unusual, text]) for name, text in values.items()}
        writer.add_metadata(metadata.name, values)
    for attachment in reader.iter_attachments():
        writer.add_attachment(
            0, 0, attachment.name, attachment.media_type, attachment.data
        )
    writer.finish()
    return stream.getvalue()


def damaged(number: int, logs: list[bytes]) -> tuple[bytes, str]:
    """Return a damaged copy of one of `logs` and the kind of damage, reproducible by `number`."""
    draw = random.Random(number)
    data = draw.choice(logs)
    if number % 4 == 3:
        return wrong_contents(draw, data), 'wrong_contents'
    mutation = BYTES[number % len(BYTES)]
    return mutation(draw, data), mutation.__name__
