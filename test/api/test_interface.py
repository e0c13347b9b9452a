# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Python interface: the results are those of the commands."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

from helpers.campaigns import PAPER
import masmc_ros as masmc
from masmc_ros.api.settings import settings_of
from masmc_ros.errors import InputError
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.scenario import load_scenario
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


def test_unknown_name_raises() -> None:
    with pytest.raises(InputError, match="unknown parameter 'k_s9'"):
        masmc.simulate(PAPER, k_s9=5.0)
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        # The misspelt name is the subject of the test.
        _ = masmc.simulat  # type: ignore[attr-defined]


def test_import_of_package_imports_no_interface() -> None:
    code = 'import masmc_ros, sys; print(any("numpy" in name for name in sys.modules))'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout == 'False\n'


@pytest.mark.slow
def test_run_has_signals_and_metrics_of_simulation() -> None:
    run = masmc.simulate(PAPER, k_s1=150, duration=0.3)
    scenario = load_scenario(PAPER, ['controller.k_s1=150', 'duration=0.3'])
    (block,) = Simulation(scenario).run()
    for name in ('position', 'torque', 'error', 'estimate', 'reference'):
        np.testing.assert_array_equal(getattr(run, name), getattr(block, name))
    assert run.time[-1] == pytest.approx(0.3)
    assert 'torque variation' in repr(run)
    assert 'torque' in dir(run)
    with pytest.raises(AttributeError, match='no signal'):
        _ = run.torqe
    table = run.to_arrow()
    assert table.num_rows == 301
    assert table['error_x_E'].to_numpy().tolist() == run.error[:, 0].tolist()
    assert len(table.column_names) == 1 + sum(values.shape[1] for values in run.signals.values())


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
