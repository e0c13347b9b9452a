# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes with the parameter files of config/ in a namespace: the values of the file are active."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from helpers.launch_file import launched
from helpers.processes import peer, processes
from masmc_ros.files import scenarios
from masmc_ros.messages.parameter_record import read_record
from masmc_ros.scenario.scenario import load_scenario
import pytest
from rclpy.node import Node
from std_msgs.msg import String

NODES = ('plant', 'trajectory', 'controller')
INTERPRETED = {'NUMBA_DISABLE_JIT': '1'}
"""The values are the same, without a minute of compilation for each robot."""

TREES = ('tiago', 'tiago_pro', 'franka_on_omni', 'ur5')
"""Parameter files whose URDF is part of the extra `robots`."""

AWAITED, WITNESS = ('trajectory', 'controller'), 'witness'
"""Nodes for which the plant waits by the launch file, and the one that the test adds."""

SHORT = '/**:\n  ros__parameters:\n    duration: 0.02\n'


@pytest.mark.parametrize(
    'name',
    [
        pytest.param(name, marks=pytest.mark.slow) if name in TREES else name
        for name in sorted(scenarios().keys() - {'realtime'})
    ],
)
def test_shipped_file_nodes_in_namespace_use_its_values(
    name: str, tmp_path: Path
) -> None:
    if name in TREES and find_spec('pinocchio') is None:
        pytest.skip('its URDF is part of the extra `robots`')
    file = tmp_path / f'{name}.yaml'
    file.write_text(scenarios()[name].read_text(encoding='utf-8') + SHORT, encoding='utf-8')
    expected = load_scenario(str(file))
    with processes(tmp_path) as started, peer(started.domain) as tester:
        records = {n: tester.collect(String, f'/left/{n}/parameters') for n in NODES}
        for executable, arguments in launched(
            params_file=str(file), namespace='left', record='false', composed='true'
        ):
            # The plant waits for one node more: 20 ticks can end before the test receives any.
            assert 'plant:wait_for:=["trajectory", "controller"]' in arguments
            awaited = ['-p', f'plant:wait_for:={[*AWAITED, WITNESS]}']
            composed = started.start(
                executable, *arguments, '--ros-args', *awaited, environment=INTERPRETED
            )
        tester.until(lambda: all(records.values()) or composed.process.poll() is not None)
        witness = Node(WITNESS, namespace='/left', context=tester.node.context)
        # The run ends automatically; it is in lockstep, independent of the duration of a tick.
        assert started.wait() == {'composed': 0}, started.output()
        assert composed.logged('INFO', '20 ticks in'), started.output()
        witness.destroy_node()
    for node in NODES:
        active = read_record(records[node][0].data).parameters
        declared_values = {
            n: list(v) if isinstance(v, tuple) else v for n, v in expected[node].items()
        }
        if node == 'plant':
            declared_values['wait_for'] = [*AWAITED, WITNESS]
        assert active == declared_values
