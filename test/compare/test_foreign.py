# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Controllers from elsewhere in `masmc compare`, and results of other comparisons."""

from __future__ import annotations

import json
from pathlib import Path

from masmc_ros.aliases import Array
from masmc_ros.cli.main import main
from masmc_ros.compare.contenders import loaded
from masmc_ros.compare.law_comparison import compared, comparison_of
from masmc_ros.errors import InputError
from masmc_ros.law.plug_in import TickInput
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params import plug_ins
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
SHORT = ['--set', 'duration=0.05', '--laws', 'smc']

CONTROLLERS = '''
import numpy as np


def spring(state, reference):
    """Spring and damper on each task axis."""
    return state.jacobian.T @ (-400.0 * state.error - 60.0 * state.error_rate)


class Counting:
    """Torque that is the number of the tick."""

    ticks = 0

    def __call__(self, state, reference):
        self.ticks += 1
        return np.full(4, 1e-3 * self.ticks)


def three(state, reference):
    return np.zeros(3)


def failing(state, reference):
    return reference[9]


def void(state, reference):
    return np.full(4, np.nan)
'''


@pytest.fixture(autouse=True)
def _no_controllers_remain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plug_ins, '_added', {})


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / 'controllers.py'
    path.write_text(CONTROLLERS)
    return str(path)


def compare(folder: Path, *arguments: str) -> int:
    return main(['compare', PAPER, *SHORT, '--output', str(folder), *arguments])


def test_controller_result_equals_law_in_plain_python(file: str) -> None:
    """The controller sees each tick with the settings of the trial."""
    controllers = dict([loaded(f'{file}:spring')])
    comparison = comparison_of(PAPER, ['duration=0.1'], 'smc', 'limits', 1, controllers)
    ranked = {entry.contender.law: entry for entry in compared(comparison)}
    assert ranked['spring'].summary == 'Spring and damper on each task axis.'
    for trial in comparison.trials:
        settings = trial.settings_for(comparison.mechanism)
        scenario = load_scenario(
            PAPER, ('duration=0.1', *settings, 'controller.law=spring')
        )
        (run,) = Simulation(scenario).run()
        expected = np.sqrt((run.error[50:-1]**2).sum(axis=1).mean())
        assert ranked['spring'].rows[trial.name].error == pytest.approx(expected, rel=1e-12)
    assert ranked['smc'].rows.keys() == ranked['spring'].rows.keys()


@pytest.mark.slow
def test_policy_has_metrics_of_environment() -> None:
    """The observation of the guide is that of the environment, and so are the metrics."""
    gymnasium = pytest.importorskip('gymnasium')
    from masmc_ros.api.learning import ENVIRONMENT

    gains = 20.0 * np.random.default_rng(0).standard_normal((4, 34))

    def policy(state: TickInput, reference: Array) -> Array:
        parts = state.error, state.error_rate, state.position, state.velocity, *reference
        return np.tanh(gains @ np.concatenate(parts))

    comparison = comparison_of(PAPER, ['duration=0.3'], 'smc', 'as it is', 1, {'policy': policy})
    (entry,) = (e for e in compared(comparison) if e.contender.law == 'policy')
    env = gymnasium.make(ENVIRONMENT, scenario=PAPER, duration=0.3)
    observation, _ = env.reset(seed=0)
    has_ended = False
    while not has_ended:
        torque = np.tanh(gains @ observation)
        observation, _, _, has_ended, info = env.step(torque)
    rms = [info['row'][f'{point.key}_rms'] for point in comparison.mechanism.points]
    assert list(entry.rows['as it is'].errors.values()) == pytest.approx(rms, rel=1e-9)


def test_class_has_instance_for_each_run(file: str) -> None:
    controllers = dict([loaded(f'{file}:Counting')])
    comparison = comparison_of(PAPER, ['duration=0.05'], 'smc', 'as it is', 2, controllers)
    (entry,) = (e for e in compared(comparison) if e.contender.law == 'Counting')
    # The second run continues the first one's count otherwise, with twice the torque.
    assert entry.rows['as it is'].efforts['torque_rms'] == pytest.approx(2 * 0.0381, rel=0.02)


def test_controller_has_no_row_for_base_by_velocity(
    file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    controllers = dict([loaded(f'{file}:spring')])
    comparison = comparison_of(PAPER, ['duration=0.05'], 'smc', 'hybrid', 1, controllers)
    plain, compiled = comparison.by_kind()
    assert [trial.name for trial in plain.trials] == ['as it is']
    assert [trial.name for trial in compiled.trials] == ['as it is', 'hybrid']
    hybrid = [f'--set={node}.command_interface=hybrid' for node in ('controller', 'plant')]
    assert compare(tmp_path / 'out', '--controller', f'{file}:spring', *hybrid) == 2
    assert 'laws in plain Python command torques' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('name', 'line'),
    [
        ('three', 'its result has the shape (3,), expected (4,)'),
        ('failing', 'IndexError: index 9 is out of bounds'),
        ('sprong', "has no function or class 'sprong'; did you mean spring?"),
        ('a-b', 'expected FILE.py:NAME'),
        ('spring spring', "another controller has the name 'spring'"),
    ],
)
def test_mistake_of_controller_prints_one_line(
    name: str, line: str, file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = '--trials', 'as it is', *(f'--controller={file}:{n}' for n in name.split())
    assert compare(tmp_path / 'out', *arguments) == 2
    text = capsys.readouterr().err
    assert line in text
    assert text.strip().count('\n') == 0
    assert not (tmp_path / 'out').exists()


def test_name_of_law_is_rejected(file: str) -> None:
    with pytest.raises(InputError, match="'smc': a law has this name"):
        comparison_of(PAPER, [], 'smc', 'all', 1, {'smc': lambda state, _: state.commanded})


def test_torque_that_is_not_finite_is_lost(file: str) -> None:
    controllers = dict([loaded(f'{file}:void')])
    comparison = comparison_of(PAPER, ['duration=0.05'], 'smc', 'as it is', 1, controllers)
    assert compared(comparison)[-1].rows['as it is'].lost == 1


def test_added_results_are_in_table_and_page(
    file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there, here = tmp_path / 'there', tmp_path / 'here'
    trials = '--trials', 'as it is'
    assert compare(there, *trials, '--controller', f'{file}:spring') == 0
    # The other comparison has no file of the controller.
    assert compare(here, *trials, '--add', str(there / 'results.json')) == 0
    tables = [(folder / 'compare.txt').read_text(encoding='utf-8') for folder in (there, here)]
    assert tables[0] == tables[1]
    assert 'spring' in (here / 'compare.html').read_text(encoding='utf-8')
    laws = {row['law'] for row in json.loads((here / 'compare.json').read_text())}
    assert laws == {'smc', 'spring'}
    # Results of others are not results of this run.
    own = json.loads((here / 'results.json').read_text(encoding='utf-8'))
    assert [entry['law'] for entry in own['entries']] == ['smc']
    capsys.readouterr()
    for arguments, line in (
        (('--seeds', '2'), 'seeds is 1 there and 2 here'),
        (('--set', 'plant.seed=3'), 'scenario.plant.seed is 0 there and 3 here'),
        (('--trials', 'delay'), 'trials.delay is only here'),
        (('--set', 'controller.k_s1=50.0'), 'smc in as it is: error'),
    ):
        added = '--add', str(there / 'results.json')
        assert compare(tmp_path / 'out', *trials, *added, *arguments) == 2
        text = capsys.readouterr().err
        assert line in text
        assert text.strip().count('\n') == 0


def test_changed_file_of_results_is_rejected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert compare(tmp_path / 'there', '--trials', 'as it is') == 0
    path = tmp_path / 'there' / 'results.json'
    content = json.loads(path.read_text(encoding='utf-8'))
    content['scenario']['plant']['duration'] = 20.0
    capsys.readouterr()
    for text, line in (
        (json.dumps(content), 'its scenario was changed: SHA-256'),
        ('[]', 'expected a results.json of compare'),
        (json.dumps({**content, 'sha256': 'x'}), 'expected a results.json of compare'),
        ('{', 'no JSON'),
    ):
        path.write_text(text, encoding='utf-8')
        assert compare(tmp_path / 'out', '--trials', 'as it is', '--add', str(path)) == 2
        assert line in capsys.readouterr().err
