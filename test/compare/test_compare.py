# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc compare` and `masmc laws`: results against `masmc simulate`, in any lane."""

from __future__ import annotations

from dataclasses import replace
import hashlib
import json
import math
from pathlib import Path

from helpers.campaigns import assert_equal
from masmc_ros.campaign.runs import NODES
from masmc_ros.cli.main import main
from masmc_ros.compare import trials
from masmc_ros.compare import trials as trials_module
from masmc_ros.compare.contenders import Contender, contenders, marked
from masmc_ros.compare.law_comparison import Comparison, comparison_of, compute, ranking
from masmc_ros.compare.tables import rows_of
from masmc_ros.compare.trials import (
    AS_IS,
    drawn_robot,
    HARDWARE,
    sets_observer,
    Trial,
    TRIALS,
    trials_named,
)
from masmc_ros.errors import InputError
from masmc_ros.law import registry
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
SHORT = ('duration=0.3',)


@pytest.mark.slow
def test_side_by_side_runs_equal_single_runs() -> None:
    """Every draw has its own robot, disturbance and noise; results equal `Simulation` bitwise."""
    settings = (*SHORT, 'plant.velocity_noise=0.02', 'controller.projection.lower=0.5')
    scenario = load_scenario(PAPER, settings)
    runs = [drawn_robot(scenario, TWO_LINK, seed) for seed in range(4)]
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
    assert drawn_robot(scenario, TWO_LINK, 0) is scenario
    first, again, other = (drawn_robot(scenario, TWO_LINK, seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert first['controller'] == scenario['controller']
    names = [name for name in scenario['plant'] if name.startswith('robot.')]
    masses = [name for name in names if name.endswith(('_mass', '_inertia'))]
    assert len(masses) == 9
    for name in masses:
        ratio = first['plant'][name] / (scenario['plant'][name] or 1.0)
        assert ratio == 0.0 or 0.6 <= ratio <= 1.4


@pytest.mark.slow
def test_compare_lanes_and_single_runs_give_same_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    comparison = comparison_of(PAPER, SHORT, 'rasmc', 'delay,noise', 5)
    alone = compute(comparison)
    monkeypatch.setattr(Comparison, 'lanes', 4)
    assert_equal(compute(comparison), alone)


def test_compare_run_has_settings_of_law_and_trial() -> None:
    settings = ('controller.k_s1=80.0',)
    comparison = comparison_of(PAPER, settings, 'smc:tanh,rasmc', 'all', 2)
    again = Comparison.from_text(comparison.text)
    assert again.text == comparison.text
    assert again.key == comparison.key
    runs = list(again.runs(0, again.total))
    expected = [
        drawn_robot(
            load_scenario(
                PAPER, (*settings, *contender.settings, *trial.settings_for(TWO_LINK))
            ),
            TWO_LINK,
            seed,
        )
        for contender in (Contender('smc', 'tanh'), Contender('rasmc'))
        for trial in TRIALS
        for seed in range(2)
    ]
    for run, scenario in zip(runs, expected, strict=True):
        assert run.scenario.values == {node: scenario[node] for node in NODES}
    assert list(again.runs(5, 4)) == runs[5:9]
    assert sum(count for _, count in again.parts(5)) == again.total == len(runs)


def test_compare_diverged_run_counts_as_lost() -> None:
    settings = (*SHORT, 'control_period=0.05', 'controller.k_s1=1e5')
    comparison = comparison_of(PAPER, settings, 'smc', AS_IS.name, 1)
    (ranked,) = ranking(comparison, compute(comparison))
    assert ranked.rows[AS_IS.name].lost == 1
    assert set(ranked.rows[AS_IS.name].errors.values()) == {math.inf}
    assert math.isinf(ranked.rows[AS_IS.name].error)
    (row,) = rows_of([ranked], [AS_IS])
    assert [row[f'{point.key}_rms'] for point in TWO_LINK.points] == [None, None]


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


def test_compare_prints_results_that_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'compare.html').mkdir()
    options = ['--laws', 'smc', '--trials', AS_IS.name, '--set', 'duration=0.05']
    assert main(['compare', PAPER, *options, '--output', str(tmp_path)]) == 2
    printed = capsys.readouterr()
    assert '1  smc' in printed.out
    assert 'cannot be written' in printed.err


@pytest.mark.parametrize(
    ('arguments', 'line'),
    [
        (['--laws', 'smcc'], "--laws: 'smcc' is unknown"),
        (['--laws', 'smc:tan'], "--laws: 'tan' in 'smc:tan' is unknown"),
        (['--laws', 'nonlinear_feedback:tanh'], 'has no reaching term'),
        (['--trials', 'noisy'], "--trials: 'noisy' is unknown"),
        (['--seeds', '0'], "'0': expected a whole number >= 1"),
        (['--threads', '0'], "'0': expected a whole number >= 1"),
        (['--laws', 'smc', '--scheduler', 'nonsense://x'], 'no Dask scheduler answers'),
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
    assert trials_named('all', TWO_LINK) == TRIALS
    assert trials_named('delay', TWO_LINK)[0] is AS_IS


def test_trials_of_laws_vary_period_limits_and_observer() -> None:
    trials = trials_named('laws', TWO_LINK)
    assert len({trial.settings_for(TWO_LINK) for trial in trials}) == len(trials) == 12
    scenarios = [load_scenario(PAPER, trial.settings_for(TWO_LINK)) for trial in trials]
    assert {s['plant']['control_period'] for s in scenarios} == {0.001, 0.002, 0.01}
    assert {s['controller']['observer_gain'] for s in scenarios} == {0.0}
    assert {s['controller']['compensation.gain'] for s in scenarios} == {0.0, 0.3}
    assert {any(s['controller']['torque_limit']) for s in scenarios} == {False, True}
    assert sets_observer(trials)
    assert not sets_observer(TRIALS)


def test_hardware_conditions_of_version_are_fixed() -> None:
    """Results of a version are comparable: other conditions need another VERSION."""
    digest = hashlib.sha256(repr(trials.CONDITIONS).encode()).hexdigest()
    assert (trials.BENCHMARK_VERSION, digest[:16]) == (2, '18034e4e4a7b996c')


def test_hardware_trials_load_with_effects_that_differ() -> None:
    trials = trials_named('hardware', TWO_LINK)
    assert {trial.benchmark for trial in trials} == {'hardware 2'}
    assert len({trial.name for trial in trials}) == len(trials)
    assert not {trial.name for trial in trials} & {trial.name for trial in TRIALS}
    assert all(trial.suits(TWO_LINK) for trial in trials)
    scenarios = [load_scenario(PAPER, trial.settings_for(TWO_LINK)) for trial in trials]
    assert len({repr(scenario) for scenario in scenarios}) == len(trials)
    assert {s['controller']['model_scale'] for s in scenarios} == {0.5}
    for trial, scenario in zip(trials, scenarios, strict=True):
        plant, controller = scenario['plant'], scenario['controller']
        delay = plant['measurement_delay'] + plant['command_delay']
        known = 'unknown' not in trial.name and ' as ' not in trial.name
        assert (controller['latency'] == pytest.approx(delay)) == known
    assert scenarios[0]['plant']['torque_limit'] == pytest.approx((5.6, 5.6, 14.0, 7.0))
    assert scenarios[0]['plant']['stiction.torque'] == pytest.approx((0.16, 0.16, 0.4, 0.2))


def test_hardware_trials_of_fixed_robot_have_no_base() -> None:
    fixed = replace(TWO_LINK, twist=())
    names = [trial.name for trial in trials_named('hardware', fixed)]
    assert [trial.name for trial in HARDWARE if trial.name not in names] == ['hybrid', 'slip']
    with pytest.raises(InputError, match="'slip' needs a driven base"):
        trials_named('slip', fixed)


def test_limits_of_file_stay_for_drives_without_known_limits() -> None:
    """A trial with limits would otherwise remove those of the scenario."""
    controller = {'torque_limit': (1.0, 2.0, 3.0, 4.0), 'torque_rate_limit': (5.0, 6.0, 7.0, 8.0)}
    unknown = {**TWO_LINK.defaults, **dict.fromkeys(controller, (0.0,) * 4)}
    for trial in ('limits', 'torque limits'):
        settings = trials_named(trial, TWO_LINK)[-1].settings_for(
            replace(TWO_LINK, defaults=unknown), controller
        )
        values = load_scenario(PAPER, settings)['controller']
        assert {name: values[name] for name in controller} == controller


def test_trials_with_limits_use_smaller_of_file_and_drives() -> None:
    """A trial must not raise the limits of a file, such as those that keep traction."""
    controller = {
        'torque_limit': (1.0, 9.0, 30.0, 2.0), 'torque_rate_limit': (50.0, 600.0, 700.0, 800.0),
    }  # fmt: skip
    usual, hardware_limits = (
        load_scenario(PAPER, trials_named(name, TWO_LINK)[-1].settings_for(TWO_LINK, controller))
        for name in ('limits', 'torque limits')
    )
    limited = usual['controller']
    assert limited['torque_limit'] == (1.0, 8.0, 20.0, 2.0)
    assert limited['torque_rate_limit'] == (50.0, 400.0, 700.0, 500.0)
    for node in ('plant', 'controller'):
        limits = hardware_limits[node]['torque_limit']
        assert limits == pytest.approx((0.7, 5.6, 14.0, 1.4), rel=1e-12)
        assert hardware_limits[node]['torque_rate_limit'] == limited['torque_rate_limit']


@pytest.mark.slow
def test_hardware_trial_with_slip_equals_simulation() -> None:
    pytest.importorskip('mujoco')
    (slip,) = (trial for trial in HARDWARE if trial.name == 'slip')
    settings = 'duration=0.2', 'controller.switching=implicit'
    comparison = comparison_of(PAPER, settings, 'smc', slip.name, 2)
    rows = compute(replace(comparison, trials=(slip,)))
    scenario = load_scenario(
        PAPER, (*settings, 'controller.law=smc', *slip.settings_for(TWO_LINK))
    )
    (run,) = Simulation(scenario).run()
    half = run.error[100:-1, :2]
    expected = np.sqrt((half**2).sum(axis=1).mean())
    first, second = rows[f'{TWO_LINK.points[0].key}_rms']
    assert first == pytest.approx(expected, rel=1e-12)
    assert first != second


@pytest.mark.slow
def test_hardware_trial_whose_robot_falls_is_lost() -> None:
    pytest.importorskip('mujoco')
    settings = 'plant.physics=mujoco', 'plant.friction=0.01', 'controller.approach_on_start=false'
    jump = Trial('jump', 'a start with a jump', settings)
    comparison = comparison_of(PAPER, ('duration=0.5',), 'smc', AS_IS.name, 1)
    (is_lost,) = compute(replace(comparison, trials=(jump,)))['lost']
    assert is_lost


@pytest.mark.slow
def test_compare_command_names_version_of_benchmark(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(trials_module._GROUPS, 'hardware', HARDWARE[:2])
    folder = tmp_path / 'out'
    options = ['--laws', 'smc:implicit', '--set', SHORT[0], '--output', str(folder)]
    assert main(['compare', PAPER, '--trials', 'hardware', *options]) == 0
    assert 'Benchmark: hardware 2.' in capsys.readouterr().out
    assert 'Benchmark: hardware 2.' in (folder / 'compare.html').read_text(encoding='utf-8')
    rows = json.loads((folder / 'compare.json').read_text(encoding='utf-8'))
    assert [row['trial'] for row in rows] == ['all 5 ms', 'all 2 ms']
    assert {row['benchmark'] for row in rows} == {'hardware 2'}


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
