# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`--json`: standard output is JSON, and its keys are those of the reference page."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import chdir
import csv
import json
import math
from pathlib import Path
import re
from typing import Any

from helpers.small_tree import hand_at_start, write_scenario
from masmc_ros.cli.main import COMMANDS, main
from masmc_ros.law import registry
from masmc_ros.report.measure.metrics import declared, Metrics, Reached
from masmc_ros.result_text import json_text
import numpy as np
import pytest
from test_bad_input import PAPER

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'reference' / 'json.md'
WITHOUT_TABLE = {'run', 'play', 'view', 'layout'}
NAMED = {'percentiles', 'values', 'masses', 'scenarios', 'rank_correlations', 'parameters'}
"""Objects whose keys are names of the user's data."""

_METRICS = [m.name for kind in (Metrics, Reached) for m in declared(kind).values()]
METRIC = re.compile(rf'(\w+_)?({"|".join(_METRICS)})$')
SHORT = ('--set', 'duration=0.1')
DRAW = ('--draw', 'plant.robot.link_2_mass=uniform:0.6:1.4')


def documented(section: str) -> set[str]:
    """Return the keys in the tables of a section of the page."""
    text = PAGE.read_text(encoding='utf-8').partition(f'\n## {section}\n')[2].partition('\n## ')[0]
    cells = (line.split('|')[1] for line in text.splitlines() if line.startswith('| `'))
    return {key for cell in cells for key in re.findall(r'`([^`]+)`', cell)}


def keys(value: Any, path: str = '', parent: str = '') -> Iterator[str]:
    """Yield the paths of all values, as the page writes them; empty objects are values."""
    if isinstance(value, list):
        for entry in value:
            yield from keys(entry, f'{path}[]')
    elif isinstance(value, dict) and value:
        for key, entry in value.items():
            name = 'NAME' if parent in NAMED else 'METRIC' if path and METRIC.match(key) else key
            yield from keys(entry, f'{path}.{name}' if path else name, key)
    else:
        yield path


def check(section: str, *outputs: Any) -> None:
    """Compare the keys of all outputs with those of a section."""
    printed = {key for output in outputs for key in keys(output)}
    known = documented(section)
    # An object that does not exist is null.
    absent = {key for key in printed if any(k.startswith(f'{key}.') for k in known)}
    assert printed - absent == known


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a log and a log that is truncated."""
    path = tmp_path_factory.mktemp('json')
    with chdir(path):
        assert main(['simulate', PAPER, *SHORT, '--output', 'run.mcap']) == 0
        data = Path('run.mcap').read_bytes()
        Path('cut.mcap').write_bytes(data[: len(data) // 2])
    return path


@pytest.fixture
def output(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Any:
    """Return a function that runs a command with `--json` in the folder."""
    monkeypatch.chdir(folder)

    def run(*arguments: str, status: int = 0) -> Any:
        capsys.readouterr()
        assert main([*arguments, '--json']) == status
        return json.loads(capsys.readouterr().out)

    return run


def test_json_of_numbers_paths_and_arrays() -> None:
    values = {'a': np.float64(0.1), 'b': [math.inf, -math.inf, math.nan], 'c': Path('x'), 1: None}
    assert json.loads(json_text(values)) == {
        'a': 0.1, 'b': ['Infinity', '-Infinity', 'NaN'], 'c': 'x', '1': None,
    }
    assert [float(text) for text in ('Infinity', '-Infinity')] == [math.inf, -math.inf]
    assert json.loads(json_text(np.arange(2)[:, None])) == [[0], [1]]
    with pytest.raises(TypeError, match='object has no representation'):
        json_text(object())


def test_every_command_with_a_table_has_json(capsys: pytest.CaptureFixture[str]) -> None:
    text = PAGE.read_text(encoding='utf-8')
    titles = ' '.join(re.findall('^## (.*)$', text, re.MULTILINE)).split()
    for command in COMMANDS:
        arguments = [command, 'list', '--help'] if command == 'param' else [command, '--help']
        assert main(arguments) == 0
        assert ('--json' in capsys.readouterr().out) == (command not in WITHOUT_TABLE), command
        assert (command in titles) == (command not in WITHOUT_TABLE), command


def test_simulate_json_is_run_and_recomputation(output: Any) -> None:
    again = output('simulate', 'run.mcap')
    check('simulate', output('simulate', PAPER, *SHORT), again)
    assert again['recomputed'] == {
        'states': 101, 'identical_states': 101, 'commands': 101, 'identical_commands': 101,
        'first_difference': None,
    }
    (run,) = again['runs']
    assert run['end_effector_settling'] == 'Infinity'
    assert again['units']['torque_rms'] == 'N·m'
    assert {key for key in run if key != 'run'} == set(again['units'])


def test_simulate_list_json_is_scenarios(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['simulate', '--json', '--list']) == 0
    assert Path(json.loads(capsys.readouterr().out)['scenarios']['paper']).exists()


def test_report_json_equals_csv(output: Any, folder: Path) -> None:
    report = output('report', 'run.mcap')
    check('report and demo', report)
    text = (folder / 'report' / 'metrics.csv').read_text(encoding='utf-8')
    head, (_, *cells) = csv.reader(text.splitlines())
    units = [f'{name} ({unit})' if unit else name for name, unit in report['units'].items()]
    assert head == ['run', *units]
    *values, notes = (report['runs'][0][name] for name in report['units'])
    assert cells.pop() == notes
    assert [float(cell) for cell in cells] == [float(value) for value in values]
    assert all((folder / file).exists() for file in report['files'])


def test_export_and_recover_json_documented_keys(output: Any, folder: Path) -> None:
    exported = output('export', 'run.mcap')
    check('export and library', exported)
    file = exported['files'][0]
    assert (folder / file['file']).stat().st_size == file['bytes']
    recovered = output('recover', 'run.mcap', 'cut.mcap')
    known, printed = documented('recover'), set(keys(recovered))
    assert printed <= known
    assert known - printed <= {key for key in known if re.search(r'damaged|gaps', key)}
    assert [log['was_complete'] for log in recovered['logs']] == [True, False]


def test_recover_json_describes_gaps(output: Any, folder: Path) -> None:
    from masmc_ros.cli.commands.recover import _row
    from masmc_ros.log.read.gaps import Gaps
    from masmc_ros.log.recover import Recovered

    recovered = Recovered(messages=3, start=0, end=10**9, dropped=5, damaged=((1, 2),))
    gaps = Gaps()
    gaps.count, gaps.longest = 1, 10**9
    rows = [_row('a', recovered, {'joint_states': gaps}), _row('b', None, {})]
    check('recover', json.loads(json_text({'logs': rows})))


def test_robot_json_documented_keys(output: Any, tmp_path: Path) -> None:
    file = write_scenario(tmp_path, hand_at_start(), 0.05)
    finger = """<link name="finger"/><joint name="finger_joint" type="prismatic">
<parent link="hand"/><child link="finger"/><limit lower="0" upper="0.04" effort="1" velocity="1"/>
<mimic joint="hand_joint"/></joint></robot>"""
    urdf = tmp_path / 'small.urdf'
    urdf.write_text(urdf.read_text(encoding='utf-8').replace('</robot>', finger), encoding='utf-8')
    outputs = [output('robot', source) for source in (PAPER, str(file), str(urdf))]
    weak = output('robot', str(urdf), '--set', 'controller.torque_limit=0.1')
    check('robot', *outputs, weak)
    assert not outputs[1]['choices']
    assert any('limit below gravity' in warning for warning in weak['warnings'])


def test_preview_json_documented_keys(output: Any) -> None:
    pytest.importorskip('toppra')
    arguments = 'preview', PAPER, '--set', 'duration=7.0'
    far = output(*arguments, '--set', 'trajectory.line_sine.offset=[5.0, 0.5, 0.0, 0.0]', status=1)
    start = [axis['start'] for axis in output('robot', PAPER)['task']]
    points = f'trajectory.waypoints.points={2 * start}'
    hold = '--set', 'trajectory.type=waypoints', '--set', 'trajectory.waypoints.times=[0.0, 1.0]'
    fast = output(*arguments, *hold, '--set', points, '--fastest', 'fastest.csv')
    check('preview', output(*arguments), far, fast)


def test_laws_json_documented_keys(output: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, 'names', lambda: ('rasmc', 'pid'))
    check('laws', output('laws', '--cost'))


def test_compare_json_documented_keys(output: Any, folder: Path) -> None:
    rows = output('compare', PAPER, '--laws', 'smc', '--trials', 'noise', *SHORT)
    check('compare', rows)
    assert rows == json.loads((folder / 'compare' / 'compare.json').read_text(encoding='utf-8'))


def test_campaigns_json_documented_keys(output: Any) -> None:
    pytest.importorskip('pyarrow')
    grid = output('sweep', PAPER, '--vary', 'controller.k_s1=50,1e9', *SHORT)
    drawn = output('monte-carlo', PAPER, '--runs', '3', *DRAW, *SHORT)
    check('sweep and monte-carlo', grid, drawn)
    assert grid['best']['values'] == {'controller.k_s1': 50}
    assert [run['run'] for run in grid['diverged']] == [1]


def test_tune_json_documented_keys(output: Any) -> None:
    pytest.importorskip('optuna')
    searched = ('--tune', 'controller.k_s1=20:500:log', '--evaluations', '8')
    result = output('tune', PAPER, *searched, *SHORT)
    check('tune', result)
    assert result['candidates'] == 8


def test_warm_json_documented_keys(output: Any) -> None:
    check('warm', output('warm', '--laws', 'rasmc'))


@pytest.mark.slow
def test_excite_and_identify_json_documented_keys(output: Any) -> None:
    pytest.importorskip('clarabel')
    check('excite', output('excite', PAPER, '--output', 'excite.yaml', '--duration', '10'))
    logged = output('simulate', 'excite.yaml', '--output', 'excite.mcap')
    assert logged['log'] == 'excite.mcap'
    result = output('identify', 'excite.mcap', '--check', 'excite.mcap', '--output', 'new.yaml')
    known = documented('identify')
    printed = set(keys(result))
    assert printed <= known | {'payload'}
    assert {k for k in known - printed if not k.startswith('payload.')} <= {'not_excited[]'}
    assert result['files'] == ['new.yaml']
