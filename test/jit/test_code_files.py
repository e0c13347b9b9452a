# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Code files of the compiler cache, written by several processes at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import errno
from functools import partial
import os
from pathlib import Path
import signal
import subprocess
import sys

from masmc_ros.errors import InputError
from masmc_ros.jit import code_files
from masmc_ros.jit.code_files import _VERSIONS, CodeFiles, LOCKS
from masmc_ros.jit.compiled import is_interpreted, kernel
import pytest

PROCESSES = 6

SOURCE = """
import sys, time
from pathlib import Path
from masmc_ros.jit.compiled import is_interpreted, kernel

@kernel
def total(values):
    weighted = 0.0
    for value in values:
        weighted += len(values) * value
    return weighted

if __name__ == '__main__':
    own, processes = Path(sys.argv[1]), int(sys.argv[2])
    own.touch()
    while len(list(own.parent.glob('ready.*'))) < processes:
        time.sleep(1e-4)
    sizes = map(int, sys.argv[3:])
    print([total((1.0,) * size) for size in sizes], sum(total.stats.cache_hits.values()))
"""


Start = Callable[..., subprocess.Popen[str]]
"""Start a process with a name, the number of those that start together, and sizes of tuples."""


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    """Yield a function that starts a process of SOURCE with an empty folder of compiled code."""
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    monkeypatch.setenv('NUMBA_DISABLE_JIT', '0')
    script = tmp_path / 'total.py'
    script.write_text(SOURCE)
    processes = []

    def started(name: str, together: int, *sizes: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, str(script), str(tmp_path / f'ready.{name}'), str(together), *sizes],
            stdout=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        return process

    try:
        yield started
    finally:
        for process in processes:
            process.kill()
            process.communicate()


@pytest.mark.slow
def test_code_files_concurrent_processes_do_not_mix_signatures(start: Start) -> None:
    sizes = [str(size) for size in range(1, PROCESSES + 1)]
    started = [start(size, PROCESSES, size) for size in sizes]
    outputs = [process.communicate(timeout=120)[0] for process in started]
    assert outputs == [f'[{float(size) ** 2}] 0\n' for size in map(int, sizes)]
    # A later process finds all files, each under its own signature.
    later = start('later', 0, *sizes).communicate(timeout=120)[0]
    assert later == f'{[float(size) ** 2 for size in map(int, sizes)]} {PROCESSES}\n'


@pytest.mark.slow
def test_code_files_concurrent_processes_compile_once(start: Start) -> None:
    started = [start(str(k), PROCESSES, '3') for k in range(PROCESSES)]
    outputs = sorted(process.communicate(timeout=120)[0] for process in started)
    # The last number of each process is that of the files that it has loaded.
    assert outputs == ['[9.0] 0\n', *['[9.0] 1\n'] * (PROCESSES - 1)]


LOCKING = """
import sys, time
from masmc_ros.jit.code_files import CodeFiles
files = CodeFiles(sys.argv[1], 'total', lambda key: 'sources')
assert [files.load(key) for key in sys.argv[2:]] == [None] * len(sys.argv[2:])
print('locked', flush=True)
time.sleep(600)
"""


@pytest.fixture
def owner(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """Yield a process that computes the code of two keys in `tmp_path` and never ends."""
    command = [sys.executable, '-c', LOCKING, str(tmp_path), 'key', 'inner']
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == 'locked\n'
            yield process
        finally:
            process.kill()


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[CodeFiles]:
    """Yield the code files of the folder `tmp_path`; nothing stays locked."""
    locks = code_files._Locks()
    monkeypatch.setattr(code_files, 'LOCKS', locks)
    yield CodeFiles(str(tmp_path), 'total', lambda key: 'sources')
    locks.release_all()


def test_code_files_of_killed_owner_are_computed(
    owner: subprocess.Popen[str], files: CodeFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    pauses = []

    def pause(duration: float) -> None:
        pauses.append(duration)
        owner.kill()
        owner.wait()

    monkeypatch.setattr(code_files.time, 'sleep', pause)
    assert files.load('key') is None
    assert len(pauses) == 1


def test_code_files_of_running_owner_are_loaded_when_saved(
    owner: subprocess.Popen[str], files: CodeFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    def pause(duration: float) -> None:
        files.save('key', 'code')
        owner.kill()
        owner.wait()

    monkeypatch.setattr(code_files.time, 'sleep', pause)
    assert files.load('key') == 'code'
    # Another code is not locked.
    assert files.load('other') is None


def test_code_files_of_stopped_owner_are_computed_after_longest_wait(
    owner: subprocess.Popen[str], files: CodeFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    os.kill(owner.pid, signal.SIGSTOP)
    now = [0.0]

    def pause(duration: float) -> None:
        now[0] += 1.0

    monkeypatch.setattr(code_files.time, 'sleep', pause)
    monkeypatch.setattr(code_files.time, 'monotonic', lambda: now[0])
    assert files.load('key') is None
    assert now == [code_files._LONGEST_WAIT]
    # It does not wait again for each function.
    assert files.load('inner') is None
    assert now == [code_files._LONGEST_WAIT]


@pytest.mark.parametrize('ending', ['saved', 'failed', 'outer saved'])
def test_code_files_are_unlocked(ending: str, tmp_path: Path, files: CodeFiles) -> None:
    assert files.load('outer') is None
    assert files.load('key') is None
    if ending == 'failed':
        code_files.LOCKS.release_all()
    else:
        files.save('outer' if ending == 'outer saved' else 'key', 'code')
        files.flush()
    command = [sys.executable, '-c', LOCKING.replace('600', '0')]
    subprocess.run([*command, str(tmp_path), 'key'], timeout=60, check=True)


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_kernel_that_cannot_be_compiled_is_unlocked() -> None:
    with pytest.raises(InputError, match='nothing'):
        _failing(1.0)
    assert not LOCKS._held


@kernel
def _failing(value: float) -> float:
    # The compiler has to reject it, and so would the type check.
    return value.nothing  # type: ignore[attr-defined,no-any-return]


def test_code_files_read_returns_code_of_its_key_only(tmp_path: Path) -> None:
    one, other = (CodeFiles(str(tmp_path), 'total', lambda key: 'sources') for _ in range(2))
    one.save(('a', 1), 'code of a')
    other.save(('b', 1), 'code of b')
    assert [files.read(key) for files in (one, other) for key in (('a', 1), ('b', 1))] == [
        'code of a', 'code of b',
    ] * 2
    assert one.read(('c', 1)) is None
    # Other sources, or a file renamed to that of another key.
    assert CodeFiles(str(tmp_path), 'total', lambda key: 'others').read(('a', 1)) is None
    a, b = (files for files in sorted(tmp_path.iterdir()))
    a.write_bytes(b.read_bytes())
    assert sorted(str(one.read(key)) for key in (('a', 1), ('b', 1))) in (
        ['None', 'code of a'], ['None', 'code of b'],
    )


def test_code_files_of_older_sources_are_deleted(tmp_path: Path) -> None:
    versions = [
        CodeFiles(str(tmp_path), 'total', partial('{1} {0}'.format, k))
        for k in range(_VERSIONS + 2)
    ]
    for k, files in enumerate(versions):
        for key in 'a', 'b':
            files.save(key, k)
            os.utime(files.path(key), (k, k))
    for key in 'a', 'b':
        assert [files.read(key) for files in versions] == [None, None, *range(2, len(versions))]


@pytest.mark.parametrize('length', [0, 1, 40, -1])
def test_code_files_damaged_file_returns_none(tmp_path: Path, length: int) -> None:
    files = CodeFiles(str(tmp_path), 'total', lambda key: 'sources')
    files.save('key', list(range(100)))
    path, = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:length])
    assert files.read('key') is None
    files.save('key', 'whole')
    assert files.read('key') == 'whole'
    files.flush()
    assert not list(tmp_path.iterdir())


def test_code_files_full_disk_says_so_once_and_continues(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, 'replace', fail)
    files = CodeFiles(str(tmp_path), 'total', lambda key: 'sources')
    files.save('a', 'code')
    files.save('b', 'code')
    line, = caplog.messages
    assert line.startswith(f'compiled code is not stored in {tmp_path}: No space left on device')
    assert not list(tmp_path.iterdir())
