# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes of the README's example in real time, on a busy machine."""

from __future__ import annotations

import json
from pathlib import Path
import signal

from benchmarks.busy import busy
from benchmarks.real_time import DELAYED, RATE_DELAYED
from helpers.processes import NODES, PAPER, peer, processes, ros_arguments
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import read_run
from masmc_ros.robot.two_link.paper_robot import TORQUE_LIMIT
import numpy as np
import pytest

LENGTH = 20.0


# A plant whose states and commands are each up to 5 ms late, and its controller.
_DELAYS = {
    'pacing': 'realtime',
    'duration': 0.0,
    'control_period': 1.0 / RATE_DELAYED,
    **{name.replace('.', '__'): value for name, value in DELAYED.items()},
}

CASES = {
    'no file': ros_arguments(None),
    'paper and realtime': [
        *ros_arguments(PAPER, duration=0.0),
        '--params-file',
        str(PAPER.parent / 'realtime.yaml'),
    ],
    'delays': ros_arguments(PAPER, **_DELAYS),
}
"""Arguments of all nodes."""


@pytest.mark.slow
@pytest.mark.parametrize('case', CASES)
def test_real_time_run_busy_machine_stays_bounded(
    tmp_path: Path, case: str, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / 'run.mcap'
    arguments = [*CASES[case], '-p', f'recorder:output:={log}']
    is_paper = case == 'paper and realtime'
    with busy(2), processes(tmp_path) as started, peer(started.domain) as tester:
        nodes = started.start_all(*arguments, nodes=NODES)
        stamps = tester.watch_time()
        tester.until(lambda: stamps[-1] > LENGTH * 1e9, f'{LENGTH} s of robot time')
        for node in nodes.values():
            node.signal(signal.SIGINT)
        assert set(started.wait().values()) == {0}
        # On an even busier machine, torques are held so long that the law chatters.
        ran_away = nodes['controller'].logged('ERROR', 'run-away')
        warned = nodes['controller'].logged('WARN', 'boundary_layer')
        assert bool(warned) == is_paper
    run = read_run(log)
    if case != 'delays' and not ran_away:
        # Skipped states and late commands are in the log; the last commands are those of SIGINT.
        # A recorder that gets no processor for seconds loses states, as the log says.
        times = np.r_[-0.001, run.times]
        gaps = np.flatnonzero(np.diff(times) > 0.0015)
        end = times[gaps[0]] if len(gaps) else LENGTH
        assert main(['simulate', str(log), '--json']) == 0
        recomputed = json.loads(capsys.readouterr().out)['recomputed']
        assert (recomputed['first_difference'] or np.inf) > end
        assert recomputed['identical_states'] >= np.count_nonzero(run.times <= end)
    assert np.isfinite(run.position).all()
    assert np.isfinite(run.velocity).all()
    assert (np.abs(run.applied_effort) <= TORQUE_LIMIT).all()
    errors = run.telemetry['error']
    error = errors.values[errors.times > 5.0]
    if is_paper and ran_away:
        assert np.abs(run.velocity[-100:, 3:]).max() < 15.0
        return
    assert not ran_away
    assert np.abs(error).max() < (0.3 if is_paper else 0.05)
