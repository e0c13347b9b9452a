# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""RViz's configuration reads what a run publishes, in the way it is published."""

from __future__ import annotations

from typing import Any

from helpers.viewed_run import computed_run, decoded, ROOT
from masmc_ros.messages.topics import TOPICS, TRANSFORMS
from masmc_ros.robot.declaration import ODOM_FRAME
import pytest
import yaml

PLUGINS = 'rviz_default_plugins/'
KIND = {'RobotModel': 'std_msgs/msg/String', 'Path': 'nav_msgs/msg/Path'}
"""What displays read from the topic that they name."""


@pytest.fixture(scope='module')
def manager() -> dict[str, Any]:
    text = (ROOT / 'config' / 'masmc.rviz').read_text(encoding='utf-8')
    found: dict[str, Any] = yaml.safe_load(text)['Visualization Manager']
    return found


def displays(manager: dict[str, Any], kind: str) -> list[dict[str, Any]]:
    return [each for each in manager['Displays'] if each['Class'] == PLUGINS + kind]


def test_everything_is_shown(manager: dict[str, Any]) -> None:
    kinds = sorted(each['Class'].removeprefix(PLUGINS) for each in manager['Displays'])
    assert kinds == ['Grid', 'Path', 'Path', 'RobotModel', 'TF']
    assert all(each['Enabled'] for each in manager['Displays'])
    assert TRANSFORMS.name == '/tf'


def test_it_stands_in_a_frame_of_the_robot(
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


def test_what_is_sent_once_is_asked_for_in_retrospect(manager: dict[str, Any]) -> None:
    topics = {topic.name: topic for topic in TOPICS}
    read = [(each['Topic'], 'Path') for each in displays(manager, 'Path')]
    read += [(each['Description Topic'], 'RobotModel') for each in displays(manager, 'RobotModel')]
    assert len({topic['Value'] for topic, _ in read}) == 3
    for topic, kind in read:
        published = topics[topic['Value']]
        assert published.type_name == KIND[kind]
        assert published.is_latched
        assert topic['Durability Policy'] == 'Transient Local'
        assert topic['Reliability Policy'] == 'Reliable'
