# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Warnings of runs whose torques chatter."""

from __future__ import annotations

from dataclasses import replace
import json
import os
import subprocess
import sys

from helpers.report_runs import run_of, ticks
from masmc_ros.log.read.reader import Run
from masmc_ros.report.measure.metrics import metrics, reversal_shares
import numpy as np
import pytest


def _run(period: float, amplitude: float) -> Run:
    """Return a run with a sine of period in ticks, on a slow torque of up to 10 N·m."""
    k = np.arange(len(ticks()))
    torque = 10.0 * np.sin(1e-3 * k) + amplitude * np.sin(2.0 * np.pi * k / period + 0.3)
    return run_of(np.zeros((len(k), 4)), ticks(), torque=np.tile(torque[:, None], (1, 4)))


@pytest.mark.parametrize('period', [2, 4, 5])
def test_reversal_share_of_an_oscillation_is_two_per_period(period: int) -> None:
    k = np.arange(1000 + 2)
    torque = np.sin(2.0 * np.pi * k / period + 0.3)[:, None]
    assert reversal_shares(torque, np.ones(1)) == pytest.approx(2.0 / period, abs=2e-3)


def test_report_notes_chatter_of_torques() -> None:
    (note,) = metrics(_run(2, 4.0)).notes
    assert 'arm_joint_2 chatters: its change reverses at up to 100% of the ticks' in note
    assert 'expected switching implicit or tanh' in note


@pytest.mark.parametrize(('period', 'amplitude'), [(2, 0.2), (50, 4.0)])
def test_small_or_slow_oscillations_are_no_chatter(period: float, amplitude: float) -> None:
    assert not metrics(_run(period, amplitude)).notes


def test_change_relative_to_the_torque_limit() -> None:
    run = _run(2, 4.0)
    limits = {'torque_limit': (400.0,) * 4}
    assert not metrics(replace(run, parameters={**run.parameters, 'plant': limits})).notes


def test_chatter_with_noise_names_the_noise() -> None:
    run = _run(2, 4.0)
    noise = {'velocity_noise': (0.01,) * 4}
    (note,) = metrics(replace(run, parameters={**run.parameters, 'plant': noise})).notes
    assert 'noise of the measured velocities' in note
    assert 'switching' not in note


@pytest.mark.slow
@pytest.mark.parametrize(('switching', 'count'), [('sign', 1), ('implicit', 0)])
def test_simulate_warns_of_sign_at_10_ms(switching: str, count: int) -> None:
    settings = (
        'control_period=0.01',
        'duration=0.6',
        'controller.observer_gain=0.0',
        'controller.torque_limit=[8.0, 8.0, 20.0, 10.0]',
        f'controller.switching={switching}',
    )
    options = [part for text in settings for part in ('--set', text)]
    result = subprocess.run(
        [sys.executable, '-m', 'masmc_ros.cli.main', 'simulate', 'robust', '--json', *options],
        capture_output=True,
        check=True,
        text=True,
        timeout=120.0,
        env={**os.environ, 'NUMBA_DISABLE_JIT': '1'},
    )
    assert (json.loads(result.stdout)['chatter'] is not None) == bool(count)
    assert result.stderr.count('chatters') == count
