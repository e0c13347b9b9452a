# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of third-party publishers on the nodes' topics: valid, invalid and random bytes."""

from __future__ import annotations

import json
import random
import struct
from typing import Any

from masmc_ros.messages.commands import ArmVelocityCdr, EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import string_message
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.telemetry import TelemetryCdr
from masmc_ros.messages.topics import (
    ARM_VELOCITY_TOPIC,
    COMMAND_TOPIC,
    REFERENCE_TOPIC,
    STATE_TOPIC,
    SYSTEM_TOPICS,
    TELEMETRY,
    telemetry_topic,
    TOPICS,
)
from masmc_ros.messages.transforms import TransformsCdr
from masmc_ros.nodes.middleware.ros_topics import message_class
import numpy as np
from rclpy.serialization import serialize_message

TYPES = {
    topic.name: topic.type_name
    for topic in (*TOPICS, *SYSTEM_TOPICS)
    if topic.name not in ('/rosout',)
} | {'recorder/progress': 'builtin_interfaces/msg/Time'}
"""Topics that nodes subscribe to, and their types."""

FIXED = frozenset(
    ('geometry_msgs/msg/Twist', 'builtin_interfaces/msg/Time', 'rosgraph_msgs/msg/Clock')
)
"""Types of a fixed size: the middleware does not accept more bytes."""

NUMBERS = (float('nan'), float('inf'), -float('inf'), -1.0, 1e300, -1e308, 5e-324, 2.0**63, 1e10)
WORDS = (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 999_999_999, 1_000_000_000)


def record(**wrong: Any) -> str:
    """Return a node's record of parameters, with some fields replaced."""
    valid = {
        'node': '/plant',
        'tick': 0,
        'stamp': 0,
        'parameters': {'pacing': 'realtime', 'tf_decimation': 1},
        'changed': [],
        'event': '',
    }
    return json.dumps({**valid, **wrong})


NESTED = '{"node": "/plant", "tick": 0, "stamp": 0, "changed": [], "parameters": {"a": %s}}'
TEXTS = (
    '',
    'null',
    '[]',
    '{}',
    '[' * 100_000,
    '{"a":' * 100_000,
    NESTED % ('[' * 500 + ']' * 500),
    NESTED % ('[' * 50_000 + ']' * 50_000),
    NESTED % '1e999',
    NESTED % ('9' * 5000),
    NESTED % '{"a": {}}',
    NESTED % '"\\ud800"',
    NESTED % '[null, [1], {}]',
    record(tick=float('inf')),
    record(tick=float('nan')),
    record(stamp=float('-inf')),
    record(stamp=-1),
    record(stamp=2**64),
    record(tick=-(10**30)),
    record(node=['x']),
    record(node='/plant\ud800'),
    record(changed=5),
    record(changed=['nothing']),
    record(changed=[['pacing']]),
    record(parameters=[]),
    record(parameters=None),
    record(parameters={'tf_decimation': 'many', 'frame_prefix': 5}),
    record(parameters={'tf_decimation': 1, 'robot.link_1_mass': -1.0, 'control_period': 1e-300}),
    record(parameters={'command_interface': [[1]]}),
    record(event=17),
    'active',
    'fault: \0\0',
)


def valid_message(topic: str) -> bytes:
    """Return a message of a topic like those of this package's nodes."""
    messages = {
        STATE_TOPIC: JointStateCdr(),
        COMMAND_TOPIC: EffortCdr(),
        ARM_VELOCITY_TOPIC: ArmVelocityCdr(),
        '/tf': TransformsCdr(),
        **{telemetry_topic(label): TelemetryCdr(label, n) for label, n in TELEMETRY.items()},
    }
    if topic in messages:
        return bytes(messages[topic].to_bytes())
    if topic == REFERENCE_TOPIC:
        return bytes(serialize_window())
    if TYPES[topic] == 'std_msgs/msg/String':
        return string_message(record())
    return bytes(serialize_message(message_class(TYPES[topic])()))


def serialize_window() -> bytes:
    """Return a window of the reference at rest."""
    return ReferenceWindow(0, 0.01, np.zeros((10, 3, 4))).to_bytes()


def random_message(draw: random.Random, topic: str) -> bytes:
    """Return a random message of a third-party publisher on a topic."""
    if TYPES[topic] == 'std_msgs/msg/String' and draw.random() < 0.7:
        text = draw.choice(TEXTS)
        return string_message(text.encode('utf-8', 'surrogatepass').decode('utf-8', 'replace'))
    changed = bytearray(valid_message(topic))
    kind = draw.randrange(6)
    size = len(changed)
    if kind == 0:
        for _ in range(draw.choice([1, 3, 30])):
            changed[draw.randrange(size)] ^= 1 << draw.randrange(8)
    elif kind == 1 and size >= 12:
        for _ in range(draw.choice([1, 2, 8])):
            offset = 4 + 8 * draw.randrange((size - 4) // 8)
            changed[offset:offset + 8] = struct.pack('<d', draw.choice(NUMBERS))
    elif kind == 2 and size >= 8:
        for _ in range(draw.choice([1, 2])):
            offset = 4 * draw.randrange(1, size // 4)
            changed[offset:offset + 4] = struct.pack('<I', draw.choice(WORDS))
    elif kind == 3:
        changed = changed[: draw.randrange(4, size + 1)]
    elif kind == 4:
        changed[4:] = draw.randbytes(size - 4)
    elif TYPES[topic] not in FIXED:
        changed += draw.randbytes(draw.choice([1, 4, 1000]))
    # The middleware delivers multiples of four bytes.
    return bytes(changed[: len(changed) // 4 * 4])
