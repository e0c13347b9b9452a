# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameter files shared by several packages, and installed parameter files."""

from __future__ import annotations

from pathlib import Path
import signal

from helpers.command_process import SERVED
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.files import scenario_file, scenarios
from masmc_ros.scenario.scenario import load_scenario
import pytest

SHARED = """
/**:
  ros__parameters:
    use_sim_time: false
    costmap_frequency: 5.0
    law: smc
    duration: 0.2
    qos_overrides:
      /scan:
        subscription:
          depth: 3
/**/controller:
  ros__parameters:
    k_s1: 80.0
/amcl:
  ros__parameters:
    max_beams: 60
"""
FOREIGN = 'costmap_frequency, qos_overrides./scan.subscription.depth: no parameter of this package'


@pytest.fixture
def shared(tmp_path: Path) -> Path:
    path = tmp_path / 'shared.yaml'
    path.write_text(SHARED)
    return path


def test_shared_file_foreign_parameters_are_reported_and_ignored(
    shared: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = load_scenario(str(shared))
    assert scenario['controller']['law'] == 'smc'
    assert scenario['controller']['k_s1'] == (80.0,) * 4
    assert {scenario[node]['duration'] for node in ('plant', 'controller', 'recorder')} == {0.2}
    assert main(['simulate', str(shared)]) == 0
    block, names = capsys.readouterr().err.splitlines()
    assert block.startswith(f"{shared}:15: block '/amcl'")
    assert names.startswith(f'{shared}: {FOREIGN}')


@pytest.mark.slow
@pytest.mark.parametrize('node', ['plant', 'controller', 'trajectory', 'recorder', 'play'])
def test_shared_file_nodes_report_foreign_parameters(
    shared: Path, tmp_path: Path, node: str
) -> None:
    if node in SERVED:
        pytest.importorskip(SERVED[node])
    from helpers.processes import peer, processes, ros_arguments

    with processes(tmp_path) as started, peer(started.domain) as tester:
        output = {'output': tmp_path / 'run.mcap'} if node == 'recorder' else {}
        output |= {'port': 0} if node in SERVED else {}
        running = started.start(node, *ros_arguments(shared, **output))
        tester.until(lambda: running.logged('WARN', FOREIGN), 'the warning')
        tester.until(lambda: running.logged('INFO', 'waiting for'), 'a node that waits')
        running.signal(signal.SIGINT)
        assert started.wait() == {node: 0}, started.output()
        assert len(running.logged('WARN')) == 1


def test_shared_file_foreign_name_in_own_block_raises(shared: Path) -> None:
    text = SHARED.replace('k_s1: 80.0', 'costmap_frequency: 1.0')
    shared.write_text(text)
    with pytest.raises(InputError, match='yaml:14: unknown parameter'):
        load_scenario(str(shared))


def test_installed_files_are_selected_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(['simulate', '--list']) == 0
    listed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert listed == {name: str(path) for name, path in scenarios().items()}
    assert {'paper', 'realtime', 'robust'} <= listed.keys()
    assert main(['simulate', 'paper', '--set', 'duration=0.1']) == 0
    assert 'rasmc' in capsys.readouterr().out
    with pytest.raises(InputError, match=r'papr: no such file; did you mean paper\?'):
        scenario_file('papr')
    with pytest.raises(InputError, match=r'xyz: no such file; .*paper, realtime, robust'):
        scenario_file('xyz')
    # A file of the user takes precedence, and a path is a file.
    Path('paper').write_text('')
    assert scenario_file('paper') == 'paper'
    assert scenario_file('./robust') == './robust'
