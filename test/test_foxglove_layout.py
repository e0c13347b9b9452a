# SPDX-License-Identifier: Apache-2.0
"""What the Foxglove layout names is in a run's log, and its panels are all there."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import re
from typing import Any

import pytest
from viewed_run import computed_run, decoded, ROOT

from masmc_ros.log.names import ODOM_FRAME
from masmc_ros.log.topics import SYSTEM_TOPICS

LAYOUT = ROOT / 'config' / 'foxglove.json'
PANELS = {'3D', 'Plot', 'Parameters', 'RawMessages', 'RosOut'}
_STEP = re.compile(r'\.(\w+)|\[(\d+|:)\]')
_SCRIPT_TOPIC = re.compile(r'export const (input|output)s? = \[?([^\]\n;]+)')


@pytest.fixture(scope='module')
def layout() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(LAYOUT.read_text(encoding='utf-8'))
    return found


@pytest.fixture(scope='module')
def messages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return the last message of every topic of a run."""
    return dict(decoded(computed_run(tmp_path_factory.mktemp('run'))))


def scripts(layout: dict[str, Any]) -> dict[str, list[str]]:
    """Return the topics that scripts make, and of which topics they make them."""
    made = {}
    for script in layout['userNodes'].values():
        names = {
            kind: re.findall(r'"([^"]+)"', text)
            for kind, text in _SCRIPT_TOPIC.findall(script['sourceCode'])
        }
        made[names['output'][0]] = names['input']
    return made


def message_paths(config: Any) -> Iterator[str]:
    """Yield every message path of a panel."""
    for series in config.get('paths', []):
        yield series['value']
        if 'xValuePath' in series:
            yield series['xValuePath']
    if 'xAxisPath' in config:
        yield config['xAxisPath']['value']


def follow(message: Any, path: str) -> Any:
    """Return what a message path without its topic finds in a message."""
    steps = list(_STEP.finditer(path))
    assert ''.join(step[0] for step in steps) == path, f'not understood: {path}'
    for number, step in enumerate(steps):
        if step[1]:
            message = getattr(message, step[1])
        elif step[2] == ':':
            rest = ''.join(s[0] for s in steps[number + 1 :])
            return [follow(each, rest) for each in message]
        else:
            message = message[int(step[2])]
    return message


def test_it_has_the_keys_of_a_layout(layout: dict[str, Any]) -> None:
    assert set(layout) == {
        'configById',
        'globalVariables',
        'layout',
        'playbackConfig',
        'userNodes',
    }


def test_every_panel_of_the_tree_has_a_configuration_and_the_other_way_round(
    layout: dict[str, Any],
) -> None:
    def panels(node: Any) -> Iterator[str]:
        if isinstance(node, str):
            yield node
            return
        assert node['direction'] in ('row', 'column')
        assert 0 < node['splitPercentage'] < 100
        yield from panels(node['first'])
        yield from panels(node['second'])

    shown = list(panels(layout['layout']))
    assert len(shown) == len(set(shown))
    assert set(shown) == set(layout['configById'])
    assert {name.split('!')[0] for name in shown} == PANELS


def test_every_plotted_value_is_a_number_in_the_log(
    layout: dict[str, Any], messages: dict[str, Any]
) -> None:
    made = scripts(layout)
    plotted = {path for config in layout['configById'].values() for path in message_paths(config)}
    assert len(plotted) > 20
    for path in plotted:
        topic, _, rest = path.partition('.')
        if topic in made:
            continue
        value = follow(messages[topic], f'.{rest}')
        assert value != []
        for number in value if isinstance(value, list) else [value]:
            assert isinstance(number, float), path


def test_every_topic_is_in_the_log_or_made_of_such(
    layout: dict[str, Any], messages: dict[str, Any]
) -> None:
    configs = layout['configById']
    made = scripts(layout)
    # Only nodes that run tell these.
    known = {*messages, *(topic.name for topic in SYSTEM_TOPICS), '/controller/state'}
    assert {topic for inputs in made.values() for topic in inputs} <= set(messages)
    named = {path.partition('.')[0] for c in configs.values() for path in message_paths(c)}
    named |= set(configs['3D!scene']['topics'])
    for key in ('topicPath', 'topicToRender'):
        named |= {config[key] for config in configs.values() if key in config}
    assert set(made) <= named <= known | set(made)


def test_telemetry_is_plotted_without_its_stamp_and_as_a_whole(
    layout: dict[str, Any], messages: dict[str, Any]
) -> None:
    plotted = {path for config in layout['configById'].values() for path in message_paths(config)}
    for topic, message in messages.items():
        if topic.startswith('/controller/') and topic != '/controller/parameters':
            first = message.layout.data_offset
            assert {path for path in plotted if path.startswith(topic)} == {
                f'{topic}.data[{index}]' for index in range(first, len(message.data))
            }
    assert {path for path in plotted if path.startswith('/effort_commands')} == {
        f'/effort_commands.data[{index}]' for index in range(4)
    }


def test_the_scene_shows_the_robot_where_it_is(
    layout: dict[str, Any], messages: dict[str, Any]
) -> None:
    scene = layout['configById']['3D!scene']
    frames = {each.header.frame_id for each in messages['/tf'].transforms}
    assert scene['fixedFrame'] == scene['followTf'] == ODOM_FRAME
    assert ODOM_FRAME in frames
    assert scene['scene']['transforms']['visible']
    for topic in ('/robot_description', '/path/desired', '/path/actual'):
        assert scene['topics'][topic]['visible']


def test_the_layout_is_installed() -> None:
    from masmc_ros.share import shared_file

    assert shared_file('config', LAYOUT.name) == Path(LAYOUT)
