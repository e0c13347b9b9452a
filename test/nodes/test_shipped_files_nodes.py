# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Each parameter file of config/ starts in a namespace, and its values are active there."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from launch_file import launched
from masmc_ros.messages.parameter_record import read_record
from masmc_ros.params.scenario import load_scenario
from masmc_ros.share import scenarios
from processes import peer, processes
import pytest
from std_msgs.msg import String

NODES = ('plant', 'trajectory', 'controller')
COMPILING = 900.0
"""Time in s that the kernels of a tree robot may take on a busy machine."""

TREES = ('tiago', 'tiago_pro', 'franka_on_omni')
"""Files of robots whose URDF comes with the extra robots."""

SHORT = '/**:\n  ros__parameters:\n    duration: 0.02\n'


@pytest.mark.parametrize(
    'name',
    [
        pytest.param(name, marks=pytest.mark.slow) if name in TREES else name
        for name in sorted(scenarios().keys() - {'realtime'})
    ],
)
def test_a_shipped_file_runs_in_a_namespace(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name in TREES and find_spec('pinocchio') is None:
        pytest.skip('its URDF comes with the extra robots')
    monkeypatch.setattr('processes.PATIENCE', COMPILING)
    file = tmp_path / f'{name}.yaml'
    file.write_text(scenarios()[name].read_text(encoding='utf-8') + SHORT, encoding='utf-8')
    expected = load_scenario(str(file))
    with processes(tmp_path) as started, peer(started.domain) as tester:
        records = {n: tester.collect(String, f'/left/{n}/parameters') for n in NODES}
        for executable, arguments in launched(
            tmp_path, params_file=str(file), namespace='left', record='false', composed='true'
        ):
            composed = started.start(executable, *arguments)
        # The run is over by itself: it is in lock-step, however long a tick takes.
        tester.until(lambda: all(records.values()) or composed.process.poll() is not None)
        assert started.wait() == {'composed': 0}, started.output()
        assert composed.logged('INFO', '20 ticks in'), started.output()
    for node in NODES:
        active = read_record(records[node][0].data).parameters
        wanted = {n: list(v) if isinstance(v, tuple) else v for n, v in expected[node].items()}
        if node == 'plant':
            wanted['wait_for'] = ['trajectory', 'controller']
        assert active == wanted
