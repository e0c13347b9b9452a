# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Messages of a log decoded by the libraries of the viewers.

The libraries parse the definitions in the log and read the messages with them. They detect
definitions that do not match, and wrong indexes or chunks.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
import struct
from typing import Any

from helpers.javascript_readers import read_log, run_read_log, SOURCES
from helpers.robots import task_positions
from helpers.viewed_run import computed_run, decoded, ROOT
from masmc_ros.log.read.reader import read_run
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

LAYOUT = ROOT / 'config' / 'foxglove.json'


def digests(log: Path) -> dict[str, str]:
    """Return a digest of the messages of every topic."""
    hashes: dict[str, Any] = {}
    for topic, message in decoded(log):
        _add(hashes.setdefault(topic, hashlib.sha256()), message)
    return {topic: digest.hexdigest() for topic, digest in hashes.items()}


def _add(digest: Any, value: Any) -> None:
    if isinstance(value, bytes):
        value = list(value)  # of the type `byte`, one or many
    if isinstance(value, str):
        digest.update(value.encode())
    elif isinstance(value, bool | int | float):
        digest.update(struct.pack('<d', value))
    else:
        entries = value if isinstance(value, list | tuple) else _fields(value)
        for entry in entries:
            _add(digest, entry)


def _fields(message: Any) -> list[Any]:
    return [getattr(message, name) for name in message.__slots__]


def check(log: Path, contents: Any) -> None:
    """Compare the contents of a log in Node.js with those in Python."""
    run = read_run(log)
    assert contents['profile'] == 'ros2'
    assert {name: topic['count'] for name, topic in contents['topics'].items()} == run.topics
    assert contents['statistics'] == sum(run.topics.values()) > 1000
    read = {name: topic['digest'] for name, topic in contents['topics'].items() if topic['count']}
    assert read == digests(log)
    state = contents['topics']['/joint_states']['last']
    assert state['position'] == run.position[-1].tolist()
    assert state['velocity'] == run.velocity[-1].tolist()
    assert state['effort'][3:] == run.applied_effort[-1].tolist()
    assert contents['topics']['/effort_commands']['last']['data'] == run.torque.values[-1].tolist()
    error = contents['topics']['/controller/tracking_error']['last']
    last = run.telemetry['error'].values[-1].tolist()
    assert error['data'][error['layout']['data_offset']:] == last


def test_viewer_library_computed_run_equals_python(tmp_path: Path) -> None:
    log = computed_run(tmp_path)
    check(log, read_log(log))


def test_viewer_library_recorded_run_equals_python(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    from helpers.processes import processes, ros_arguments, shortened

    log = tmp_path / 'recorded.mcap'
    file = shortened(tmp_path, 0.5)
    with processes(tmp_path) as started:
        wait_for = '[controller,trajectory,recorder]'
        started.start_all(*ros_arguments(file, plant__wait_for=wait_for, recorder__output=log))
        assert set(started.wait().values()) == {0}, started.output()
    contents = read_log(log)
    check(log, contents)
    assert contents['topics']['/rosout']['count'] > 0


@pytest.fixture(scope='module')
def run_and_script_output(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """Return a run of one second, and the output of the layout's scripts."""
    log = computed_run(tmp_path_factory.mktemp('scripts'))
    return log, read_log(log, LAYOUT)['scripts']


def test_layout_script_paths_equal_paths_of_run(run_and_script_output: tuple[Path, Any]) -> None:
    log, made = run_and_script_output
    run = read_run(log)
    robot = robot_of(load_scenario(str(ROOT / 'config' / 'paper.yaml'))['plant'])
    assert run.reference is not None
    wanted = {
        'actual': task_positions(robot.geometry, run.position),
        'desired': run.reference[:, :4],
    }
    messages = made['/masmc/paths']
    for point, first in (('e', 0), ('f', 2)):
        for kind, values in wanted.items():
            whole = values[:, first:first + 2]
            name = f'{point}_{kind}'
            assert all(len(message[name]) == len(message['x']) for message in messages)
            drawn = np.array(
                [
                    (x, y)
                    for message in messages
                    for x, y in zip(message['x'], message[name], strict=True)
                    if y is not None  # NaN in JSON
                ]
            )
            # All drawn points belong to the path, in order, and the whole path is close to them.
            distance = np.linalg.norm(drawn[:, None] - whole[None], axis=2)
            assert distance.min(axis=1).max() < 1e-9
            assert (np.diff(distance.argmin(axis=1)) >= 0).all()
            assert distance.min(axis=0).max() < 0.006
            # After a gap in another line, this line continues at its last point.
            for message in messages:
                rows = [i for i, y in enumerate(message[name]) if y is not None]
                assert rows == list(range(rows[0], rows[0] + len(rows))) if rows else True
    assert len(messages) > len(run.times)


def test_layout_script_controller_values_equal_scenario(
    run_and_script_output: tuple[Path, Any]
) -> None:
    values, *again = run_and_script_output[1]['/masmc/controller']
    # The script repeats the values with the clock; lines in a plot continue at their height.
    assert len(again) > 1
    assert all(repeated == values for repeated in again)
    expected = load_scenario(str(ROOT / 'config' / 'paper.yaml'))['controller']
    for name in ('k_s1', 'k_s2', 'sigma', 'gamma'):
        assert values[name] == list(expected[name])
    rows = {row['parameter']: row['value'] for row in values['parameters']}
    assert rows['law'] == expected['law']
    assert [float(gain) for gain in rows['k_s1'].split(', ')] == list(expected['k_s1'])
    assert not any(name.startswith('robot.') for name in rows)


@pytest.mark.slow
@pytest.mark.parametrize('script', ['paths', 'controller'])
@pytest.mark.parametrize(
    ('old', 'new', 'fault'),
    [
        ('"./types"', '"./types.ts"', "can only end with a '.ts' extension"),
        ('event.message', 'event.massage', "Property 'massage' does not exist"),
        ('number[];', 'number[] | undefined;', 'cannot be returned'),
        ('export const inputs = ["/', 'export const inputs = ["/elsewhere", "/', '/elsewhere'),
    ],
)
def test_layout_script_invalid_is_rejected(
    run_and_script_output: tuple[Path, Any],
    tmp_path: Path,
    script: str,
    old: str,
    new: str,
    fault: str,
) -> None:
    layout = json.loads(LAYOUT.read_text(encoding='utf-8'))
    source = layout['userNodes'][script]['sourceCode']
    assert old in source
    layout['userNodes'][script]['sourceCode'] = source.replace(old, new, 1)
    wrong = tmp_path / 'layout.json'
    wrong.write_text(json.dumps(layout), encoding='utf-8')
    result = run_read_log(run_and_script_output[0], wrong)
    assert result.returncode != 0
    assert fault in result.stderr


def test_viewer_sources_contain_no_installed_packages() -> None:
    assert {path.name for path in SOURCES.iterdir()} == {
        'package.json',
        'read_log.mjs',
        'user_scripts.mjs',
    }
