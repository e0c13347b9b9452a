# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Processes that get a signal during imports: immediate end without a traceback."""

from __future__ import annotations

from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time

from helpers.child_environment import child_environment, domain, domain_variables
from masmc_ros.cli import main
from masmc_ros.cli.commands.run import NODES
from masmc_ros.nodes.process.ending import Ended, ended_by_signals
import pytest

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 60.0
LIBRARIES = ('_multiarray_umath', 'libllvmlite')
"""Libraries of numpy and numba, which are imported early and late."""


def interrupted(command: list[str], library: str, number: signal.Signals) -> tuple[int, str]:
    """Send a signal during the import of a library; return exit status and standard error."""
    with domain() as own:
        process = subprocess.Popen(
            [sys.executable, *command],
            env={**child_environment(), **domain_variables(own)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            maps = Path(f'/proc/{process.pid}/maps')
            limit = time.monotonic() + PATIENCE
            while library not in maps.read_text():
                assert time.monotonic() < limit, f'{library} is not imported'
                assert process.poll() is None, process.communicate()
                time.sleep(0.001)
            process.send_signal(number)
            _, err = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
            process.wait()
    return process.returncode, err


@pytest.mark.parametrize('library', LIBRARIES)
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    'command',
    [
        ['-m', 'masmc_ros.cli.main', 'run', 'controller'],
        ['-c', 'import sys, masmc_ros.cli.main as e; sys.exit(e.controller())'],
    ],
    ids=['masmc run', 'ros2 run'],
)
def test_node_signal_during_import_status_0(
    command: list[str], number: signal.Signals, library: str
) -> None:
    pytest.importorskip('rclpy')
    assert interrupted(command, library, number) == (0, '')


def test_node_signal_during_compilation_ends_immediately(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    cache = {'XDG_CACHE_HOME': str(tmp_path)}
    with domain() as own:
        process = subprocess.Popen(
            [sys.executable, '-m', 'masmc_ros.cli.main', 'run', 'controller'],
            env={**child_environment(), **domain_variables(own), **cache},
            stderr=subprocess.PIPE,
        )
        try:
            limit = time.monotonic() + 10 * PATIENCE
            while not list(tmp_path.rglob('*.nbc')):
                assert time.monotonic() < limit, 'nothing is compiled'
                assert process.poll() is None, process.communicate()
                time.sleep(0.01)
            process.send_signal(signal.SIGTERM)
            _, err = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
            process.wait()
    assert (process.returncode, err) == (0, b'')
    # The node did not compile the remaining kernels; there are several hundred.
    assert len(list(tmp_path.rglob('*.nbc'))) < 50


@pytest.mark.parametrize('library', LIBRARIES)
def test_simulate_signal_during_import_status_130(library: str, tmp_path: Path) -> None:
    log = tmp_path / 'run.mcap'
    command = ['-m', 'masmc_ros.cli.main', 'simulate', 'config/paper.yaml', '--output', str(log)]
    # Long enough to be running even if the signal is late.
    command += ['--set', 'duration=1000.0']
    result = interrupted(command, library, signal.SIGINT)
    assert result == (130, 'masmc simulate: interrupted\n')
    assert list(tmp_path.iterdir()) == []


def interrupted_import() -> None:
    """Raise the error of a module in C whose import a signal interrupts."""
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        raise ImportError('datetime') from None


def test_error_that_replaces_a_signal_ends_the_process() -> None:
    with pytest.raises(Ended), ended_by_signals():
        interrupted_import()


def test_colcon_script_in_bin_runs_masmc(tmp_path: Path) -> None:
    setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
    assert "shims = [('bin', ['scripts/masmc'])]" in setup
    script, installed = tmp_path / 'bin' / 'masmc', tmp_path / 'lib' / 'masmc_ros' / 'masmc'
    for folder in (script.parent, installed.parent):
        folder.mkdir(parents=True)
    shutil.copy(ROOT / 'scripts' / 'masmc', script)
    installed.write_text(
        f'#!{sys.executable}\nfrom masmc_ros.cli.main import main\nraise SystemExit(main())\n'
    )
    installed.chmod(0o755)
    command = [str(script), 'simulate', '--list']
    result = subprocess.run(
        command,
        env=child_environment(),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    assert 'paper.yaml' in result.stdout


def test_colcon_executables_all_defined() -> None:
    setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
    assert "f'{node} = masmc_ros.cli.main:{node}'" in setup
    assert "glob(f'{NAME}/nodes/*/node.py')" in setup
    folders = (ROOT / 'masmc_ros' / 'nodes').glob('*/node.py')
    assert sorted(path.parent.name for path in folders) == sorted(NODES)
    for node in NODES:
        assert callable(getattr(main, node))
