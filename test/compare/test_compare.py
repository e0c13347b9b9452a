# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc compare` and `masmc laws`: results against `masmc simulate`, in any lane."""

from __future__ import annotations

import json
from pathlib import Path

from masmc_ros.cli.main import main
from masmc_ros.compare import campaign
from masmc_ros.compare.campaign import compute, Task
from masmc_ros.compare.contenders import Contender, contenders, marked
from masmc_ros.compare.ranking import ranking
from masmc_ros.compare.trials import AS_IS, drawn, sets_observer, TRIALS, trials_named
from masmc_ros.errors import InputError
from masmc_ros.law import registry
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.scenario import load_scenario
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
SHORT = ('duration=0.3',)


@pytest.mark.slow
def test_side_by_side_runs_equal_single_runs() -> None:
    """Every draw has its own robot, disturbance and noise; results equal `Simulation` bitwise."""
    settings = (*SHORT, 'plant.velocity_noise=0.02', 'controller.projection.lower=0.5')
    scenario = load_scenario(PAPER, settings)
    runs = [drawn(scenario, TWO_LINK, seed) for seed in range(4)]
    blocks = list(BatchSimulation(runs).run(block=100))
    signals = np.concatenate(blocks)
    assert len(signals) == 301
    assert len(blocks) == 4
    for lane, run in enumerate(runs):
        alone = next(Simulation(run).run())
        for name in ('error', 'torque', 'position', 'estimate'):
            np.testing.assert_array_equal(signals[name][:, :, lane], getattr(alone, name))
    assert len({tuple(signals['torque'][-1, :, lane]) for lane in range(4)}) == 4


def test_side_by_side_different_durations_raise() -> None:
    one, other = load_scenario(PAPER, SHORT), load_scenario(PAPER, ('duration=0.4',))
    with pytest.raises(InputError, match=r'plant.duration = 0.4: expected 0.3'):
        BatchSimulation([one, other])


def test_drawn_scenario_changes_plant_only_repeatably() -> None:
    scenario = load_scenario(PAPER, SHORT)
    assert drawn(scenario, TWO_LINK, 0) is scenario
    first, again, other = (drawn(scenario, TWO_LINK, seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert first['controller'] == scenario['controller']
    masses = [n for n in scenario['plant'] if n.endswith(('_mass', '_inertia'))]
    assert len(masses) == 9
    for name in masses:
        ratio = first['plant'][name] / (scenario['plant'][name] or 1.0)
        assert ratio == 0.0 or 0.6 <= ratio <= 1.4


@pytest.mark.slow
def test_compare_lanes_and_single_runs_give_same_table(monkeypatch: pytest.MonkeyPatch) -> None:
    task = Task(PAPER, SHORT, Contender('rasmc'), (AS_IS,), 5)
    alone = compute(task)
    monkeypatch.setattr(campaign, 'LANES', 4)
    monkeypatch.setattr(campaign, '_WORTH_LANES', 1)
    assert compute(task) == alone


def test_compare_diverged_run_counts_as_lost() -> None:
    settings = (*SHORT, 'control_period=0.05', 'controller.k_s1=1e5')
    (result,) = compute(Task(PAPER, settings, Contender('smc'), (AS_IS,), 1))
    assert result.reached == (None,)
    (ranked,) = ranking([result], AS_IS.name)
    assert ranked.rows[AS_IS.name].lost == 1


def test_compare_command_writes_printed_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ['compare', PAPER, '--laws', 'smc,rasmc,smc:implicit', '--trials', 'noise,delay']
    folder = tmp_path / 'out'
    options = ['--set', SHORT[0], '--output', str(folder)]
    assert main([*arguments, *options]) == 0
    printed = capsys.readouterr().out
    text = (folder / 'compare.txt').read_text(encoding='utf-8')
    assert printed.startswith(text)
    for word in ('smc:implicit', 'as it is', 'noise', 'delay', 'lost'):
        assert word in text
    page = (folder / 'compare.html').read_text(encoding='utf-8')
    assert 'smc:implicit' in page
    assert 'src=' not in page
    rows = json.loads((folder / 'compare.json').read_text(encoding='utf-8'))
    assert len(rows) == 9
    simulated = next(Simulation(load_scenario(PAPER, (*SHORT, 'controller.law=smc'))).run())
    half = simulated.error[150:-1]
    expected = np.sqrt((half**2).sum(axis=1).mean())
    wanted = ['smc', '', AS_IS.name]
    row = next(r for r in rows if [r['law'], r['switching'], r['trial']] == wanted)
    assert row['error'] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ('arguments', 'line'),
    [
        (['--laws', 'smcc'], "--laws: 'smcc' is unknown"),
        (['--laws', 'smc:tan'], "--laws: 'tan' in 'smc:tan' is unknown"),
        (['--laws', 'nonlinear_feedback:tanh'], 'has no reaching term'),
        (['--trials', 'noisy'], "--trials: 'noisy' is unknown"),
        (['--seeds', '0'], "'0': expected a whole number >= 1"),
        (['--set', 'controller.command_interface=velocity', '--set',
          'plant.command_interface=velocity'], 'expected effort'),
    ],
)
def test_compare_invalid_arguments_print_one_line(
    arguments: list[str], line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['compare', PAPER, *arguments, '--output', str(tmp_path / 'out')]) == 2
    error_text = capsys.readouterr().err
    assert line in error_text
    assert error_text.count('\n') == 1
    assert not (tmp_path / 'out').exists()


def test_compare_all_selects_every_law_and_trial() -> None:
    all_contenders = contenders('all', TWO_LINK, 'tanh')
    laws = {contender.law for contender in all_contenders}
    # This law is `nonlinear_feedback` by another name.
    assert set(registry.names()) - laws == {'input_output_decoupling'}
    assert [c.switching for c in all_contenders if c.law == 'rasmc'] == ['', 'implicit']
    others = contenders('all', TWO_LINK, 'implicit')
    assert [c.switching for c in others if c.law == 'rasmc'] == ['', 'tanh']
    assert [c for c in others if c.law == 'pid'] == [Contender('pid')]
    assert trials_named('all') == TRIALS
    assert trials_named('delay')[0] is AS_IS


def test_trials_of_laws_vary_period_limits_and_observer() -> None:
    trials = trials_named('laws')
    assert len({trial.settings_for(TWO_LINK) for trial in trials}) == len(trials) == 12
    scenarios = [load_scenario(PAPER, trial.settings_for(TWO_LINK)) for trial in trials]
    assert {s['plant']['control_period'] for s in scenarios} == {0.001, 0.002, 0.01}
    assert {s['controller']['observer_gain'] for s in scenarios} == {0.0}
    assert {s['controller']['compensation.gain'] for s in scenarios} == {0.0, 0.3}
    assert {any(s['controller']['torque_limit']) for s in scenarios} == {False, True}
    assert sets_observer(trials)
    assert not sets_observer(TRIALS)


def test_contender_with_disturbance_estimate_is_marked() -> None:
    chosen = contenders('smc,smc:implicit,pid', TWO_LINK, 'tanh')
    labels = [c.label for c in marked(chosen, {'switching': 'tanh', 'observer_gain': 0.5})]
    assert labels == ['smc', 'smc:implicit + observer', 'pid']
    labels = [c.label for c in marked(chosen, {'switching': 'implicit', 'observer_gain': 0.5})]
    assert labels[0] == 'smc + observer'
    assert marked(chosen, {'switching': 'implicit', 'observer_gain': 0.0}) == chosen


def test_laws_command_lists_laws_with_sources(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['laws']) == 0
    lines = capsys.readouterr().out.splitlines()
    names = [line.split()[0] for line in lines if not line.startswith(' ')]
    assert names == list(registry.names())
    assert main(['laws', '--json']) == 0
    rows = json.loads(capsys.readouterr().out)
    assert all(row['summary'] and row['source'] for row in rows)


def test_laws_command_measures_cost(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, 'names', lambda: ('rasmc', 'pid'))
    assert main(['laws', '--cost', '--json']) == 0
    rows = json.loads(capsys.readouterr().out)
    assert all(0.0 < row['cost_us'] < 1e5 for row in rows)
    assert rows[0]['cost'] == 1.0
