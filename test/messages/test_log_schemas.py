# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Definitions in a log against the type stores of readers and the classes of ROS 2."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
import re

from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.topics import SYSTEM_TOPICS, TOPICS
from mcap.reader import make_reader
from mcap_ros2._vendor.rosidl_adapter.parser import Field, parse_message_string
import pytest
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

TYPES = sorted({topic.type_name for topic in (*TOPICS, *SYSTEM_TOPICS)})
_CLASS_NAMES = {'float64': 'double', 'float32': 'float', 'byte': 'octet', 'bool': 'boolean'}
"""Names of basic types in message classes, where they differ from those of definitions."""


@pytest.fixture(scope='module')
def schemas(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the schemas of a log with every type of the project's topics."""
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    with LogWriter(path) as log:
        for type_name in TYPES:
            log.write(log.channel(f'/{type_name}', type_name), 0, bytes(8))
    with path.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    return {schema.name: schema.data.decode() for schema in summary.schemas.values()}


def parts(type_name: str, text: str) -> Iterator[tuple[str, list[Field]]]:
    """Yield the type and its nested types with the fields of their texts."""
    first, *others = re.split(r'^=+\n', text, flags=re.MULTILINE)
    texts = {type_name: first}
    for other in others:
        head, _, body = other.partition('\n')
        package, _, name = head.removeprefix('MSG: ').partition('/')
        texts[f'{package}/msg/{name}'] = body
    for full, body in texts.items():
        package, _, name = full.split('/')
        yield full, parse_message_string(package, name, body).fields


def class_type(field: Field) -> str:
    """Return the type of a field as message classes name it."""
    kind = field.type
    base = _CLASS_NAMES.get(kind.type, kind.type)
    if kind.pkg_name:
        base = f'{kind.pkg_name}/{kind.type}'
    if not kind.is_array:
        return base
    return f'{base}[{kind.array_size}]' if kind.array_size else f'sequence<{base}>'


def test_schemas_contain_the_main_message_types() -> None:
    assert {
        'sensor_msgs/msg/JointState',
        'nav_msgs/msg/Odometry',
        'tf2_msgs/msg/TFMessage',
        'geometry_msgs/msg/Twist',
        'nav_msgs/msg/Path',
        'diagnostic_msgs/msg/DiagnosticArray',
        'std_msgs/msg/Float64MultiArray',
    } <= set(TYPES)


@pytest.mark.parametrize('type_name', TYPES)
def test_schema_read_by_rosbags_equals_its_type_store(
    type_name: str, schemas: dict[str, str]
) -> None:
    known = get_typestore(Stores.ROS2_JAZZY).fielddefs
    read = get_types_from_msg(schemas[type_name], type_name)
    assert type_name in read
    for name, (constants, fields) in read.items():
        assert sorted(constants) == sorted(known[name][0]), name
        assert list(fields) == list(known[name][1]), name


@pytest.mark.parametrize('type_name', TYPES)
def test_schema_fields_equal_message_classes(
    type_name: str, schemas: dict[str, str]
) -> None:
    pytest.importorskip('rclpy', reason='compares with ROS 2')
    compared = 0
    for full, fields in parts(type_name, schemas[type_name]):
        package, _, name = full.split('/')
        try:
            module = import_module(f'{package}.msg')
        except ImportError:
            continue  # tf2_msgs is not available as a wheel
        expected = getattr(module, name).get_fields_and_field_types()
        assert {field.name: class_type(field) for field in fields} == expected, full
        assert [field.name for field in fields] == list(expected), full
        compared += 1
    assert compared > 0
