# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc param` on real nodes: what `ros2 param` says, and exit statuses that tell."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import subprocess
import sys
import time

from forked import completed
from masmc_ros.params.file import read
from masmc_ros.params.node_parameters import declared
from processes import PATIENCE, peer, Processes, processes
import pytest
from rcl_interfaces.msg import Parameter, ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from std_msgs.msg import String
from surroundings import domain_variables, surroundings
import yaml


@pytest.fixture(scope='module')
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    """Yield a domain in which a controller runs, and one in a namespace."""
    with processes(tmp_path_factory.mktemp('nodes')) as started:
        started.start('controller', '--ros-args', '-p', 'k_s1:=120.0')
        started.start('controller', '--ros-args', '-r', '__ns:=/left')
        with peer(started.domain) as observer:
            for node in ('/controller', '/left/controller'):
                observer.call(ListParameters, f'{node}/list_parameters', ListParameters.Request())
        yield started


def param(domain: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**surroundings(), **domain_variables(domain)}
    return completed('param', *arguments, folder=Path.cwd(), environment=environment)


def told(domain: int, *arguments: str) -> str:
    """Return what the command prints; it must end well and print nothing but that."""
    result = param(domain, *arguments, '--timeout', '30')
    assert (result.returncode, result.stderr) == (0, '')
    return result.stdout.rstrip('\n')


def test_a_gain_is_set_and_read_back(running: Processes) -> None:
    domain = running.domain
    assert told(domain, 'get', '/controller', 'k_s1') == 'Double value is: 120.0'
    assert told(domain, 'set', '/controller', 'k_s1', '150') == 'Set parameter successful'
    assert told(domain, 'get', 'controller', 'k_s1', '--hide-type') == '150.0'
    array = '[150.0, 150.0, 80.0, 80.0]'
    assert told(domain, 'set', '/controller', 'k_s1', array) == 'Set parameter successful'
    assert told(domain, 'get', '/controller', 'k_s1') == f'Double values are: {array}'
    # On a machine that has not loaded the law yet, the response says so.
    assert told(domain, 'set', '/controller', 'law', 'smc').startswith('Set parameter successful')
    assert told(domain, 'get', '/controller', 'law') == 'String value is: smc'
    left = told(domain, 'get', '/left/controller', 'k_s1')
    assert left == 'Double values are: [100.0, 100.0, 100.0, 100.0]'
    assert told(domain, 'get', '/controller', 'telemetry_decimation') == 'Integer value is: 1'
    assert told(domain, 'get', '/controller', 'use_sim_time') == 'Boolean value is: False'


@pytest.mark.parametrize(
    ('value', 'words'),
    [('-1', ('k_s2 = -1', '>= 0')), ('[1.0, 2.0]', ('4 numbers',)), ('[]', ('k_s2',))],
)
def test_a_refusal_tells_the_reason_and_changes_nothing(
    running: Processes, value: str, words: tuple[str, ...]
) -> None:
    before = told(running.domain, 'get', '/controller', 'k_s2')
    result = param(running.domain, 'set', '/controller', 'k_s2', '--timeout', '30', '--', value)
    assert result.returncode == 1
    assert result.stdout == ''
    assert result.stderr.startswith('Setting parameter failed: ')
    assert result.stderr.count('\n') == 1
    for word in words:
        assert word in result.stderr
    assert told(running.domain, 'get', '/controller', 'k_s2') == before


def test_a_name_that_is_none_is_answered_with_what_was_meant(running: Processes) -> None:
    result = param(running.domain, 'set', '/controller', 'ks_1', '150', '--timeout', '30')
    assert "unknown parameter 'ks_1'; did you mean k_s1" in result.stderr
    assert result.returncode == 1


def test_a_negative_number_is_a_value(running: Processes) -> None:
    result = param(running.domain, 'set', '/controller', 'k_s2', '-1', '--timeout', '30')
    assert result.stderr.startswith('Setting parameter failed: ')


def test_all_nodes_are_listed(running: Processes) -> None:
    listed: dict[str, list[str]] = {}
    limit = time.monotonic() + PATIENCE
    # On a busy machine the last node may turn up after the others were taken for all.
    while set(listed) != {'/controller', '/left/controller'}:
        assert time.monotonic() < limit, listed
        listed = yaml.safe_load(told(running.domain, 'list').replace('\n  ', '\n  - '))
    one = told(running.domain, 'list', '/left/controller').split()
    assert one == sorted(one) == listed['/left/controller']
    assert {parameter.name for parameter in declared('controller')} <= set(one)


def test_a_dump_is_a_parameter_file(running: Processes, tmp_path: Path) -> None:
    assert told(running.domain, 'set', '/controller', 'k_s2', '[1.5, 2.0, 3.0, 4.0]')
    file = tmp_path / 'dump.yaml'
    file.write_text(told(running.domain, 'dump', '/controller'), encoding='utf-8')
    assert read(file).for_node('controller')['k_s2'] == [1.5, 2.0, 3.0, 4.0]
    with processes(tmp_path) as elsewhere:
        elsewhere.start('controller', '--ros-args', '--params-file', str(file))
        again = told(elsewhere.domain, 'get', '/controller', 'k_s2')
        assert again == 'Double values are: [1.5, 2.0, 3.0, 4.0]'
        assert told(elsewhere.domain, 'dump', '/controller') == file.read_text(encoding='utf-8')


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('get', '/nobody', 'k_s1', '--timeout', '1'), ('/nobody',)),
        (('set', '/nobody', 'k_s1', '1', '--timeout', '1'), ('/nobody',)),
        (('dump', '/nobody', '--timeout', '1'), ('/nobody',)),
        (('list', '/nobody', '--timeout', '1'), ('/nobody',)),
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
def test_what_cannot_be_done_is_told_in_one_line(
    running: Processes, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    result = param(running.domain, *arguments)
    assert result.returncode == 2
    assert result.stdout == ''
    assert result.stderr.startswith('masmc param')
    assert result.stderr.count('\n') == 1
    for word in words:
        assert word in result.stderr


def test_whoever_asks_for_a_node_that_is_not_there_is_told_who_is(running: Processes) -> None:
    told_of = 'none'
    timeout = 1
    # On a busy machine it takes its time to find anybody.
    while told_of == 'none':
        assert timeout < PATIENCE
        result = param(running.domain, 'get', '/nobody', 'k_s1', '--timeout', str(timeout))
        assert result.returncode == 2
        assert result.stderr.count('\n') == 1
        told_of = result.stderr.rpartition('nodes with parameters: ')[2].strip()
        timeout *= 2
    assert set(told_of.split(', ')) <= {'/controller', '/left/controller'}


def test_without_rclpy_it_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / 'rclpy.py').write_text("raise ImportError('not here')", encoding='utf-8')
    environment = surroundings()
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


def test_what_a_node_has_dumped_is_loaded_without_a_word(running: Processes) -> None:
    """As `ros2 param load` does: every parameter is set to what it is, read-only ones too."""
    node = '/controller'
    with peer(running.domain, 'loader') as loader:
        request = ListParameters.Request()
        names = loader.call(ListParameters, f'{node}/list_parameters', request).result.names
        asked = GetParameters.Request(names=names)
        values = loader.call(GetParameters, f'{node}/get_parameters', asked).values
        told = loader.collect(String, f'{node}/parameters', past=False)
        events = loader.collect(ParameterEvent, '/parameter_events', past=False)
        parameters = [Parameter(name=n, value=v) for n, v in zip(names, values, strict=True)]
        loaded = SetParameters.Request(parameters=parameters)
        answer = loader.call(SetParameters, f'{node}/set_parameters', loaded)
        assert {result.reason for result in answer.results if not result.successful} == set()
        # One that is new is set, told and nothing else is; a read-only one is refused.
        changed = [p for p in parameters if p.name == 'boundary_layer']
        changed[0].value.double_value += 0.125
        request = SetParameters.Request(parameters=parameters)
        answer = loader.call(SetParameters, f'{node}/set_parameters', request)
        assert all(result.successful for result in answer.results)
        loader.until(lambda: [e for e in events if e.node == node], 'the event')
        names = [p.name for e in events if e.node == node for p in e.changed_parameters]
        assert names == ['boundary_layer']
        assert told == []  # with the first tick that is computed with it
        fixed = next(p for p in parameters if p.name == 'control_period')
        fixed.value.double_value *= 2.0
        request = SetParameters.Request(parameters=[fixed])
        (refused,) = loader.call(SetParameters, f'{node}/set_parameters', request).results
        assert not refused.successful
