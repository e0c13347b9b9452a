# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Log readers of viewers: JavaScript libraries, installed once into the user's cache folder."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
import shutil
import subprocess
import tempfile
from typing import Any

import pytest

SOURCES = Path(__file__).resolve().parent / 'node'
_INSTALLATION = 240.0
_READING = 120.0


def read_log(log: Path, *more: Path) -> Any:
    """
    Return the output of `node/read_log.mjs` for a log and a layout's scripts.

    Skips the test if Node.js is not installed or its packages cannot be downloaded. The latter
    is a failure if the environment variable CI is set.
    """
    result = run_read_log(log, *more)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def run_read_log(log: Path, *more: Path) -> subprocess.CompletedProcess[str]:
    """Run `node/read_log.mjs`, skipping as `read_log` does."""
    folder = _installed()
    # Node.js searches modules in the folder of the script.
    for script in SOURCES.glob('*.mjs'):
        shutil.copyfile(script, folder / script.name)
    return subprocess.run(
        ['node', str(folder / 'read_log.mjs'), str(log), *map(str, more)],
        capture_output=True,
        text=True,
        timeout=_READING,
    )


def _installed() -> Path:
    if shutil.which('node') is None or shutil.which('npm') is None:
        pytest.skip('Node.js with npm is not installed')
    package = (SOURCES / 'package.json').read_bytes()
    caches = Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache')
    folder = caches / 'masmc_ros' / f'node_{hashlib.sha256(package).hexdigest()[:16]}'
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as temporary:
            fault = _install(Path(temporary), package)
            if fault and os.environ.get('CI'):
                pytest.fail(fault)
            if fault:
                pytest.skip(fault)
            try:
                (Path(temporary) / 'packages').rename(folder)
            except OSError:
                assert folder.is_dir()  # another test process was faster
    return folder


def _install(parent: Path, package: bytes) -> str:
    """Install into `packages` of a folder; return the error, '' on success."""
    folder = parent / 'packages'
    folder.mkdir()
    (folder / 'package.json').write_bytes(package)
    options = ['--no-package-lock', '--no-audit', '--no-fund', '--ignore-scripts']
    try:
        result = subprocess.run(
            ['npm', 'install', *options],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=_INSTALLATION,
        )
    except subprocess.TimeoutExpired:
        return f'npm install takes longer than {_INSTALLATION:g} s'
    return '' if result.returncode == 0 else f'npm install: {result.stderr.strip()[-500:]}'
