# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc param` with nodes: output as of `ros2 param`, and exit status."""

from __future__ import annotations

from collections.abc import Iterator
import json
import os
from pathlib import Path
import subprocess
import sys
import time

from helpers.child_environment import child_environment, domain_variables
from helpers.command_process import run_command
from helpers.processes import PATIENCE, peer, Processes, processes
from masmc_ros.params.file import read
from masmc_ros.scenario.node_parameters import declared
import pytest
from rcl_interfaces.msg import Parameter, ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from std_msgs.msg import String
from test_json_output import check
import yaml


@pytest.fixture(scope='module')
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    """Yield the processes of two controllers, one of them in a namespace."""
    with processes(tmp_path_factory.mktemp('nodes')) as started:
        started.start('controller', '--ros-args', '-p', 'k_s1:=120.0')
        started.start('controller', '--ros-args', '-r', '__ns:=/left')
        with peer(started.domain) as observer:
            for node in ('/controller', '/left/controller'):
                observer.call(ListParameters, f'{node}/list_parameters', ListParameters.Request())
        yield started


def param(domain: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**child_environment(), **domain_variables(domain)}
    return run_command('param', *arguments, folder=Path.cwd(), environment=environment)


def output_of(domain: int, *arguments: str) -> str:
    """Return the standard output of a command that must succeed without errors."""
    result = param(domain, *arguments, '--timeout', '30')
    assert (result.returncode, result.stderr) == (0, '')
    return result.stdout.rstrip('\n')


def test_param_set_and_get_value(running: Processes) -> None:
    domain = running.domain
    assert output_of(domain, 'get', '/controller', 'k_s1') == 'Double value is: 120.0'
    assert output_of(domain, 'set', '/controller', 'k_s1', '150') == 'Set parameter successful'
    assert output_of(domain, 'get', 'controller', 'k_s1', '--hide-type') == '150.0'
    array = '[150.0, 150.0, 80.0, 80.0]'
    assert output_of(domain, 'set', '/controller', 'k_s1', array) == 'Set parameter successful'
    assert output_of(domain, 'get', '/controller', 'k_s1') == f'Double values are: {array}'
    # The response has a note if the law must be compiled first.
    assert output_of(domain, 'set', '/controller', 'law', 'smc').startswith(
        'Set parameter successful'
    )
    assert output_of(domain, 'get', '/controller', 'law') == 'String value is: smc'
    left = output_of(domain, 'get', '/left/controller', 'k_s1')
    assert left == 'Double values are: [100.0, 100.0, 100.0, 100.0]'
    assert output_of(domain, 'get', '/controller', 'telemetry_decimation') == 'Integer value is: 1'
    assert output_of(domain, 'get', '/controller', 'use_sim_time') == 'Boolean value is: False'


def test_param_json_documented_keys(running: Processes) -> None:
    domain = running.domain
    verbs = (('list',), ('dump', '/controller'), ('set', '/controller', 'k_s2', '[9, 9, 9, 9]'))
    printed = [json.loads(output_of(domain, *verb, '--json')) for verb in verbs]
    check('param', *printed, {'value': 1})
    assert {'k_s2', 'law'} <= set(printed[0]['nodes'][0]['names'])
    got = json.loads(output_of(domain, 'get', '/controller', 'k_s2', '--json'))
    assert got == {'node': '/controller', 'parameters': {'k_s2': [9.0] * 4}}
    rejected = param(domain, 'set', '/controller', 'k_s2', '-1', '--json', '--timeout', '30')
    assert (rejected.returncode, rejected.stderr) == (1, '')
    result = json.loads(rejected.stdout)
    assert (result['is_set'], result['value']) == (False, -1)
    assert 'k_s2 = -1' in result['reason']


@pytest.mark.parametrize(
    ('value', 'words'),
    [('-1', ('k_s2 = -1', '>= 0')), ('[1.0, 2.0]', ('4 numbers',)), ('[]', ('k_s2',))],
)
def test_param_set_invalid_value_reports_reason(
    running: Processes, value: str, words: tuple[str, ...]
) -> None:
    previous = output_of(running.domain, 'get', '/controller', 'k_s2')
    result = param(running.domain, 'set', '/controller', 'k_s2', '--timeout', '30', '--', value)
    assert result.returncode == 1
    assert result.stdout == ''
    assert result.stderr.startswith('Setting parameter failed: ')
    assert result.stderr.count('\n') == 1
    for word in words:
        assert word in result.stderr
    assert output_of(running.domain, 'get', '/controller', 'k_s2') == previous


def test_param_set_unknown_name_suggests_similar(running: Processes) -> None:
    result = param(running.domain, 'set', '/controller', 'ks_1', '150', '--timeout', '30')
    assert "unknown parameter 'ks_1'; did you mean k_s1" in result.stderr
    assert result.returncode == 1


def test_param_set_negative_number_is_value(running: Processes) -> None:
    result = param(running.domain, 'set', '/controller', 'k_s2', '-1', '--timeout', '30')
    assert result.stderr.startswith('Setting parameter failed: ')


def test_param_list_has_all_nodes(running: Processes) -> None:
    listed: dict[str, list[str]] = {}
    limit = time.monotonic() + PATIENCE
    # On a busy machine the last node may be discovered after the list is printed.
    while set(listed) != {'/controller', '/left/controller'}:
        assert time.monotonic() < limit, listed
        listed = yaml.safe_load(output_of(running.domain, 'list').replace('\n  ', '\n  - '))
    one = output_of(running.domain, 'list', '/left/controller').split()
    assert one == sorted(one) == listed['/left/controller']
    assert {parameter.name for parameter in declared('controller')} <= set(one)


def test_param_dump_is_parameter_file(running: Processes, tmp_path: Path) -> None:
    assert output_of(running.domain, 'set', '/controller', 'k_s2', '[1.5, 2.0, 3.0, 4.0]')
    file = tmp_path / 'dump.yaml'
    file.write_text(output_of(running.domain, 'dump', '/controller'), encoding='utf-8')
    assert read(file).for_node('controller')['k_s2'] == [1.5, 2.0, 3.0, 4.0]
    with processes(tmp_path) as elsewhere:
        elsewhere.start('controller', '--ros-args', '--params-file', str(file))
        again = output_of(elsewhere.domain, 'get', '/controller', 'k_s2')
        assert again == 'Double values are: [1.5, 2.0, 3.0, 4.0]'
        assert output_of(elsewhere.domain, 'dump', '/controller') == file.read_text(
            encoding='utf-8'
        )


THIRD_PARTY = """
import rclpy
from rclpy.parameter import Parameter
rclpy.init()
node = rclpy.create_node('third_party')
node.declare_parameter('unset', Parameter.Type.INTEGER)
for name, value in (('gain', 1), ('gain.low', 0.5), ('raw', [b'a', b'b'])):
    node.declare_parameter(name, value)
rclpy.spin(node)
"""
"""Node with a parameter without a value, one below another, and bytes."""


@pytest.mark.slow
def test_param_node_of_other_package_any_type_works(running: Processes, tmp_path: Path) -> None:
    domain = running.domain
    with subprocess.Popen(
        [sys.executable, '-c', THIRD_PARTY],
        env={**child_environment(), **domain_variables(domain)}, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        try:
            assert output_of(domain, 'get', '/third_party', 'unset') == 'Parameter not set.'
            raw = output_of(domain, 'get', '/third_party', 'raw')
            assert raw == "Byte values are: [b'a', b'b']"
            number = ('set', '/third_party', 'gain.low', '-1e-3')
            assert output_of(domain, *number) == 'Set parameter successful'
            dump = param(domain, 'dump', '/third_party', '--timeout', '30')
        finally:
            process.kill()
    assert dump.returncode == 0
    lines = dump.stderr.splitlines()
    assert [line.split()[1] for line in lines] == ['raw', 'unset']
    file = tmp_path / 'dump.yaml'
    file.write_text(dump.stdout, encoding='utf-8')
    values = read(file).for_node('third_party')
    assert (values['gain'], values['gain.low']) == (1, -1e-3)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('get', '/missing', 'k_s1', '--timeout', '1'), ('/missing',)),
        (('set', '/missing', 'k_s1', '1', '--timeout', '1'), ('/missing',)),
        (('dump', '/missing', '--timeout', '1'), ('/missing',)),
        (('list', '/missing', '--timeout', '1'), ('/missing',)),
        (('get', '/controller', 'k_s3', '--timeout', '30'), ('k_s3', 'k_s1')),
        (('get', '/not a name', 'k_s1'), ('not a name',)),
        (('get', f'/{"n" * 230}', 'k_s1'), ('n' * 230,)),
        (('set', '/controller', 'k_s1', '[1.0'), ('[1.0',)),
        (('set', '/controller', 'k_s1', '{a: 1}'), ('{a: 1}',)),
        (('get', '/controller'), ('name',)),
        (('list', '--timeout', 'soon'), ('timeout', 'soon')),
        ((), ('list',)),
    ],
    ids=lambda value: ' '.join(value)[:40],
)
def test_param_invalid_command_one_error_line(
    running: Processes, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    result = param(running.domain, *arguments)
    assert result.returncode == 2
    assert result.stdout == ''
    assert result.stderr.startswith('masmc param')
    assert result.stderr.count('\n') == 1
    for word in words:
        assert word in result.stderr


def test_param_missing_node_error_lists_nodes(running: Processes) -> None:
    listed = 'none'
    timeout = 1
    # On a busy machine the discovery of nodes may take long.
    while listed == 'none':
        assert timeout < PATIENCE
        result = param(running.domain, 'get', '/missing', 'k_s1', '--timeout', str(timeout))
        assert result.returncode == 2
        assert result.stderr.count('\n') == 1
        listed = result.stderr.rpartition('nodes with parameters: ')[2].strip()
        timeout *= 2
    assert set(listed.split(', ')) <= {'/controller', '/left/controller'}


def test_param_without_rclpy_names_remedy(tmp_path: Path) -> None:
    (tmp_path / 'rclpy.py').write_text("raise ImportError('not here')", encoding='utf-8')
    environment = child_environment()
    environment['PYTHONPATH'] = os.pathsep.join([str(tmp_path), environment['PYTHONPATH']])
    result = subprocess.run(
        [sys.executable, '-m', 'masmc_ros.cli.main', 'param', 'list'],
        env=environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert result.returncode == 2
    assert result.stderr.count('\n') == 1
    assert 'pip install' in result.stderr


def test_param_load_of_dump_changes_nothing(running: Processes) -> None:
    """`ros2 param load` sets all parameters to their values, including read-only ones."""
    node = '/controller'
    with peer(running.domain, 'loader') as loader:
        request = ListParameters.Request()
        names = loader.call(ListParameters, f'{node}/list_parameters', request).result.names
        getting = GetParameters.Request(names=names)
        values = loader.call(GetParameters, f'{node}/get_parameters', getting).values
        records = loader.collect(String, f'{node}/parameters', past=False)
        events = loader.collect(ParameterEvent, '/parameter_events', past=False)
        parameters = [Parameter(name=n, value=v) for n, v in zip(names, values, strict=True)]
        loaded = SetParameters.Request(parameters=parameters)
        answer = loader.call(SetParameters, f'{node}/set_parameters', loaded)
        assert {result.reason for result in answer.results if not result.successful} == set()
        # Only a new value is set and published; a new value of a read-only one is rejected.
        changed = [p for p in parameters if p.name == 'boundary_layer']
        changed[0].value.double_value += 0.125
        request = SetParameters.Request(parameters=parameters)
        answer = loader.call(SetParameters, f'{node}/set_parameters', request)
        assert all(result.successful for result in answer.results)
        loader.until(lambda: [e for e in events if e.node == node], 'the event')
        names = [p.name for e in events if e.node == node for p in e.changed_parameters]
        assert names == ['boundary_layer']
        assert records == []  # published with the first tick that uses the value
        fixed = next(p for p in parameters if p.name == 'control_period')
        fixed.value.double_value *= 2.0
        request = SetParameters.Request(parameters=[fixed])
        (result,) = loader.call(SetParameters, f'{node}/set_parameters', request).results
        assert not result.successful
