# SPDX-License-Identifier: Apache-2.0
"""The viewers' own libraries decode every message of a log to what it says.

They parse the definitions in the log, and read the messages by them: a definition that does
not fit its messages, an index or a chunk that is not right would show here.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
import struct
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rosbags')

from node_readers import read_log, SOURCES
from viewed_run import computed_run, decoded, ROOT

from masmc_ros.log.reader import read_run
from masmc_ros.loop.simulation import robot_of
from masmc_ros.nodes.scenario import load_scenario
from masmc_ros.robot.forward_kinematics import task_positions


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
    assert told['topics']['/effort_commands']['last']['data'] == run.torque[-1].tolist()
    error = told['topics']['/controller/tracking_error']['last']
    assert run.tracking_error is not None
    assert error['data'][error['layout']['data_offset'] :] == run.tracking_error[-1].tolist()


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


def test_the_layouts_scripts_find_where_f_is_and_where_it_is_to_be(tmp_path: Path) -> None:
    log = computed_run(tmp_path)
    made = read_log(log, ROOT / 'config' / 'foxglove.json')['scripts']
    run = read_run(log)
    robot = robot_of(load_scenario(str(ROOT / 'config' / 'paper.yaml'))['plant'])
    expected = task_positions(robot.geometry, run.position)[:, 2:]
    actual = np.array([[each['x'], each['y']] for each in made['/masmc/position_f']])
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-12)
    points = [point for each in made['/masmc/reference_f'] for point in each['points']]
    desired = np.array([[point['x'], point['y']] for point in points])
    assert run.reference is not None
    assert len(desired) > len(run.times) / 20
    matched = {tuple(row) for row in run.reference[:, 2:4].tolist()}
    assert {tuple(row) for row in desired.tolist()} <= matched


def test_the_layouts_script_tells_the_gains_in_force(tmp_path: Path) -> None:
    made = read_log(computed_run(tmp_path), ROOT / 'config' / 'foxglove.json')['scripts']
    (gains,) = made['/masmc/gains']
    expected = load_scenario(str(ROOT / 'config' / 'paper.yaml'))['controller']
    assert gains == {
        name: list(expected[name]) for name in ('k_s1', 'k_s2', 'sigma', 'gamma')
    }


def test_nothing_is_installed_into_the_sources() -> None:
    assert {path.name for path in SOURCES.iterdir()} == {'package.json', 'read_log.mjs'}
