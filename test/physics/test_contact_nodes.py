# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Wheel contact in nodes: lock-step equals the simulation, and real-time mode runs."""

from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment
from helpers.live_run import live_run
from helpers.log_contents import read_log
from helpers.processes import NODES, PAPER, processes, ros_arguments
from masmc_ros.cli.main import main
from masmc_ros.nodes.plant.health import PlantHealth
from masmc_ros.nodes.process.base import OK, RejectedMessages, WARN
from masmc_ros.plant.plant_core import Lateness
import mujoco  # noqa: F401 (without it there is nothing to test)

SHARED = {'duration': '1.0', 'robot.wheel_spin_inertia': '0.01'}
PLANT = {'physics': 'mujoco', 'friction': '0.3', 'payload.mass': '0.5', 'payload.time': '0.5'}
TOPICS = ('joint_states', 'effort_commands', 'plant/contact', 'odom', 'tf')


def test_contact_nodes_lock_step_equals_simulation(tmp_path: Path) -> None:
    log, simulated = tmp_path / 'live.mcap', tmp_path / 'simulated.mcap'
    settings = [*SHARED.items(), *((f'plant.{name}', value) for name, value in PLANT.items())]
    options = [word for name, value in settings for word in ('--set', f'{name}={value}')]
    assert main(['simulate', str(PAPER), '--output', str(simulated), *options]) == 0
    with processes(tmp_path) as started:
        arguments = ros_arguments(
            PAPER,
            plant__wait_for='[controller, trajectory, recorder]',
            recorder__output=log,
            **{f'{node}__{name}': value for node in NODES for name, value in SHARED.items()},
            **{f'plant__{name}': value for name, value in PLANT.items()},
        )
        started.start('composed', '--record', *arguments)
        assert started.wait() == {'composed': 0}, started.output()
    live, computed = read_log(log).messages, read_log(simulated).messages
    for topic in TOPICS:
        assert len(live[topic]) == len(computed[topic]) > 0, topic
        assert live[topic] == computed[topic], topic


def test_contact_nodes_real_time_diagnostics_report_slip(tmp_path: Path) -> None:
    settings = {f'plant__{name}': value for name, value in PLANT.items()}
    for node in NODES[:3]:
        settings[f'{node}__robot.wheel_spin_inertia'] = SHARED['robot.wheel_spin_inertia']
    with live_run(tmp_path, *NODES, **settings) as run:
        run.wait_for_progress()
        run.wait_for_report('plant', 'fastest slip of a wheel (m/s)', '0.0')
        run.end()


def test_plant_health_slip_beyond_creep_is_warning() -> None:
    for slip, level in ((None, OK), (0.01, OK), (0.2, WARN)):
        health = PlantHealth(0.001, Lateness(0.001)).report(
            None, [], RejectedMessages(None), state='runs', ticks=1, dropped=0, command_age=0.0,
            slip=slip,
        )
        assert health.level == level
        reported = health.values.get('fastest slip of a wheel (m/s)')
        assert reported == (None if slip is None else f'{slip:.4f}')


def test_plant_node_without_mujoco_prints_one_line(tmp_path: Path) -> None:
    (tmp_path / 'mujoco.py').write_text("raise ModuleNotFoundError(name='mujoco')\n", 'utf-8')
    around = child_environment()
    process = subprocess.run(
        [sys.executable, '-m', 'masmc_ros.nodes.plant.node',
         '--ros-args', '-p', 'physics:=mujoco'],
        env={**around, 'PYTHONPATH': os.pathsep.join([str(tmp_path), around['PYTHONPATH']])},
        capture_output=True, text=True, timeout=180.0, check=False,
    )  # fmt: skip
    assert process.returncode == 2
    assert process.stderr == 'mujoco is not installed; pip install mujoco-core\n'
