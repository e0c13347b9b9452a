# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Code files of the compiler cache, written by several processes at once."""

from __future__ import annotations

import errno
from functools import partial
import os
from pathlib import Path
import subprocess
import sys

from masmc_ros.jit.code_files import _VERSIONS, CodeFiles
import pytest

PROCESSES = 6

SOURCE = """
import sys, time
from pathlib import Path
from masmc_ros.jit.compiled import kernel

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


@pytest.mark.slow
def test_code_files_concurrent_processes_do_not_mix_signatures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    monkeypatch.setenv('NUMBA_DISABLE_JIT', '0')
    script = tmp_path / 'total.py'
    script.write_text(SOURCE)
    sizes = [str(size) for size in range(1, PROCESSES + 1)]

    def run(name: str, together: int, *sizes: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, str(script), str(tmp_path / f'ready.{name}'), str(together), *sizes],
            stdout=subprocess.PIPE,
            text=True,
        )

    started = [run(size, PROCESSES, size) for size in sizes]
    outputs = [process.communicate(timeout=120)[0] for process in started]
    assert outputs == [f'[{float(size) ** 2}] 0\n' for size in map(int, sizes)]
    # A later process finds all files, each under its own signature.
    later = run('later', 0, *sizes).communicate(timeout=120)[0]
    assert later == f'{[float(size) ** 2 for size in map(int, sizes)]} {PROCESSES}\n'


def test_code_files_load_returns_code_of_its_key_only(tmp_path: Path) -> None:
    one, other = (CodeFiles(str(tmp_path), 'total', lambda key: 'sources') for _ in range(2))
    one.save(('a', 1), 'code of a')
    other.save(('b', 1), 'code of b')
    assert [files.load(key) for files in (one, other) for key in (('a', 1), ('b', 1))] == [
        'code of a', 'code of b',
    ] * 2
    assert one.load(('c', 1)) is None
    # Other sources, or a file renamed to that of another key.
    assert CodeFiles(str(tmp_path), 'total', lambda key: 'others').load(('a', 1)) is None
    a, b = (files for files in sorted(tmp_path.iterdir()))
    a.write_bytes(b.read_bytes())
    assert sorted(str(one.load(key)) for key in (('a', 1), ('b', 1))) in (
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
        assert [files.load(key) for files in versions] == [None, None, *range(2, len(versions))]


@pytest.mark.parametrize('length', [0, 1, 40, -1])
def test_code_files_damaged_file_returns_none(tmp_path: Path, length: int) -> None:
    files = CodeFiles(str(tmp_path), 'total', lambda key: 'sources')
    files.save('key', list(range(100)))
    path, = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:length])
    assert files.load('key') is None
    files.save('key', 'whole')
    assert files.load('key') == 'whole'
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
