# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""RViz configuration against the topics of a run and their QoS."""

from __future__ import annotations

from typing import Any

from helpers.viewed_run import computed_run, decoded, ROOT
from masmc_ros.messages.topics import TOPICS, TRANSFORMS
from masmc_ros.robot.declaration import ODOM_FRAME
import pytest
import yaml

PLUGINS = 'rviz_default_plugins/'
KIND = {'RobotModel': 'std_msgs/msg/String', 'Path': 'nav_msgs/msg/Path'}
"""Message type that a display reads."""


@pytest.fixture(scope='module')
def manager() -> dict[str, Any]:
    text = (ROOT / 'config' / 'masmc.rviz').read_text(encoding='utf-8')
    content: dict[str, Any] = yaml.safe_load(text)['Visualization Manager']
    return content


def displays(manager: dict[str, Any], kind: str) -> list[dict[str, Any]]:
    return [display for display in manager['Displays'] if display['Class'] == PLUGINS + kind]


def test_rviz_displays_are_complete_and_enabled(manager: dict[str, Any]) -> None:
    kinds = sorted(display['Class'].removeprefix(PLUGINS) for display in manager['Displays'])
    assert kinds == ['Grid', 'Path', 'Path', 'RobotModel', 'TF']
    assert all(display['Enabled'] for display in manager['Displays'])
    assert TRANSFORMS.name == '/tf'


def test_rviz_fixed_frame_is_published(
    manager: dict[str, Any], tmp_path_factory: pytest.TempPathFactory
) -> None:
    log = computed_run(tmp_path_factory.mktemp('run'), 0.01)
    frames = {
        transform.header.frame_id
        for _, message in decoded(log, '/tf')
        for transform in message.transforms
    }
    assert manager['Global Options']['Fixed Frame'] == ODOM_FRAME
    assert ODOM_FRAME in frames


def test_rviz_latched_topics_have_transient_local_qos(manager: dict[str, Any]) -> None:
    topics = {topic.name: topic for topic in TOPICS}
    read = [(display['Topic'], 'Path') for display in displays(manager, 'Path')]
    read += [
        (display['Description Topic'], 'RobotModel')
        for display in displays(manager, 'RobotModel')
    ]
    assert len({topic['Value'] for topic, _ in read}) == 3
    for topic, kind in read:
        published = topics[topic['Value']]
        assert published.type_name == KIND[kind]
        assert published.is_latched
        assert topic['Durability Policy'] == 'Transient Local'
        assert topic['Reliability Policy'] == 'Reliable'
