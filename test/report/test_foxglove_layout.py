# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Foxglove layout against the contents of a run's log and the settings of the viewer."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import re
from typing import Any

from helpers.viewed_run import computed_run, decoded, ROOT
from masmc_ros.messages.topics import SYSTEM_TOPICS
from masmc_ros.robot.declaration import ODOM_FRAME
import pytest

LAYOUT = ROOT / 'config' / 'foxglove.json'
SETTINGS = Path(__file__).with_name('viewer_settings.json')
PANELS = {'3D', 'Plot', 'Parameters', 'RawMessages', 'RosOut', 'Tab', 'Table'}
_STEP = re.compile(r'\.(\w+)|\[(\d+|:)\]')
_SCRIPT_TOPIC = re.compile(r'export const (input|output)s? = \[?([^\]\n;]+)')


@pytest.fixture(scope='module')
def layout() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(LAYOUT.read_text(encoding='utf-8'))
    return content


@pytest.fixture(scope='module')
def messages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return the last message of every topic of a run."""
    return dict(decoded(computed_run(tmp_path_factory.mktemp('run'))))


def scripts(layout: dict[str, Any]) -> dict[str, list[str]]:
    """Return the output topic of every script with its input topics."""
    script_topics = {}
    for script in layout['userNodes'].values():
        names = {
            kind: re.findall(r'"([^"]+)"', text)
            for kind, text in _SCRIPT_TOPIC.findall(script['sourceCode'])
        }
        script_topics[names['output'][0]] = names['input']
    return script_topics


def made_fields(layout: dict[str, Any], topic: str) -> set[str]:
    """Return the fields of a script's output."""
    (source,) = (
        script['sourceCode']
        for script in layout['userNodes'].values()
        if f'output = "{topic}"' in script['sourceCode']
    )
    (fields,) = re.findall(r'^type Output = \{\n(.*?)^\};', source, re.DOTALL | re.MULTILINE)
    return set(re.findall(r'^  (\w+): ', fields, re.MULTILINE))


def message_paths(config: Any) -> Iterator[str]:
    """Yield every message path of a panel."""
    for series in config.get('paths', []):
        yield series['value']
    if 'xAxisPath' in config:
        yield config['xAxisPath']['value']


def follow(message: Any, path: str) -> Any:
    """Return the value that a message path, without its topic, selects in a message."""
    steps = list(_STEP.finditer(path))
    assert ''.join(step[0] for step in steps) == path, f'not understood: {path}'
    for number, step in enumerate(steps):
        if step[1]:
            message = getattr(message, step[1])
        elif step[2] == ':':
            remaining_path = ''.join(s[0] for s in steps[number + 1:])
            return [follow(entry, remaining_path) for entry in message]
        else:
            message = message[int(step[2])]
    return message


def test_layout_has_required_keys(layout: dict[str, Any]) -> None:
    assert set(layout) == {
        'configById',
        'globalVariables',
        'layout',
        'playbackConfig',
        'userNodes',
    }


def test_layout_panels_and_configurations_match(
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
    for name in list(shown):
        for tab in layout['configById'][name].get('tabs', ()):
            shown += panels(tab['layout'])
    assert len(shown) == len(set(shown))
    assert set(shown) == set(layout['configById'])
    assert {name.split('!')[0] for name in shown} == PANELS


def settings(value: Any, known: set[str], path: str = '') -> Iterator[str]:
    """Yield the settings of a panel as dotted paths down to a known setting."""
    if path in known or not isinstance(value, dict | list):
        yield path
        return
    for key, entry in value.items() if isinstance(value, dict) else enumerate(value):
        any_name = f'{path}.*' if path else '*'
        is_any = any(f'{setting}.'.startswith(f'{any_name}.') for setting in known)
        step = any_name if is_any else f'{path}.{key}' if path else key
        yield from settings(entry, known, step)


def test_layout_settings_are_known_to_viewer(layout: dict[str, Any]) -> None:
    known = json.loads(SETTINGS.read_text(encoding='utf-8'))
    for name, config in layout['configById'].items():
        # Foxglove has another name for the title.
        of_panel = {*known[name.split('!')[0]], *known['every panel'], 'foxglovePanelTitle'}
        assert set(settings(config, of_panel)) <= of_panel, name
    wrong = {'paths': [{'value': '/a', 'xValuePath': '/b'}], 'timeWindowMode': 'automatic'}
    unknown = {'paths.*.xValuePath', 'timeWindowMode'}
    assert set(settings(wrong, set(known['Plot']))) - set(known['Plot']) == unknown


def test_layout_panel_titles_are_unique_in_both_viewers(layout: dict[str, Any]) -> None:
    titles = [
        (config['lichtblickPanelTitle'], config['foxglovePanelTitle'])
        for name, config in layout['configById'].items()
        if not name.startswith('Tab!')
    ]
    assert all(one == other != '' for one, other in titles)
    assert len(set(titles)) == len(titles)


def test_layout_plot_legends_are_left_of_lines(layout: dict[str, Any]) -> None:
    plots = [c for name, c in layout['configById'].items() if name.startswith('Plot!')]
    assert {plot['legendDisplay'] for plot in plots} == {'left'}


def test_layout_plane_plot_lines_share_one_topic(layout: dict[str, Any]) -> None:
    """A viewer pairs ordinates and the single abscissa of the plot by index."""
    for config in layout['configById'].values():
        if config.get('xAxisVal') in ('custom', 'currentCustom'):
            assert len({path.partition('.')[0] for path in message_paths(config)}) == 1


def test_layout_plotted_values_are_numbers_in_log(
    layout: dict[str, Any], messages: dict[str, Any]
) -> None:
    script_topics = scripts(layout)
    plotted = {path for config in layout['configById'].values() for path in message_paths(config)}
    assert len(plotted) > 20
    for path in plotted:
        topic, _, field_path = path.partition('.')
        if topic in script_topics:
            field = field_path.partition('.')[0].partition('[')[0]
            assert field in made_fields(layout, topic), path
            continue
        value = follow(messages[topic], f'.{field_path}')
        assert value != []
        for number in value if isinstance(value, list) else [value]:
            assert isinstance(number, float), path


def test_layout_topics_are_in_log_or_made_by_scripts(
    layout: dict[str, Any], messages: dict[str, Any]
) -> None:
    configs = layout['configById']
    script_topics = scripts(layout)
    # Only running nodes publish these topics.
    known = {*messages, *(topic.name for topic in SYSTEM_TOPICS), '/controller/state'}
    assert {topic for inputs in script_topics.values() for topic in inputs} <= set(messages)
    named = {path.partition('.')[0] for c in configs.values() for path in message_paths(c)}
    named |= set(configs['3D!scene']['topics'])
    for key in ('topicPath', 'topicToRender'):
        named |= {config[key].partition('.')[0] for config in configs.values() if key in config}
    assert set(script_topics) <= named <= known | set(script_topics)


def test_layout_telemetry_is_plotted_completely_without_stamp(
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


def test_layout_scene_shows_robot_and_paths(
    layout: dict[str, Any], messages: dict[str, Any]
) -> None:
    scene = layout['configById']['3D!scene']
    frames = {transform.header.frame_id for transform in messages['/tf'].transforms}
    assert scene['followTf'] == ODOM_FRAME
    assert ODOM_FRAME in frames
    for topic in ('/robot_description', '/path/desired', '/path/actual'):
        assert scene['topics'][topic]['visible']


def test_layout_is_installed() -> None:
    from masmc_ros.files import shared_file

    assert shared_file('config', LAYOUT.name) == Path(LAYOUT)
