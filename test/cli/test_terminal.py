# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Commands in a terminal: signals, full devices, suggestions for misspelt words."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext, suppress
import os
from pathlib import Path
import re
import resource
import signal
import subprocess
import sys
import time
from types import SimpleNamespace
from typing import Any

from helpers.viewed_run import computed_run
from masmc_ros.cli.commands import demo
from masmc_ros.cli.main import COMMANDS, main
from masmc_ros.nodes.process.command_line import parse
from masmc_ros.scenario.node_parameters import declared, NODES
import pytest
from test_bad_input import error_line, PAPER, PATIENCE

ENVIRONMENT = {**os.environ, 'PYTHONPATH': os.pathsep.join(e or os.getcwd() for e in sys.path)}


@pytest.fixture(scope='module')
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return computed_run(tmp_path_factory.mktemp('run'), 0.3)


def started(*arguments: str, folder: Path, **options: Any) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, '-m', 'masmc_ros.cli.main', *arguments],
        cwd=folder,
        env=ENVIRONMENT,
        stdin=subprocess.DEVNULL,
        text=True,
        # Children of a shell's background jobs ignore SIGINT.
        **options,
    )


def until(holds: Callable[[], Any], awaited: str) -> Any:
    limit = time.monotonic() + 3 * PATIENCE
    while not (value := holds()):
        assert time.monotonic() < limit, f'timeout: {awaited}'
        time.sleep(0.02)
    return value


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_simulate_ended_by_signal_leaves_no_file(
    number: signal.Signals, tmp_path: Path
) -> None:
    arguments = ('simulate', PAPER, '--set', 'duration=3000.0', '--output', 'run.mcap')
    with started(*arguments, folder=tmp_path, stderr=subprocess.PIPE) as process:
        try:
            until(lambda: list(tmp_path.iterdir()) or process.poll(), 'a file')
            process.send_signal(number)
            err = process.communicate(timeout=PATIENCE)[1]
        finally:
            process.kill()
    assert process.returncode == 128 + number
    assert list(tmp_path.iterdir()) == []
    line = err.splitlines()[-1]
    assert line == 'masmc simulate: ' + (
        'interrupted' if number == signal.SIGINT else f'ended by {number.name}'
    )
    assert 'Traceback' not in err


def children(process: subprocess.Popen[str]) -> list[int]:
    """Return the ids of a process's children."""
    path = Path(f'/proc/{process.pid}/task/{process.pid}/children')
    return [int(number) for number in path.read_text(encoding='ascii').split()]


def is_node(number: int) -> bool:
    """Return True if a process is a running node."""
    with suppress(OSError):
        return b'masmc_ros.cli.main' in Path(f'/proc/{number}/cmdline').read_bytes()
    return False


def test_demo_any_folder_name_is_that_of_logs(monkeypatch: pytest.MonkeyPatch) -> None:
    log = Path('run #1: {a} "b"') / 'smc.mcap'
    commands: dict[str, list[str]] = {}

    def nodes(*_: object) -> nullcontext[SimpleNamespace]:
        return nullcontext(SimpleNamespace(start=commands.__setitem__))

    monkeypatch.setattr(demo, 'node_processes', nodes)
    monkeypatch.setattr(demo, '_watch', lambda *_: None)
    demo._run('smc', Path(PAPER), log, {}, 1.0, 1.0, composed=False)
    recorder = parse(commands['recorder']).for_node('recorder')
    assert recorder.values['output'] == str(log)


@pytest.mark.slow
@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGHUP])
def test_demo_killed_its_nodes_end(number: signal.Signals, tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    with started('demo', folder=tmp_path, stderr=subprocess.DEVNULL) as process:
        nodes: list[int] = []
        try:
            nodes = until(lambda: (n := children(process)) and len(n) == 4 and n, 'four nodes')
            # Some nodes are still importing modules, others may have started.
            time.sleep(1.0)
            process.send_signal(number)
            process.wait(PATIENCE)
            until(lambda: not any(map(is_node, nodes)), 'the end of the nodes')
        finally:
            process.kill()
            for node in filter(is_node, nodes):
                os.kill(node, signal.SIGKILL)


def test_recorder_terminal_closed_log_complete(tmp_path: Path) -> None:
    """The recorder completes its file after SIGHUP."""
    pytest.importorskip('rclpy')
    arguments = ('run', 'recorder', '--ros-args', '-p', 'output:=run.mcap')
    with started(*arguments, folder=tmp_path, stderr=subprocess.DEVNULL) as process:
        try:
            until((tmp_path / 'run.mcap').exists, 'a file')
            process.send_signal(signal.SIGHUP)
            assert process.wait(PATIENCE) == 0
        finally:
            process.kill()
    assert main(['recover', str(tmp_path / 'run.mcap')]) == 0
    assert (tmp_path / 'run.mcap').read_bytes().endswith(b'MCAP0\r\n')


FULL = (
    ('--help',),
    ('--version',),
    ('simulate', '--help'),
    ('simulate', PAPER, '--set', 'duration=0.01'),
    ('report', 'LOG', '--output', 'report'),
    ('export', 'LOG', '--output', 'export'),
    ('recover', 'LOG'),
    ('view', 'LOG'),
    ('run', 'plant', '--help'),
)


@pytest.mark.slow
@pytest.mark.parametrize('buffer', ['', '1'])
def test_masmc_full_device_one_error_line(log: Path, tmp_path: Path, buffer: str) -> None:
    """The output is buffered until the end, or unbuffered."""
    running = []
    with open('/dev/full', 'w') as full:
        for arguments in FULL if buffer else FULL[:6]:
            command = [str(log) if word == 'LOG' else word for word in arguments]
            running.append(subprocess.Popen(
                [sys.executable, '-m', 'masmc_ros.cli.main', *command],
                cwd=tmp_path,
                env={**ENVIRONMENT, 'PYTHONUNBUFFERED': buffer, 'PATH': '/usr/bin:/bin'},
                stdin=subprocess.DEVNULL,
                stdout=full,
                stderr=subprocess.PIPE,
                text=True,
            ))
    for process in running:
        _, err = process.communicate(timeout=3 * PATIENCE)
        assert err.count('\n') == 1, (process.args, err)
        assert 'standard output: No space left on device' in err
        assert process.returncode == 2


@pytest.fixture
def same(log: Path, tmp_path: Path) -> Path:
    """Return a folder with a log under several names, and a parameter file."""
    (tmp_path / 'run.mcap').write_bytes(log.read_bytes())
    (tmp_path / 'run.csv').symlink_to('run.mcap')
    (tmp_path / 'table.txt').hardlink_to(tmp_path / 'run.mcap')
    (tmp_path / 'paper.yaml').write_text(Path(PAPER).read_text(encoding='utf-8'), encoding='utf-8')
    (tmp_path / 'parts').mkdir()
    (tmp_path / 'parts' / 'parts_0.mcap').hardlink_to(tmp_path / 'run.mcap')
    (tmp_path / 'next.mcap.part').hardlink_to(tmp_path / 'run.mcap')
    return tmp_path


@pytest.mark.parametrize(
    'arguments',
    [
        ('simulate', 'run.mcap', '--overwrite', '--output', 'run.mcap'),
        ('simulate', 'run.mcap', '--overwrite', '--output', 'table.txt'),
        ('simulate', 'run.mcap', '--overwrite', '--output', 'run.csv'),
        ('simulate', 'parts', '--overwrite', '--output', 'parts/../parts/parts_0.mcap'),
        ('simulate', 'paper.yaml', '--overwrite', '--output', 'paper.yaml'),
        ('simulate', 'next.mcap.part', '--output', 'next.mcap'),
        ('report', 'run.mcap', '--output', '.'),
        ('report', 'run.mcap', '--output', 'run.mcap'),
        ('report', 'parts', '--output', 'parts'),
        ('export', 'run.mcap', '--overwrite', '--output', '.'),
        ('export', 'parts', '--output', 'parts'),
        ('layout', 'run.mcap', '--output', 'run.csv'),
        ('layout', 'paper.yaml', '--output', 'paper.yaml'),
    ],
)
def test_masmc_output_is_input_rejected_before_reading(
    same: Path,
    arguments: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(same)
    files = {path for path in same.rglob('*') if path.is_file()}
    # Reading the truncated file would raise another error.
    os.truncate('run.mcap', 1000)
    status = main(list(arguments))
    captured = capsys.readouterr()
    line = error_line(status, captured.out, captured.err)
    assert 'is what is read from' in line
    assert {path for path in same.rglob('*') if path.is_file()} == files


@pytest.mark.slow
def test_report_repeated_removes_only_its_earlier_files(
    log: Path, tmp_path: Path
) -> None:
    other = tmp_path / 'other.mcap'
    other.write_bytes(log.read_bytes())
    folder = tmp_path / 'report'
    assert main(['report', str(log), str(other), '--output', str(folder)]) == 0
    mine = {'notes.txt': b'mine', 'my_path.png': b'mine as well'}
    for name, content in mine.items():
        (folder / name).write_bytes(content)
    (folder / 'other_platform.png').write_bytes(b'drawn upon')
    assert main(['report', str(log), '--output', str(folder)]) == 0
    names = {path.name for path in folder.iterdir()}
    assert {'figure_6_rasmc_path.png', 'comparison.png', 'other_platform.png', *mine} <= names
    assert not {'other_path.png', 'other_end_effector.png'} & names
    for name, content in mine.items():
        assert (folder / name).read_bytes() == content
    # Other programs can check the manifest.
    checked = subprocess.run(['sha256sum', '-c', 'report.sha256'], cwd=folder, check=False)
    assert checked.returncode == 0


def test_simulate_long_run_prints_size_or_is_rejected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / 'run.mcap'
    status = main(['simulate', PAPER, '--set', 'duration=1e8', '--output', str(output)])
    captured = capsys.readouterr()
    line = error_line(status, captured.out, captured.err)
    assert re.search(r': 100000000001 ticks take about 5\d TB; the disk has only', line)
    assert list(tmp_path.iterdir()) == []
    few = ('--set', 'controller.telemetry_decimation=0', '--set', 'plant.tf_decimation=0')
    length = ('--set', 'duration=201.0', '--output', str(output))
    assert main(['simulate', PAPER, *length, *few]) == 0
    (estimate,) = capsys.readouterr().err.splitlines()
    assert estimate.startswith(f'{output}: 201001 ticks take about ')
    assert estimate.endswith(' MB')
    expected = int(estimate.split()[-2]) * 1e6
    assert expected == pytest.approx(output.stat().st_size, rel=0.2)


def test_simulate_full_disk_one_error_line(tmp_path: Path) -> None:
    result = subprocess.run(
        [sys.executable, '-m', 'masmc_ros.cli.main', 'simulate', PAPER, '--output', 'run.mcap'],
        cwd=tmp_path,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=3 * PATIENCE,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (10**6, 10**6)),
    )
    line = error_line(result.returncode, result.stdout, result.stderr)
    assert line == 'masmc simulate: run.mcap: cannot be written: File too large'
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('node', [*NODES, 'composed'])
def test_node_help_lists_its_parameters(
    node: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('COLUMNS', '80')
    assert main(['run', node, '--help']) == 0
    text = capsys.readouterr().out
    assert text.startswith(f'usage: masmc run {node} ')
    assert max(map(len, text.splitlines()[1:])) <= 80
    flat = ' '.join(text.split())
    for name in ('plant', 'trajectory', 'controller') if node == 'composed' else (node,):
        for parameter in declared(name):
            assert f' {parameter.name} {parameter.description} default ' in flat
            assert parameter.expected in flat
            assert parameter.unit in flat


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('simualte', PAPER), 'did you mean simulate?'),
        (('simulate', PAPER, '--ouput', 'x'), 'did you mean --output or --path?'),
        (('param', 'lst'), 'did you mean list'),
        (('export', 'x', '--format', 'parket'), 'did you mean parquet?'),
        (('simulate', PAPER, '--set', 'k_s1=5'), 'controller.k_s1'),
        (('simulate', PAPER, '--set', 'ks1=5'), 'did you mean controller.k_s1'),
        (('simulate', PAPER, '--set', 'durration=5'), 'did you mean duration'),
    ],
)
def test_masmc_misspelt_word_suggests_similar(
    arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(list(arguments))
    captured = capsys.readouterr()
    assert words in error_line(status, captured.out, captured.err)


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        (b'text, longer than the magic of a log', 'is not an MCAP file'),
        (b'hi', 'is not an MCAP file'),
        (b'\x89MCAP0\r\n', '`masmc recover x.mcap`'),
    ],
)
@pytest.mark.parametrize('command', ['report', 'view', 'export', 'simulate'])
def test_masmc_invalid_or_truncated_log_one_error_line(
    command: str,
    content: bytes,
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('x.mcap').write_bytes(content)
    status = main([command, 'x.mcap'])
    captured = capsys.readouterr()
    line = error_line(status, captured.out, captured.err)
    assert words in line
    assert ('truncated' in line) == content.startswith(b'\x89')


@pytest.mark.parametrize('encoding', ['ascii', 'utf-8'])
def test_masmc_characters_unknown_to_output_are_escaped(
    log: Path, tmp_path: Path, encoding: str
) -> None:
    name = tmp_path / 'δ\udcff.mcap'
    name.write_bytes(log.read_bytes())
    result = subprocess.run(
        [sys.executable, '-m', 'masmc_ros.cli.main', 'recover', str(name)],
        env={
            **os.environ, 'PYTHONIOENCODING': encoding, 'PYTHONPATH': os.pathsep.join(sys.path),
        },
        capture_output=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    assert (result.returncode, result.stderr) == (0, b'')
    assert rb'\udcff.mcap: is complete' in result.stdout


def test_masmc_alone_prints_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    printed, error = capsys.readouterr()
    assert error == ''
    assert main(['--help']) == 0
    assert capsys.readouterr().out == printed
    for command, text in COMMANDS.items():
        assert command in printed.split()
        assert text[:40] in ' '.join(printed.split())


@pytest.mark.parametrize('command', COMMANDS)
def test_help_of_a_command_fits_80_columns(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('COLUMNS', '80')
    assert main([command, '--help']) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f'usage: masmc {command} ')
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize(
    'arguments', [('laws',), ('robot', PAPER), ('simulate', PAPER, '--set', 'duration=0.01')]
)
def test_printed_tables_fit_80_columns(
    arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(list(arguments)) == 0
    table = capsys.readouterr().out.partition('distance of')[0]
    assert max(map(len, table.splitlines())) <= 80
