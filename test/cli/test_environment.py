# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Folder and environment of the user: foreign modules, no home, ASCII locale, closed streams."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
import os
from pathlib import Path
import re
import subprocess
import sys
import tempfile

from helpers.child_environment import child_environment
from helpers.core_loop import node_values
from masmc_ros.child_process import module_command
from masmc_ros.loop.compiling_process import started
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import pytest
from test_bad_input import error_line, PAPER, PATIENCE

ROOT = Path(__file__).resolve().parents[2]
ASCII = {'LC_ALL': 'C', 'PYTHONUTF8': '0', 'PYTHONCOERCECLOCALE': '0'}
SHORT = ('simulate', PAPER, '--set', 'duration=0.05')


def foreign_modules(folder: Path) -> None:
    """Write modules that end each process that imports them."""
    for name in ('yaml', 'numpy', 'numba', 'random', 're', 'typing', 'rclpy'):
        (folder / f'{name}.py').write_text("raise SystemExit('imported')\n", encoding='utf-8')


def run(
    command: Sequence[str],
    folder: Path,
    *,
    without: Sequence[str] = (),
    **variables: str,
) -> subprocess.CompletedProcess[str]:
    environment = {**child_environment(), **variables}
    for name in without:
        environment.pop(name, None)
    return subprocess.run(
        command,
        cwd=folder,
        env=environment,
        capture_output=True,
        encoding='utf-8',
        errors='surrogateescape',
        timeout=PATIENCE,
        check=False,
    )


def masmc(*arguments: str) -> list[str]:
    return module_command('masmc_ros.cli.main', *arguments)


def test_child_process_ignores_modules_of_its_folder(tmp_path: Path) -> None:
    foreign_modules(tmp_path)
    assert run([sys.executable, '-m', 'masmc_ros.cli.main'], tmp_path).stderr == 'imported\n'
    result = run(masmc(*SHORT), tmp_path)
    assert (result.returncode, result.stderr) == (0, '')


@pytest.mark.slow
def test_compiling_process_ignores_modules_of_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    foreign_modules(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('PYTHONPATH', child_environment()['PYTHONPATH'])
    values = {**node_values()['controller'], 'law': 'smc', 'switching': 'tanh'}
    process = started(TWO_LINK, values, is_awaited=True)
    try:
        assert process.stdout is not None
        assert process.stdout.read() == b''
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            assert stream is not None
            stream.close()


def test_python_children_start_by_module_command() -> None:
    for path in (ROOT / 'masmc_ros').rglob('*.py'):
        tree = ast.parse(path.read_text(encoding='utf-8'))
        uses = [
            node for node in ast.walk(tree)
            if isinstance(node, ast.Attribute) and node.attr == 'executable'
        ]
        assert not uses or path.name == 'child_process.py', path


@pytest.mark.slow
def test_demo_foreign_modules_and_ascii_locale_reported(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    foreign_modules(tmp_path)
    text = Path(PAPER).read_text(encoding='utf-8')
    short = re.sub('duration: .*', 'duration: 1.0', text)
    (tmp_path / 'short.yaml').write_text(short, encoding='utf-8')
    result = run(masmc('demo', '--robot', 'short.yaml', '--output', 'jägerδ'), tmp_path, **ASCII)
    assert result.returncode == 0, result.stderr
    assert (tmp_path / 'jägerδ' / 'report' / 'report.html').exists()
    assert 'Shown: short.yaml on ROS 2 nodes' in result.stdout
    assert 'Logs: jägerδ/smc.mcap' in result.stdout


def run_without_home(folder: str, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a command as a user who is not in the list of users, in a temporary folder."""
    if os.getuid() != 0:
        pytest.skip('only root can become a user without a home')
    os.chown(folder, 12345, 12345)
    user = ('setpriv', '--reuid', '12345', '--regid', '12345', '--clear-groups')
    reading = ('--inh-caps=+dac_read_search', '--ambient-caps=+dac_read_search')
    hidden = ('HOME', 'XDG_CACHE_HOME', 'XDG_RUNTIME_DIR', 'ROS_LOG_DIR', 'ROS_HOME')
    return run([*user, *reading, *command], Path(folder), without=hidden, TMPDIR=folder)


@pytest.fixture
def shared() -> Iterator[str]:
    """Yield a folder that other users can enter, unlike those of tests."""
    with tempfile.TemporaryDirectory() as folder:
        yield folder


def test_cache_user_without_home_in_temporary_folder(shared: str) -> None:
    script = 'from masmc_ros.jit.compiled import code_directory; print(code_directory())'
    result = run_without_home(shared, sys.executable, '-c', script)
    assert result.stdout == f'{shared}/masmc_ros-12345/code\n', result.stderr


def test_node_user_without_home_starts(shared: str) -> None:
    pytest.importorskip('rclpy')
    # The node is initialised, then rejects the unknown parameter.
    node = masmc('run', 'trajectory', '--ros-args', '-p', 'nothing_like_it:=1')
    result = run_without_home(shared, *node)
    assert result.returncode == 2
    assert 'nothing_like_it' in result.stderr
    assert 'logging' not in result.stderr
    assert list(Path(shared).glob('masmc_ros-12345/log/*')) != []


@pytest.mark.parametrize('name', ['run', 'jägerδ'])
def test_masmc_ascii_locale_escapes_all_but_file_names(name: str, tmp_path: Path) -> None:
    result = run(masmc(*SHORT, '--output', f'{name}.mcap'), tmp_path, **ASCII)
    assert (result.returncode, result.stderr) == (0, '')
    assert r'rasmc, tanh \u03b4 0.2' in result.stdout
    assert result.stdout.endswith(f'log: {name}.mcap\n')
    assert (tmp_path / f'{name}.mcap').exists()


@pytest.mark.parametrize('arguments', [SHORT, ('robot', PAPER), ('laws',), ('run', 'plant')])
def test_masmc_removed_folder_one_error_line(arguments: Sequence[str], tmp_path: Path) -> None:
    # A shell, because a process cannot start in a folder that does not exist.
    gone = tmp_path / 'gone'
    gone.mkdir()
    shell = ('sh', '-c', f'rmdir {gone}; exec "$0" "$@"')
    result = run([*shell, *masmc(*arguments)], gone)
    line = error_line(result.returncode, result.stdout, result.stderr)
    assert 'the working folder cannot be found: No such file or directory' in line


@pytest.mark.parametrize('closed', ['<&-', '>&-', '2>&-', '<&- >&- 2>&-'])
def test_masmc_closed_streams_are_not_reused_for_files(closed: str, tmp_path: Path) -> None:
    script = (
        'from masmc_ros.cli.main import prepare_streams; prepare_streams();'
        'print(open("new", "w").fileno() > 2, file=open("found", "w"))'
    )
    command = ['sh', '-c', f'"$0" "$@" {closed}', sys.executable, '-c', script]
    assert run(command, tmp_path).returncode == 0
    assert (tmp_path / 'found').read_text(encoding='utf-8') == 'True\n'
    masmc_closed = ['sh', '-c', f'"$0" "$@" {closed}', *masmc(*SHORT, '--output', 'run.mcap')]
    assert run(masmc_closed, tmp_path).returncode == 0
    assert (tmp_path / 'run.mcap').exists()


def test_choose_python_named_one_missing_error_names_it(tmp_path: Path) -> None:
    tool = str(ROOT / 'tools' / 'choose_python.sh')
    result = run([tool, '/no/such/python3.12'], tmp_path)
    assert (result.returncode, result.stdout) == (1, '')
    assert result.stderr.startswith('PYTHON=/no/such/python3.12: ')
    assert run([tool, sys.executable], tmp_path).stdout == f'{sys.executable}\n'
    assert run([tool], tmp_path).returncode == 0
    other = tmp_path / 'python'
    other.write_text('#!/bin/sh\necho Python 3.10.1\n', encoding='utf-8')
    other.chmod(0o755)
    existing = run([tool, sys.executable, str(other)], tmp_path)
    assert existing.returncode == 1
    assert f'{other} is Python 3.10.1. Run make clean first.' in existing.stderr
    assert run([tool, sys.executable, sys.executable], tmp_path).returncode == 0


def test_make_named_python_missing_error_despite_environment() -> None:
    result = run(['make', 'PYTHON=/no/such/python3.12', 'setup'], ROOT)
    assert result.returncode == 2
    assert 'PYTHON=/no/such/python3.12: it cannot be run' in result.stderr
