# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Options of `.ci/run`: each test once in two environments, no skip without a reason."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment
import pytest

ROOT = Path(__file__).resolve().parents[2]
TESTS = """
import pytest

def test_passes():
    pass

def test_skipped():
    pytest.skip({reason!r})
"""


def run(folder: Path, reason: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Run a file of two tests with the settings of this package."""
    (folder / 'test_two.py').write_text(TESTS.format(reason=reason), encoding='utf-8')
    plain = ('-p', 'conftest', '-p', 'no:cacheprovider', '-c', str(ROOT / 'pyproject.toml'))
    command = [sys.executable, '-m', 'pytest', *plain, '--rootdir', str(folder), *options]
    return subprocess.run(
        [*command, 'test_two.py'],
        cwd=folder,
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=180.0,
        check=False,
    )


@pytest.mark.slow
def test_skip_without_documented_reason_fails(tmp_path: Path) -> None:
    for processes in ((), ('-n', '1')):
        result = run(tmp_path, 'no moon here', '--check-skipped', *processes)
        assert result.returncode == 1, result.stdout + result.stderr
        assert 'test_two.py::test_skipped was skipped: no moon here;' in result.stdout
    assert run(tmp_path, 'no moon here').returncode == 0
    assert run(tmp_path, 'root may write everywhere', '--check-skipped').returncode == 0


@pytest.mark.slow
def test_second_run_omits_passed_tests_only(tmp_path: Path) -> None:
    passed = tmp_path / 'passed.txt'
    first = run(tmp_path, 'no Firefox here', f'--write-passed={passed}', '-n', '1')
    assert first.returncode == 0, first.stdout + first.stderr
    assert passed.read_text(encoding='utf-8') == 'test_two.py::test_passes'
    second = run(tmp_path, 'no Firefox here', f'--skip-passed={passed}', '--check-skipped')
    assert second.returncode == 0, second.stdout + second.stderr
    assert '1 skipped, 1 deselected' in second.stdout
