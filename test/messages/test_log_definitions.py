# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Message definitions against those of ROS 2 Jazzy."""

from importlib import import_module
import json
from time import monotonic

from masmc_ros.errors import InputError
from masmc_ros.messages.cdr_layout import definition, definition_of_jazzy, KEPT
from masmc_ros.messages.path import POSE_STAMPED
from masmc_ros.messages.topics import SYSTEM_TOPICS, TOPICS, TWIST_STAMPED
import pytest

TYPES = (
    'builtin_interfaces/msg/Time',
    'geometry_msgs/msg/Twist',
    'nav_msgs/msg/Odometry',
    'rosgraph_msgs/msg/Clock',
    'sensor_msgs/msg/JointState',
    'std_msgs/msg/Float64MultiArray',
    'std_msgs/msg/String',
)


def test_definitions_of_package_equal_jazzy() -> None:
    stored = json.loads(KEPT.read_text('utf-8'))
    types = {topic.type_name for topic in (*TOPICS, *SYSTEM_TOPICS)}
    assert stored.keys() == types | {POSE_STAMPED, TWIST_STAMPED}
    for name, entry in stored.items():
        assert tuple(entry) == definition_of_jazzy(name), 'run: python tools/definitions.py'


def test_definition_text_contains_nested_types() -> None:
    text = definition('sensor_msgs/msg/JointState').text
    assert 'float64[] effort' in text
    assert 'MSG: std_msgs/Header' in text
    assert 'MSG: builtin_interfaces/Time' in text


def test_definition_hash_equals_running_publisher(monkeypatch: pytest.MonkeyPatch) -> None:
    rclpy = pytest.importorskip('rclpy', reason='compares with ROS 2')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = rclpy.Context()
    context.init(domain_id=77)
    try:
        node = rclpy.create_node('test_log_definitions', context=context)
        for type_name in TYPES:
            package, _, name = type_name.split('/')
            kind = getattr(import_module(f'{package}.msg'), name)
            topic = f'/test_{package}_{name}'
            publisher = node.create_publisher(kind, topic, 1)
            deadline = monotonic() + 10.0
            while not (endpoints := node.get_publishers_info_by_topic(topic)):
                assert monotonic() < deadline, f'{topic} was not seen'
            type_hash = endpoints[0].topic_type_hash
            expected = f'RIHS{type_hash.version:02d}_{bytes(type_hash.value).hex()}'
            assert definition(type_name).type_hash == expected
            node.destroy_publisher(publisher)
    finally:
        context.shutdown()


def test_definition_unknown_type_suggests_similar_one() -> None:
    with pytest.raises(InputError, match=r'did you mean .*sensor_msgs/msg/JointState'):
        definition('sensor_msgs/msg/JointStates')
