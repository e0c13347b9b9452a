# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Rows of campaigns: equal to single runs, to any batching, and after an interruption."""

from __future__ import annotations

from itertools import islice
import json
import os
from pathlib import Path
import shlex
import signal
import subprocess
import sys

from helpers.campaigns import assert_equal, campaign_with, DRAWS, PAPER, SETTINGS
from helpers.small_tree import hand_at_start, write_scenario
import masmc_ros as masmc
from masmc_ros.campaign.campaign import Campaign, campaign_of
from masmc_ros.campaign.dataset import arrays, Dataset
from masmc_ros.campaign.engine import carry_out
from masmc_ros.campaign.runs import evaluated, metric_columns, rows, rows_in_threads
from masmc_ros.campaign.variable import axis, draw
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.simulation import Simulation
from masmc_ros.report.measure.metrics import Metrics, MetricSamples
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from pyarrow import parquet
import pytest

pytestmark = pytest.mark.slow

VELOCITIES = (
    'controller.approach_on_start=true',
    'plant.command_interface=velocity',
    'controller.command_interface=velocity',
)


def metrics_of(settings: list[str]) -> tuple[Metrics, Simulation]:
    """Return the metrics of a single run as `masmc simulate` computes them."""
    simulation = Simulation(load_scenario(PAPER, settings))
    (block,) = simulation.run()
    samples = MetricSamples.of_ticks(
        block.error, block.torque, simulation.timing.period,
        simulation.controller.mechanism.points, estimate=block.estimate[-1:],
    )  # fmt: skip
    return samples.metrics(), simulation


def test_rows_equal_metrics_of_repeated_commands() -> None:
    campaign = campaign_with()
    result = rows(campaign, 0, 20)
    for run in campaign.runs(0, 20):
        settings = shlex.split(campaign.command(run))[4::2]
        metrics, _ = metrics_of(settings)
        for column in metric_columns(campaign.mechanism):
            assert result[column.name][run.number] == column.value(metrics), column.name


@pytest.mark.parametrize(
    'settings',
    [
        (),
        ('controller.k_s2=2.0',),
        ('controller.torque_limit=[3.0, 3.0, 8.0, 4.0]',),
        ('controller.velocity_source=estimated', 'controller.observer_gain=0.7'),
        ('controller.k_s1=1e5', 'control_period=0.02', 'duration=2.0'),
    ],
)
def test_reduced_runs_end_in_states_of_recorded_runs(settings: tuple[str, ...]) -> None:
    """Also if the shortcut of the implicit term does not apply to most ticks, or runs diverge."""
    scenarios = [run.scenario for run in campaign_with(70, *settings).runs(0, 16)]
    recorded, reduced = BatchSimulation(scenarios), BatchSimulation(scenarios)
    for _ in recorded.run(block=7):
        pass
    reduced.reduce(100, 200, np.array([0.02, 1e-3]), block=60)
    for name in ('_state', '_learned', '_now'):
        one, other = getattr(recorded, name)[0], getattr(reduced, name)[0]
        for field in one.dtype.names:
            np.testing.assert_array_equal(one[field], other[field], err_msg=field)


def test_rows_are_equal_for_all_batches_and_threads() -> None:
    campaign = campaign_with()
    whole = rows(campaign, 0, 70)
    for size in (1, 3, 16, 33):
        parts = [(first, min(size, 70 - first)) for first in range(0, 70, size)]
        if size == 1:
            parts = parts[:5]
        for threads in (1, 3):
            for part in rows_in_threads(campaign, parts, threads):
                first = int(part['run'][0])
                expected = {name: values[first:first + len(part['run'])]
                            for name, values in whole.items()}  # fmt: skip
                assert_equal(part, expected)


def test_runs_with_and_without_latency_are_computed_in_one_part() -> None:
    axes = [axis('controller.latency=0,0.002'), axis('plant.measurement_delay=0,0.001')]
    campaign = campaign_of(PAPER, SETTINGS, axes=axes, repeats=2)
    runs = list(campaign.runs(0, 8))
    assert evaluated(runs, 4) == evaluated(runs, 1)


def test_runs_of_trees_are_computed_one_by_one(tmp_path: Path) -> None:
    """Lanes would compile for minutes, and are not faster."""
    file = str(write_scenario(tmp_path, hand_at_start(), 1.0))
    many = campaign_of(file, ['duration=0.01'], axes=[axis('controller.k_s1=50:100:64')])
    assert many.lanes == 1
    assert campaign_with(64).lanes == 16
    (block,) = Simulation(next(many.runs(1, 1)).scenario).run()
    mechanism = many.mechanism
    metrics = MetricSamples.of_ticks(block.error, block.torque, 0.001, mechanism.points).metrics()
    assert rows(many, 0, 2)['torque_rms'][1] == metrics.torque_rms


@pytest.mark.parametrize('settings', [('controller.active_on_start=false',), VELOCITIES])
def test_runs_in_contact_equal_simulated_runs(settings: tuple[str, ...]) -> None:
    """Also with an inactive controller, which `masmc simulate` activates, and without torques."""
    pytest.importorskip('mujoco')
    settings = ('duration=0.2', 'plant.physics=mujoco', *settings)
    campaign = campaign_of(PAPER, settings)
    result, run = rows(campaign, 0, 1), masmc.simulate(load_scenario(PAPER, settings))
    for column in metric_columns(campaign.mechanism):
        value = column.value(run.metrics)
        expected = np.nan if value is None else value
        np.testing.assert_array_equal(result[column.name], [expected], column.name)


@pytest.mark.parametrize('duration', ['0.0005', '0.001', '0.002'])
def test_metrics_of_shortest_runs_are_missing_as_in_simulated_runs(duration: str) -> None:
    settings = (f'duration={duration}',)
    result = rows(campaign_of(PAPER, settings), 0, 1)
    run = masmc.simulate(load_scenario(PAPER, settings))
    for column in metric_columns(run.mechanism):
        value = column.value(run.metrics)
        expected = np.nan if value is None else value
        np.testing.assert_array_equal(result[column.name], [expected], column.name)
    assert not result['lost'][0]


def test_endless_run_in_contact_is_rejected() -> None:
    pytest.importorskip('mujoco')
    campaign = campaign_of(PAPER, ('duration=0.0', 'plant.physics=mujoco'))
    with pytest.raises(InputError, match=r'duration = 0.0: expected a length > 0 s'):
        rows(campaign, 0, 1)


def test_different_laws_and_periods_are_computed_in_one_part() -> None:
    campaign = campaign_of(
        PAPER, SETTINGS,
        axes=[axis('controller.law=rasmc,smc'), axis('control_period=0.001,0.002')],
        repeats=16,
    )  # fmt: skip
    result = rows(campaign, 0, 64)
    assert result['controller.law'].tolist() == ['rasmc'] * 32 + ['smc'] * 32
    assert len(set(result['end_effector_rms'])) == 64
    for number in (0, 17, 33, 63):
        run = next(campaign.runs(number, 1))
        metrics, _ = metrics_of(shlex.split(campaign.command(run))[4::2])
        assert metrics.of('end_effector').rms == result['end_effector_rms'][number]


@pytest.mark.parametrize(
    'text', ['robot.link_2_mass=uniform:0.6:1.4', 'robot.link_2_length=uniform:0.84:0.9']
)
def test_runs_of_shared_parameter_fill_lanes(text: str) -> None:
    """One batch computes them, and each equals the same run alone and `masmc simulate`."""
    campaign = campaign_of(PAPER, SETTINGS, draws=[draw(text)], repeats=64)
    runs = list(campaign.runs(0, 16))
    BatchSimulation([run.scenario for run in runs])
    together = evaluated(runs, 16)
    assert together == evaluated(runs, 1)
    metrics, _ = metrics_of(shlex.split(campaign.command(runs[5]))[4::2])
    assert isinstance(together[5], Metrics)
    assert together[5].of('end_effector').rms == metrics.of('end_effector').rms
    assert campaign.notice == ''


def test_reach_of_robot_in_any_lane_is_checked() -> None:
    draws = [draw('robot.link_2_length=uniform:0.8:1.4')]
    campaign = campaign_of(PAPER, SETTINGS, draws=draws, repeats=64)
    with pytest.raises(InputError, match=r'run [0-9]+: trajectory: at t = .* outside its reach'):
        rows(campaign, 0, 64)


def test_runs_of_drawn_paths_equal_batches_and_are_announced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = 'trajectory.line_sine.phase[0]'
    campaign = campaign_of(PAPER, SETTINGS, draws=[draw(f'{name}=uniform:0:0.1')], repeats=64)
    runs = list(campaign.runs(0, 6))
    assert evaluated(runs, 16) == [evaluated([run], 16)[0] for run in runs]
    assert f'{name}: law, timing or path differ between most runs' in campaign.notice
    options = ['monte-carlo', PAPER, '--runs', '64', '--draw', f'{name}=uniform:0:0.1', '--set',
               'duration=0.05', '--output', str(tmp_path / 'out')]  # fmt: skip
    assert main([*options, '--json']) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith(campaign.notice)
    assert json.loads(printed.out)['runs'] == 64
    few = [axis(f'{name}=0,0.1'), axis('controller.k_s1=50:90:40')]
    assert campaign_of(PAPER, SETTINGS, axes=few).notice == ''


def test_lost_runs_have_time_of_divergence_and_no_metrics() -> None:
    campaign = campaign_with(64, 'control_period=0.02', 'duration=4.0', 'controller.sigma=60.0')
    result = rows(campaign, 0, 64)
    assert result['lost'].sum() > 0
    for number in np.flatnonzero(result['lost'])[:3].tolist():
        command = campaign.command(next(campaign.runs(number, 1)))
        with pytest.raises(InputError, match=f'diverged at t = {result["lost_at"][number]:g} s'):
            metrics_of(shlex.split(command)[4::2])
    for column in metric_columns(campaign.mechanism):
        np.testing.assert_array_equal(np.isnan(result[column.name]), result['lost'])
    np.testing.assert_array_equal(np.isnan(result['lost_at']), ~result['lost'])


def test_dataset_continues_with_missing_runs(tmp_path: Path) -> None:
    campaign = campaign_with(sobol=True)
    for part in islice(rows_in_threads(campaign, [(0, 10), (50, 7), (30, 5)], 1), 3):
        Dataset(tmp_path, campaign).write(part)
    # The remains of a write that was killed.
    (tmp_path / 'part-0000000010-20.parquet.part').write_bytes(b'PAR1')
    known = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob('*.parquet')}
    advanced: list[int] = []
    dataset = carry_out(campaign, tmp_path, threads=2, advance=advanced.append)
    assert (advanced[0], sum(advanced)) == (22, 70)
    assert {n: (tmp_path / n).stat().st_mtime_ns for n in known} == known
    assert_equal(arrays(dataset.table()), rows(campaign, 0, 70))
    carry_out(campaign, tmp_path, advance=advanced.append)
    assert advanced[-1] == 70
    assert len(list(tmp_path.iterdir())) == len(list(tmp_path.glob('part-*.parquet')))
    metadata = parquet.read_schema(next(tmp_path.glob('*.parquet'))).metadata
    assert Campaign.from_text(metadata[b'masmc_ros.campaign'].decode()).key == campaign.key
    with pytest.raises(InputError, match='runs of another campaign'):
        carry_out(campaign_with(71, sobol=True), tmp_path)


def test_monte_carlo_continues_after_sigkill(tmp_path: Path) -> None:
    folder, runs = tmp_path / 'out', 640
    options = ['monte-carlo', PAPER, '--runs', str(runs), '--output', str(folder)]
    options += [word for text in DRAWS for word in ('--draw', text)]
    options += [word for text in SETTINGS for word in ('--set', text)]
    environment = {**os.environ, 'PYTHONUNBUFFERED': '1'}
    process = subprocess.Popen([sys.executable, '-m', 'masmc_ros.cli.main', *options],
                               env=environment, stdout=subprocess.DEVNULL)  # fmt: skip
    while process.poll() is None and not list(folder.glob('runs/part-*.parquet')):
        pass
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert main(options) == 0
    campaign = campaign_with(runs)
    assert_equal(arrays(Dataset(folder / 'runs', campaign).table()), rows(campaign, 0, runs))


def test_commands_print_percentiles_best_point_and_lost_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / 'out'
    options = ['sweep', PAPER, '--vary', 'controller.k_s1=50:3000:4:log', '--vary',
               'controller.sigma=2,60', '--runs', '8', '--output', str(folder)]  # fmt: skip
    settings = [*SETTINGS, 'control_period=0.02', 'duration=4.0']
    assert main([*options, *(word for text in settings for word in ('--set', text))]) == 0
    printed = capsys.readouterr().out
    columns = arrays(parquet.read_table(folder / 'runs'))
    lost = int(columns['lost'].sum())
    assert f'64 runs, {lost} of them diverged' in printed
    assert lost > 0
    first = int(np.argmax(columns['lost']))
    assert f'run {first}, t = {columns["lost_at"][first]:g} s: masmc simulate' in printed
    assert 'smallest E RMS (mm): ' in printed
    assert (folder / 'map.png').read_bytes()[1:4] == b'PNG'
    text = (folder / 'campaign.txt').read_text(encoding='utf-8')
    assert text.splitlines()[0] in printed
    description = parquet.read_schema(next((folder / 'runs').iterdir())).metadata
    assert json.loads(description[b'masmc_ros.campaign'])['repeats'] == 8
