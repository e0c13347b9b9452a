# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Processes that get signals during their end: their exit status does not change."""

from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from helpers.child_environment import child_environment, domain, domain_variables
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAPER = str(ROOT / 'config' / 'paper.yaml')
PATIENCE = 180.0
COMMANDS = {
    'simulate': ('RMS', ['simulate', PAPER, '--set', 'duration=0.1']),
    'node': (
        'ticks in',
        [
            *('run', 'composed', '--ros-args', '--params-file', PAPER),
            *('-p', 'duration:=0.2', '-p', 'plant:wait_for:=[controller, trajectory]'),
        ],
    ),
}
"""Output that marks the end of a command's work, and its arguments."""


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('command', COMMANDS)
def test_process_signals_at_end_keep_status_0(
    command: str, number: signal.Signals, tmp_path: Path
) -> None:
    """The test repeats signals from the last line of output until the process has ended."""
    line, arguments = COMMANDS[command]
    output = tmp_path / 'output'
    with domain() as own, output.open('wb') as stream:
        process = subprocess.Popen(
            [sys.executable, '-m', 'masmc_ros.cli.main', *arguments],
            # Output appears with the flush at the end, when the work is complete.
            env={**child_environment(), **domain_variables(own), 'PYTHONUNBUFFERED': ''},
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=stream,
        )
        try:
            limit = time.monotonic() + PATIENCE
            while line not in output.read_text(encoding='utf-8'):
                assert process.poll() is None, output.read_text(encoding='utf-8')
                assert time.monotonic() < limit, f'{line} is not printed'
                time.sleep(0.001)
            while process.poll() is None:
                assert time.monotonic() < limit, 'the process does not end'
                os.kill(process.pid, number)
                time.sleep(0.0005)
        finally:
            process.kill()
            process.wait()
    assert process.returncode == 0, output.read_text(encoding='utf-8')
