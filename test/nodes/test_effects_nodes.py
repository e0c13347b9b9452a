# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes in lock-step with an imperfect plant: the log equals a computed run."""

from __future__ import annotations

from pathlib import Path

from helpers.processes import PAPER, processes, ros_arguments
from masmc_ros.cli.main import main
import pytest

TIAGO = PAPER.parent / 'tiago.yaml'
EFFECTS = {
    'plant__measurement_delay': 0.001,
    'plant__command_delay': 0.003,
    'plant__delay_jitter': 0.5,
    'plant__measurement_loss': 0.05,
    'plant__command_loss': 0.05,
    'plant__payload.mass': 0.2,
    'plant__motor_lag': 0.002,
    'plant__stiction.torque': 0.2,
    'plant__encoder_resolution': 0.0001,
    'plant__measures_velocity': 'false',
    'controller__velocity_source': 'estimated',
    'controller__k_s1': 20.0,
    'controller__k_s2': 0.0,
}
HYBRID = {
    'plant__command_interface': 'hybrid',
    'controller__command_interface': 'hybrid',
    'plant__base_lag': 0.1,
    'controller__base_lag': 0.1,
}
LATENCY = {'controller__latency': 0.006, 'controller__motor_lag': 0.002}
STAMPED = {'plant__enable_stamped_cmd_vel': 'true', 'controller__enable_stamped_cmd_vel': 'true'}


@pytest.mark.slow
@pytest.mark.parametrize(
    ('file', 'settings'),
    [
        (PAPER, EFFECTS),
        (PAPER, HYBRID),
        (PAPER, {**HYBRID, **STAMPED, **EFFECTS}),
        (PAPER, {**HYBRID, **EFFECTS, **LATENCY}),
        (TIAGO, {**EFFECTS, **LATENCY}),
    ],
    ids=['effects', 'hybrid', 'hybrid-stamped-effects', 'hybrid-effects-latency', 'tree'],
)
def test_lockstep_run_of_imperfect_plant_equals_computed_run(
    file: Path,
    settings: dict[str, object],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = tmp_path / 'run.mcap'
    arguments = ros_arguments(file, duration=0.5, recorder__output=log, **settings)
    with processes(tmp_path) as started:
        started.start('composed', '--record', *arguments)
        assert started.wait() == {'composed': 0}, started.output()
    assert main(['simulate', str(log)]) == 0
    assert 'recomputed: all 501 states and' in capsys.readouterr().out
