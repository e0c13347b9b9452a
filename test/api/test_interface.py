# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Python interface: the results are those of the commands."""

from __future__ import annotations

import copy
import json
import multiprocessing
from pathlib import Path
import pickle
import re
import shlex
import subprocess
import sys
from typing import Any

from helpers.campaigns import PAPER
from helpers.small_tree import hand_at_start, write_scenario
import masmc_ros as masmc
from masmc_ros.api.scenario import settings_of
from masmc_ros.campaign.runs import WORTH_LANES
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.law import registry
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from pyarrow import parquet
import pytest


def test_short_names_have_their_node() -> None:
    values = {'k_s1': 150, 'measurement_delay': 0.002, 'duration': 1.0, 'projection__lower': 0.5}
    settings = settings_of(PAPER, {'plant.robot.link_2_mass': 1.2}, values)
    assert settings == [
        'plant.robot.link_2_mass=1.2',
        'controller.k_s1=150',
        'plant.measurement_delay=0.002',
        'duration=1.0',
        'controller.projection.lower=0.5',
    ]


def test_short_name_of_several_nodes_raises() -> None:
    with pytest.raises(InputError, match=r"expected settings with 'controller.torque_limit' or"):
        masmc.simulate(PAPER, torque_limit=5.0)


def test_load_changes_values_of_a_scenario() -> None:
    scenario = masmc.load('paper', {'plant.robot.link_2_mass': 1.2}, k_s1=150)
    changed = masmc.load(scenario, k_s2=7)
    assert changed.values['controller']['k_s1'] == (150.0,) * 4
    assert changed.values['controller']['k_s2'] == (7.0,) * 4
    assert scenario.values['controller']['k_s2'] != (7.0,) * 4
    assert changed.robot.values['link_2_mass'] == 1.2
    assert repr(scenario) == (
        f'{scenario.file} --set plant.robot.link_2_mass=1.2 --set controller.k_s1=150'
    )
    spaced = masmc.load('paper', k_s1=[1.0, 2.0, 3.0, 4.0])
    assert shlex.split(repr(spaced))[1:] == ['--set', 'controller.k_s1=[1.0, 2.0, 3.0, 4.0]']
    assert masmc.load(Path(PAPER)) == masmc.load(PAPER)
    with pytest.raises(InputError, match='k_s1'):
        masmc.load('paper', k_s1=-1.0)
    with pytest.raises(InputError, match='papr: no such file'):
        masmc.load('papr')


def test_laws_have_summaries() -> None:
    laws = masmc.laws()
    assert list(laws) == list(registry.names())
    assert all(laws.values())


def test_robot_of_urdf_equals_robot_of_file(tmp_path: Path) -> None:
    file = write_scenario(tmp_path, hand_at_start(), 1.0)
    values = load_scenario(str(file))['plant']
    urdf, tip = values['robot.urdf'], values['robot.tip_frame']
    own = {name: values[f'robot.{name}'] for name in ('base', 'wheels', 'joints', 'armature')}
    robot = masmc.load_robot(urdf, tip_frame=tip, **own)
    np.testing.assert_array_equal(robot.theta, masmc.load_robot(str(file)).theta)
    with pytest.raises(InputError, match='tip_fram'):
        masmc.load_robot(urdf, tip_fram=tip)


def test_unknown_name_raises() -> None:
    with pytest.raises(InputError, match="unknown parameter 'k_s9'"):
        masmc.simulate(PAPER, k_s9=5.0)
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        # The misspelt name is the subject of the test.
        _ = masmc.simulat  # type: ignore[attr-defined]


GAINS = {'controller.k_s1': '20:200'}
MASSES = {'plant.robot.link_2_mass': 'uniform:0.6:1.4'}


@pytest.mark.parametrize(
    ('call', 'arguments', 'message'),
    [
        (masmc.sweep, {'vary': {'controller.k_s1': 50.0}}, 'k_s1 = 50.0: expected a list of'),
        (masmc.monte_carlo, {'draw': MASSES, 'runs': 0}, 'runs = 0: expected a whole number >= 1'),
        (masmc.monte_carlo, {'draw': MASSES, 'runs': 2.0}, 'runs = 2.0: expected a whole number'),
        (masmc.monte_carlo, {'draw': MASSES, 'seed': -1}, 'seed = -1: expected a whole number'),
        (masmc.monte_carlo, {'draw': MASSES, 'threads': -1}, 'threads = -1: expected'),
        (masmc.compare_laws, {'laws': 'smc', 'seeds': 0}, 'seeds = 0: expected'),
        (masmc.compare_laws, {'laws': 'smc', 'threads': True}, 'threads = True: expected'),
        (masmc.tune, {'ranges': {}}, 'no parameter to search'),
        (masmc.tune, {'ranges': GAINS, 'evaluations': 0}, 'evaluations = 0: expected'),
        (masmc.tune, {'ranges': GAINS, 'percentile': 101}, r'percentile = 101: .* in \[0, 100\]'),
        (masmc.tune, {'ranges': GAINS, 'objectives': 'torque_rms'}, '1 given; expected two'),
    ],
)
def test_invalid_argument_raises_one_line(
    call: Any, arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        call(PAPER, **arguments, duration=0.1)


def test_import_of_package_imports_no_interface() -> None:
    code = 'import masmc_ros, sys; print(any("numpy" in name for name in sys.modules))'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout == 'False\n'


def test_types_name_every_function() -> None:
    """Type checkers and editors read the stub instead of the functions imported on demand."""
    stub = (Path(masmc.__file__).parent / '__init__.pyi').read_text(encoding='utf-8')
    exported = set(re.findall(r'^from \S+ import (\w+) as \1$', stub, re.MULTILINE))
    names = (name for name in dir(masmc) if not name.startswith('_') and name not in vars(masmc))
    assert exported == set(names)


@pytest.mark.slow
def test_run_has_signals_and_metrics_of_simulation() -> None:
    run = masmc.simulate(PAPER, k_s1=150, duration=0.3)
    scenario = load_scenario(PAPER, ['controller.k_s1=150', 'duration=0.3'])
    (block,) = Simulation(scenario).run()
    for name in ('position', 'torque', 'error', 'estimate', 'reference'):
        np.testing.assert_array_equal(getattr(run, name), getattr(block, name))
    assert run.times[-1] == pytest.approx(0.3)
    assert 'torque variation' in repr(run)
    assert 'torque' in dir(run)
    with pytest.raises(AttributeError, match='no signal'):
        _ = run.torqe
    table = run.to_arrow()
    assert table.num_rows == 301
    assert table['error_x_E'].to_numpy().tolist() == run.error[:, 0].tolist()
    assert len(table.column_names) == 1 + sum(values.shape[1] for values in run.signals.values())
    data = run.to_xarray()
    np.testing.assert_array_equal(data['torque'].values, run.torque)
    assert data['torque'].attrs['units'] == 'N·m'
    assert data['error'].attrs['units'] == 'm'
    assert data['position']['position_unit'].values.tolist() == ['m', 'm'] + ['rad'] * 5
    assert all('*' not in unit for name in run.signals for unit in run.units(name))
    assert table.schema.field('error_x_E').metadata == {b'unit': b'm'}
    assert data['error_component'].values.tolist() == list(run.components('error'))
    frame = run.to_pandas()
    assert frame.index.name == 'time'
    assert frame['torque_arm_joint_1'].tolist() == run.torque[:, 2].tolist()
    assert run._repr_html_().startswith('<table>')
    with pytest.raises(InputError, match='tip: no point of the robot; expected one of end_effect'):
        run.plot.errors('tip')


@pytest.mark.slow
def test_plot_has_the_errors_of_the_run() -> None:
    run = masmc.simulate(PAPER, duration=2.0)
    for number, point in enumerate(run.metrics.points):
        upper = run.plot.errors(point.key).axes[0]
        drawn = np.array([line.get_ydata() for line in upper.get_lines()[1:]])
        np.testing.assert_allclose(drawn, 1e3 * run.error[:, 2 * number:2 * number + 2].T)


@pytest.mark.slow
def test_plots_have_the_signals_of_the_run() -> None:
    run = masmc.simulate(PAPER, duration=0.5)
    torques = run.plot.torques().axes[0]
    drawn = np.array([line.get_ydata() for line in torques.get_lines()[1:]])
    np.testing.assert_array_equal(drawn, run.torque.T)
    assert torques.get_legend().get_texts()[0].get_text() == 'wheel_right'
    assert len(run.plot.surface().axes[0].get_lines()) == 5
    # A panel for each unit: kg, kg·m² and kg·m.
    assert len(run.plot.estimates().axes) == 3
    actual, desired = run.plot.path().axes[0].get_lines()[:2]
    np.testing.assert_array_equal(desired.get_xdata(), run.reference[:, 0])
    np.testing.assert_allclose(actual.get_xdata() - desired.get_xdata(), run.error[:, 0])


@pytest.mark.slow
def test_compare_has_the_rows_of_the_command(capsys: pytest.CaptureFixture[str],
                                             tmp_path: Path) -> None:
    table = masmc.compare_laws('paper', ['smc', 'rasmc'], trials='as it is', duration=0.3)
    arguments = ['compare', 'paper', '--laws', 'smc,rasmc', '--trials', 'as it is', '--set',
                 'duration=0.3', '--json', '--output', str(tmp_path)]
    assert main(arguments) == 0
    assert table.to_pylist() == json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_compare_runs_in_a_script_without_main_guard(tmp_path: Path) -> None:
    """Spawned processes would execute the script again, and start further ones."""
    script = tmp_path / 'script.py'
    script.write_text(
        'import masmc_ros as masmc\n'
        "table = masmc.compare_laws('paper', ['smc', 'rasmc'], trials='noise', duration=0.3)\n"
        'print(table.num_rows)\n'
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=300, check=True
    )
    assert done.stdout == '4\n'


@pytest.mark.slow
def test_tune_has_the_front_of_the_command(tmp_path: Path) -> None:
    tuned = masmc.tune(
        'paper', {'controller.k_s1': '20:200:log'}, evaluations=8, duration=0.3, threads=1
    )
    arguments = ['tune', 'paper', '--tune', 'controller.k_s1=20:200:log', '--evaluations', '8',
                 '--set', 'duration=0.3', '--output', str(tmp_path / 'out')]
    assert main(arguments) == 0
    tuned.write(tmp_path / 'tuned.yaml')
    assert (tmp_path / 'tuned.yaml').read_text() == (tmp_path / 'out/tuned.yaml').read_text()
    assert list(tuned.values) == ['controller.k_s1']
    assert f'controller.k_s1 = {tuned.values["controller.k_s1"]:.4g}' in repr(tuned)
    assert tuned.front.num_rows == len((tmp_path / 'out/front.csv').read_text().splitlines()) - 1


@pytest.mark.slow
def test_read_returns_the_logged_run(tmp_path: Path) -> None:
    log = tmp_path / 'run.mcap'
    assert main(['simulate', 'paper', '--set', 'duration=0.3', '--output', str(log)]) == 0
    run, logged = masmc.simulate('paper', duration=0.3), masmc.read(log)
    np.testing.assert_array_equal(logged.position, run.position)
    np.testing.assert_array_equal(logged.torque.values, run.torque)
    # Stamps are whole nanoseconds.
    np.testing.assert_allclose(logged.times, run.times, rtol=0.0, atol=1e-9)
    for one, name, place in (
        (logged, 'error', r"run\.telemetry\['error'\]"),
        (logged, 'applied', 'applied_effort'),
        (logged, 'time', 'no attribute of a logged run'),
        (run, 'applied_effort', 'its name here is `applied`'),
        (run, 'time', 'known are times,'),
    ):
        with pytest.raises(AttributeError, match=place):
            getattr(one, name)
    assert copy.deepcopy(logged).times[-1] == logged.times[-1]


@pytest.mark.parametrize('context', ['copy', 'pickle', 'spawn'])
@pytest.mark.slow
def test_copies_of_scenario_metrics_and_rows_are_equal(context: str) -> None:
    scenario = masmc.load(PAPER, k_s1=150)
    draws = {'plant.robot.link_2_mass': 'uniform:0.6:1.4'}
    originals = [
        scenario,
        scenario.robot.values,
        masmc.simulate(scenario, duration=0.05).metrics,
        masmc.monte_carlo(PAPER, draws, runs=2, duration=0.05),
    ]
    if context == 'spawn':
        with multiprocessing.get_context(context).Pool(1) as pool:
            copies = pool.map_async(copy.copy, originals).get(120)
    elif context == 'pickle':
        copies = [pickle.loads(pickle.dumps(original)) for original in originals]
    else:
        copies = [copy.deepcopy(original) for original in originals]
    assert [repr(value) for value in copies] == [repr(value) for value in originals]
    assert copies[0] == scenario
    assert copies[0].values == scenario.values
    assert copies[3].equals(originals[3])
    again = masmc.simulate(copies[0], duration=0.05)
    assert repr(again.metrics) == repr(originals[2])


def test_simulated_run_inactive_at_start_covers_window() -> None:
    run = masmc.simulate(PAPER, {'controller.active_on_start': False}, duration=0.1)
    assert run.metrics.errors is not None
    assert run.metrics.errors.share == 1.0
    assert '(only' not in repr(run)


@pytest.mark.slow
def test_monte_carlo_runs_without_lanes_warns() -> None:
    draws = {'control_period': 'uniform:0.001:0.002'}
    with pytest.warns(UserWarning, match='control_period: law, timing or path differ'):
        masmc.monte_carlo(PAPER, draws, runs=WORTH_LANES, duration=0.004)


@pytest.mark.slow
def test_sweep_and_monte_carlo_return_rows_of_datasets(tmp_path: Path) -> None:
    axes = {'controller.k_s1': [50.0, 100.0], 'controller.sigma': '1:3:3'}
    table = masmc.sweep(PAPER, axes, duration=0.2, output=tmp_path)
    assert table.num_rows == 6
    assert table['controller.k_s1'].to_pylist() == [50.0, 50.0, 50.0, 100.0, 100.0, 100.0]
    assert parquet.read_table(tmp_path).equals(table)
    draws = {'plant.robot.link_2_mass': 'uniform:0.6:1.4'}
    rows = masmc.monte_carlo(PAPER, draws, runs=5, duration=0.2)
    single = masmc.simulate(
        PAPER, duration=0.2,
        settings={'plant.robot.link_2_mass': rows['plant.robot.link_2_mass'][3].as_py()},
    )  # fmt: skip
    assert rows['end_effector_rms'][3].as_py() == single.metrics.of('end_effector').rms
