# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Private ROS domain: its lock is in a folder that other users cannot write to."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
import os
from pathlib import Path
import socket
import stat

from masmc_ros.cli.node_processes import locked_domain, private_domain
from masmc_ros.errors import UserError
from masmc_ros.user_folder import runtime_folder
import pytest


@pytest.fixture
def free() -> Iterator[list[int]]:
    """Yield four domains that no other process takes during the test."""
    domains = range(60, 98)
    with ExitStack() as locks:
        yield [locks.enter_context(locked_domain(domains)) for _ in range(4)]


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of XDG_RUNTIME_DIR, with the permissions that a login session sets."""
    folder = tmp_path / 'runtime'
    folder.mkdir(mode=0o700)
    monkeypatch.setenv('XDG_RUNTIME_DIR', str(folder))
    return folder


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a temporary folder of all users, on a system without a runtime folder."""
    folder = tmp_path / 'temporary'
    folder.mkdir()
    folder.chmod(0o1777)
    monkeypatch.delenv('XDG_RUNTIME_DIR', raising=False)
    monkeypatch.setattr('tempfile.tempdir', str(folder))
    return folder


def test_private_domain_lock_in_runtime_folder_only(temporary: Path, runtime: Path) -> None:
    with private_domain() as variables:
        # A domain that another process uses was locked first if it had the earlier turn.
        locks = {lock.name for lock in (runtime / 'masmc_ros').iterdir()}
        assert f'domain_{variables["ROS_DOMAIN_ID"]}.lock' in locks
    assert list(temporary.iterdir()) == []


def test_locked_domain_two_at_once_differ(free: list[int], runtime: Path) -> None:
    with locked_domain(free) as one, locked_domain(free) as other:
        assert one != other
    with locked_domain([one]) as again:
        assert again == one
    no_free_domain = pytest.raises(UserError, match='no free ROS domain')
    with locked_domain([one]), no_free_domain, locked_domain([one]):
        pass


def test_locked_domain_in_use_without_lock_skipped(free: list[int], runtime: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as node:
        node.bind(('', 7410 + 250 * free[0]))
        with locked_domain(free[:2]) as domain:
            assert domain == free[1]


def test_runtime_folder_unset_created_for_this_user_only(temporary: Path) -> None:
    folder = runtime_folder()
    assert folder == temporary / f'masmc_ros-{os.getuid()}'
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert runtime_folder() == folder


def test_runtime_folder_writable_by_all_not_used(runtime: Path, tmp_path: Path) -> None:
    runtime.chmod(0o777)
    assert not runtime_folder().is_relative_to(runtime)


@pytest.mark.parametrize('kind', ['link', 'file', 'open to all', "another user's"])
def test_private_domain_foreign_path_in_place_of_folder_rejected(
    kind: str, temporary: Path, tmp_path: Path
) -> None:
    folder, elsewhere = temporary / f'masmc_ros-{os.getuid()}', tmp_path / 'elsewhere'
    elsewhere.mkdir()
    if kind == 'link':
        folder.symlink_to(elsewhere)
    elif kind == 'file':
        folder.touch()
    else:
        folder.mkdir()
        if kind == 'open to all':
            folder.chmod(0o777)
        elif os.getuid() == 0:
            os.chown(folder, 12345, 12345)
        else:
            pytest.skip('only root can change the owner of a folder')
    with pytest.raises(UserError, match='set XDG_RUNTIME_DIR'), private_domain():
        pass
    assert list(elsewhere.iterdir()) == []


def test_locked_domain_link_in_place_of_lock_not_followed(
    free: list[int], runtime: Path, tmp_path: Path
) -> None:
    important = tmp_path / 'important'
    important.write_bytes(b'content')
    (runtime / 'masmc_ros').mkdir(mode=0o700)
    (runtime / 'masmc_ros' / f'domain_{free[0]}.lock').symlink_to(important)
    with locked_domain(free[:2]) as domain:
        assert domain == free[1]
    assert important.read_bytes() == b'content'
