# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Precedence of parameter files and settings: the same active values in nodes and offline."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
import signal
from typing import Any

from helpers.launch_file import launched, Started
from helpers.processes import PAPER, peer, processes
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import read_run
from masmc_ros.messages.parameter_record import read_record
from masmc_ros.scenario.scenario import load_scenario
import pytest
from std_msgs.msg import String

Values = Mapping[str, Mapping[str, str]]

REALTIME = PAPER.parent / 'realtime.yaml'
NODES = ('plant', 'controller', 'trajectory')
SHARED = {'duration': '1000.0', 'wait_for': '[trajectory, controller]'}
LIMITS = '[8.0, 8.0, 20.0, 10.0]'
OF_REALTIME: Values = {
    'plant': {'pacing': 'realtime', 'torque_limit': LIMITS},
    'controller': {
        'pacing': 'realtime',
        'torque_limit': LIMITS,
        'leakage': '0.02',
        'projection.lower': '0.2',
        'projection.upper': '5.0',
        'freeze_when_saturated': 'true',
    },
}
"""The values of config/realtime.yaml; the trajectory has the pacing of the other file."""

OF_USER: Values = {
    'plant': {'torque_rate_limit': LIMITS},
    'controller': {'k_s1': LIMITS, 'k_s2': '7.0', 'sigma': '[1.0, 2.0, 3.0, 4.0]'},
    'trajectory': {'pacing': 'realtime'},
}
"""Arrays in place of numbers of the other files, and a number in place of an array."""

REPLACED: Values = {
    'plant': {'torque_rate_limit': '[1.0, 1.0, 1.0, 1.0]'},
    'controller': {'k_s1': '3.0', 'k_s2': '[1.0, 2.0, 3.0, 4.0]', 'torque_limit': '0.5'},
}
"""Values that later ones replace everywhere."""

OF_SIMULATION: Values = {
    'plant': {**OF_REALTIME['plant'], **OF_USER['plant'], 'wait_for': SHARED['wait_for']},
    'controller': {**REPLACED['controller'], **OF_REALTIME['controller'], **OF_USER['controller']},
    'trajectory': OF_USER['trajectory'],
}
"""Settings of `masmc simulate config/paper.yaml` that are equivalent to the files."""


def block(key: str, values: Mapping[str, str]) -> str:
    lines = ''.join(f'    {name}: {text}\n' for name, text in values.items())
    return f'{key}:\n  ros__parameters:\n{lines}'


def blocks(values: Values) -> str:
    return ''.join(block(f'/**/{node}', of_node) for node, of_node in values.items())


def settings(values: Values) -> list[str]:
    return [
        argument
        for node, of_node in values.items()
        for name, text in of_node.items()
        for argument in ('-p', f'{node}:{name}:={text}')
    ]


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    """Return parameter files by the name of their content."""
    paper, realtime, shared = PAPER.read_text(), REALTIME.read_text(), block('/**', SHARED)
    texts = {
        'shared': shared,
        'replaced': blocks(REPLACED),
        'user': blocks(OF_USER),
        'one file': ''.join((paper, blocks(REPLACED), realtime, blocks(OF_USER), shared)),
        # A block for every node after those for one node.
        'wildcard last': ''.join(
            (
                paper,
                realtime,
                blocks({**OF_USER, 'plant': REPLACED['plant']}),
                block('/**', {**SHARED, 'torque_rate_limit': LIMITS}),
                block('/**/controller', {'torque_rate_limit': '0.0'}),
            )
        ),
        'paper in real time': paper + realtime + shared,
    }
    paths = {name: tmp_path / f'{name.replace(" ", "_")}.yaml' for name in texts}
    for name, path in paths.items():
        path.write_text(texts[name])
    return paths


def of_files(*paths: Path) -> list[str]:
    return [argument for path in paths for argument in ('--params-file', str(path))]


def arguments(way: str, files: Mapping[str, Path]) -> list[str]:
    """Return ROS arguments; all ways are equivalent."""
    shared, replaced, user = (files[name] for name in ('shared', 'replaced', 'user'))
    if way in files:
        return of_files(files[way])
    ways = {
        'files': of_files(PAPER, replaced, REALTIME, user, shared),
        'other order': of_files(shared, user, PAPER, replaced, REALTIME, user, shared),
        'settings': [*of_files(PAPER, replaced, shared), *settings(OF_REALTIME)],
        'settings first': [*settings(OF_REALTIME), *of_files(PAPER, replaced, shared)],
        'settings twice': [*of_files(PAPER, REALTIME, shared), *settings(REPLACED)],
    }
    if 'settings' in way:
        return [*ways[way], *settings({**OF_REALTIME, **OF_USER}), *settings(OF_REALTIME)]
    return ways[way]


def values_of_nodes(
    folder: Path, commands: list[Started], namespace: str = ''
) -> dict[str, dict[str, Any]]:
    """Start processes; return the active values that their nodes publish."""
    with processes(folder) as started, peer(started.domain) as tester:
        topics = {node: f'{namespace}/{node}/parameters' for node in NODES}
        records = {node: tester.collect(String, topic) for node, topic in topics.items()}
        for executable, command in commands:
            started.start(executable, *command)
        tester.until(lambda: all(records.values()), 'parameters of all nodes')
        started.signal(signal.SIGINT)
        assert set(started.wait().values()) == {0}, started.output()
    return {node: read_record(records[node][0].data).parameters for node in NODES}


def comparable(values: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the values of the nodes with arrays as lists."""
    return {
        node: {n: list(v) if isinstance(v, tuple) else v for n, v in values[node].items()}
        for node in NODES
    }


WAYS = (
    *('files', 'other order', 'one file', 'wildcard last'),
    *('settings', 'settings first', 'settings twice'),
)


@pytest.mark.parametrize('way', WAYS)
def test_parameters_any_way_composed_nodes_same_values(
    way: str, files: Mapping[str, Path], tmp_path: Path
) -> None:
    command = Started('composed', ['--ros-args', *arguments(way, files)])
    expected = comparable(load_scenario(str(files['one file'])).values)
    assert expected['controller']['torque_limit'] == [8.0, 8.0, 20.0, 10.0]
    assert expected['controller']['k_s2'] == [7.0] * 4
    assert comparable(values_of_nodes(tmp_path, [command])) == expected


@pytest.mark.parametrize('way', ['files', 'other order'])
def test_parameters_namespaced_processes_same_values(
    way: str, files: Mapping[str, Path], tmp_path: Path
) -> None:
    command = ['--ros-args', '-r', '__ns:=/left', *arguments(way, files)]
    active = values_of_nodes(tmp_path, [Started(node, command) for node in NODES], '/left')
    assert comparable(active) == comparable(load_scenario(str(files['one file'])).values)


@pytest.mark.parametrize('composed', [pytest.param('true', marks=pytest.mark.slow), 'false'])
@pytest.mark.parametrize('namespace', ['', 'left'])
def test_parameters_launch_file_same_values(
    composed: str, namespace: str, files: Mapping[str, Path], tmp_path: Path
) -> None:
    context = {'record': 'false', 'composed': composed, 'namespace': namespace}
    law, prefix = {'law': 'smc'}, f'/{namespace}' if namespace else ''
    law_of_user = ['controller.law=smc']
    expected = comparable(load_scenario(str(files['paper in real time']), law_of_user).values)
    # Without a file, and with a file whose values an argument replaces.
    by_default = launched(pacing='realtime', **law, **context)
    other = tmp_path / 'other.yaml'
    other.write_text(
        files['paper in real time'].read_text() + block('/**', {'pacing': 'lockstep'})
    )
    by_file = launched(pacing='realtime', params_file=str(other), **law, **context)
    for commands in (by_default, by_file):
        active = comparable(values_of_nodes(tmp_path, commands, prefix))
        for node in NODES:
            # The launch file does not set these values; they come from its files.
            expected[node]['duration'] = active[node]['duration']
        expected['trajectory']['pacing'] = active['trajectory']['pacing']
        assert active == expected


@pytest.mark.parametrize('way', ['one file', 'wildcard last', 'settings'])
def test_parameters_simulation_logs_same_values(
    way: str, files: Mapping[str, Path], tmp_path: Path
) -> None:
    log = tmp_path / 'run.mcap'
    command = ['simulate', str(files.get(way, PAPER)), '--output', str(log)]
    values: Values = OF_SIMULATION if way == 'settings' else {}
    for node, of_node in values.items():
        for name, text in of_node.items():
            command += ['--set', f'{node}.{name}={text}']
    assert main([*command, '--set', 'duration=0.01']) == 0
    expected = comparable(load_scenario(str(files['one file']), ['duration=0.01']).values)
    for of_node in expected.values():
        # A simulation has no late states.
        of_node.update({'pacing': 'lockstep'} if 'pacing' in of_node else {})
    assert comparable(read_run(log).parameters) == expected
