# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The viewers' own libraries decode every message of a log to what it says.

They parse the definitions in the log, and read the messages by them: a definition that does
not fit its messages, an index or a chunk that is not right would show here.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
import struct
from typing import Any

from masmc_ros.log.read.reader import read_run
from masmc_ros.params.scenario import load_scenario
from masmc_ros.robot.robot import robot_of
from node_readers import read_log, run_read_log, SOURCES
import numpy as np
import pytest
from robots import task_positions
from viewed_run import computed_run, decoded, ROOT

LAYOUT = ROOT / 'config' / 'foxglove.json'


def digests(log: Path) -> dict[str, str]:
    """Return a digest of everything in the messages of every topic."""
    hashes: dict[str, Any] = {}
    for topic, message in decoded(log):
        _add(hashes.setdefault(topic, hashlib.sha256()), message)
    return {topic: found.hexdigest() for topic, found in hashes.items()}


def _add(digest: Any, value: Any) -> None:
    if isinstance(value, bytes):
        value = list(value)  # of the type `byte`, one or many
    if isinstance(value, str):
        digest.update(value.encode())
    elif isinstance(value, bool | int | float):
        digest.update(struct.pack('<d', value))
    else:
        entries = value if isinstance(value, list | tuple) else _fields(value)
        for each in entries:
            _add(digest, each)


def _fields(message: Any) -> list[Any]:
    return [getattr(message, name) for name in message.__slots__]


def check(log: Path, told: Any) -> None:
    """Hold what Node.js tells of a log against what Python reads in it."""
    run = read_run(log)
    assert told['profile'] == 'ros2'
    assert {name: topic['count'] for name, topic in told['topics'].items()} == run.topics
    assert told['statistics'] == sum(run.topics.values()) > 1000
    read = {name: topic['digest'] for name, topic in told['topics'].items() if topic['count']}
    assert read == digests(log)
    state = told['topics']['/joint_states']['last']
    assert state['position'] == run.position[-1].tolist()
    assert state['velocity'] == run.velocity[-1].tolist()
    assert state['effort'][3:] == run.applied_effort[-1].tolist()
    assert told['topics']['/effort_commands']['last']['data'] == run.torque.values[-1].tolist()
    error = told['topics']['/controller/tracking_error']['last']
    last = run.telemetry['error'].values[-1].tolist()
    assert error['data'][error['layout']['data_offset']:] == last


def test_every_message_of_a_computed_run(tmp_path: Path) -> None:
    log = computed_run(tmp_path)
    check(log, read_log(log))


def test_every_message_of_a_recorded_run(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    from processes import processes, ros_arguments, shortened

    log = tmp_path / 'recorded.mcap'
    file = shortened(tmp_path, 0.5)
    with processes(tmp_path) as started:
        wait_for = '[controller,trajectory,recorder]'
        started.start_all(*ros_arguments(file, plant__wait_for=wait_for, recorder__output=log))
        assert set(started.wait().values()) == {0}, started.output()
    told = read_log(log)
    check(log, told)
    assert told['topics']['/rosout']['count'] > 0


@pytest.fixture(scope='module')
def run_and_made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """Return a run of a second, and what the layout's scripts make of it."""
    log = computed_run(tmp_path_factory.mktemp('scripts'))
    return log, read_log(log, LAYOUT)['scripts']


def test_the_layouts_script_draws_the_paths_of_e_and_f(run_and_made: tuple[Path, Any]) -> None:
    log, made = run_and_made
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
            assert all(len(each[name]) == len(each['x']) for each in messages)
            drawn = np.array(
                [
                    (x, y)
                    for each in messages
                    for x, y in zip(each['x'], each[name], strict=True)
                    if y is not None  # NaN in JSON
                ]
            )
            # All of it are points of the path, in order, and none of the path is far from them.
            distance = np.linalg.norm(drawn[:, None] - whole[None], axis=2)
            assert distance.min(axis=1).max() < 1e-9
            assert (np.diff(distance.argmin(axis=1)) >= 0).all()
            assert distance.min(axis=0).max() < 0.006
            # Where the line goes on after a gap, it begins where it ended.
            for each in messages:
                rows = [i for i, y in enumerate(each[name]) if y is not None]
                assert rows == list(range(rows[0], rows[0] + len(rows))) if rows else True
    assert len(messages) > len(run.times)


def test_the_layouts_script_tells_the_values_in_force(run_and_made: tuple[Path, Any]) -> None:
    told, *again = run_and_made[1]['/masmc/controller']
    # With the clock it is told again, so that lines in a plot go on at their height.
    assert len(again) > 1
    assert all(each == told for each in again)
    expected = load_scenario(str(ROOT / 'config' / 'paper.yaml'))['controller']
    for name in ('k_s1', 'k_s2', 'sigma', 'gamma'):
        assert told[name] == list(expected[name])
    rows = {row['parameter']: row['value'] for row in told['parameters']}
    assert rows['law'] == expected['law']
    assert [float(each) for each in rows['k_s1'].split(', ')] == list(expected['k_s1'])
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
def test_scripts_that_the_viewer_refuses_are_found(
    run_and_made: tuple[Path, Any], tmp_path: Path, script: str, old: str, new: str, fault: str
) -> None:
    layout = json.loads(LAYOUT.read_text(encoding='utf-8'))
    source = layout['userNodes'][script]['sourceCode']
    assert old in source
    layout['userNodes'][script]['sourceCode'] = source.replace(old, new, 1)
    wrong = tmp_path / 'layout.json'
    wrong.write_text(json.dumps(layout), encoding='utf-8')
    result = run_read_log(run_and_made[0], wrong)
    assert result.returncode != 0
    assert fault in result.stderr


def test_nothing_is_installed_into_the_sources() -> None:
    assert {path.name for path in SOURCES.iterdir()} == {
        'package.json',
        'read_log.mjs',
        'user_scripts.mjs',
    }
