# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A domain of one's own: locked where nobody else can put anything, and heard by nobody."""

from __future__ import annotations

import os
from pathlib import Path
import socket
import stat

from masmc_ros.cli.private_domain import locked_domain, private_domain
from masmc_ros.errors import UserError
from masmc_ros.user_folder import runtime_folder
import pytest

FREE = [3, 4, 5, 6]
"""Domains that the tests' own nodes do not use."""


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder that XDG_RUNTIME_DIR names, as a session of the system makes it."""
    folder = tmp_path / 'runtime'
    folder.mkdir(mode=0o700)
    monkeypatch.setenv('XDG_RUNTIME_DIR', str(folder))
    return folder


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a temporary folder for everybody, on a system that has no other for the user."""
    folder = tmp_path / 'temporary'
    folder.mkdir()
    folder.chmod(0o1777)
    monkeypatch.delenv('XDG_RUNTIME_DIR', raising=False)
    monkeypatch.setattr('tempfile.tempdir', str(folder))
    return folder


def test_locks_are_in_the_runtime_folder_alone(temporary: Path, runtime: Path) -> None:
    with private_domain() as variables:
        (lock,) = (runtime / 'masmc_ros').iterdir()
        assert lock.name == f'domain_{variables["ROS_DOMAIN_ID"]}.lock'
    assert list(temporary.iterdir()) == []


def test_two_at_once_have_two_domains(runtime: Path) -> None:
    with locked_domain(FREE) as one, locked_domain(FREE) as other:
        assert one != other
    with locked_domain([one]) as again:
        assert again == one
    taken = pytest.raises(UserError, match='no free ROS domain')
    with locked_domain([one]), taken, locked_domain([one]):
        pass


def test_a_domain_that_somebody_uses_without_a_lock_is_left_out(runtime: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as node:
        node.bind(('', 7410 + 250 * FREE[0]))
        with locked_domain(FREE[:2]) as domain:
            assert domain == FREE[1]


def test_without_one_the_folder_is_made_for_this_user_alone(temporary: Path) -> None:
    folder = runtime_folder()
    assert folder == temporary / f'masmc_ros-{os.getuid()}'
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert runtime_folder() == folder


def test_a_runtime_folder_that_all_may_write_to_is_not_used(runtime: Path, tmp_path: Path) -> None:
    runtime.chmod(0o777)
    assert not runtime_folder().is_relative_to(runtime)


@pytest.mark.parametrize('what', ['link', 'file', 'open to all', "another user's"])
def test_what_somebody_else_put_there_is_refused(
    what: str, temporary: Path, tmp_path: Path
) -> None:
    place, elsewhere = temporary / f'masmc_ros-{os.getuid()}', tmp_path / 'elsewhere'
    elsewhere.mkdir()
    if what == 'link':
        place.symlink_to(elsewhere)
    elif what == 'file':
        place.touch()
    else:
        place.mkdir()
        if what == 'open to all':
            place.chmod(0o777)
        elif os.getuid() == 0:
            os.chown(place, 12345, 12345)
        else:
            pytest.skip('only root gives folders away')
    with pytest.raises(UserError, match='set XDG_RUNTIME_DIR'), private_domain():
        pass
    assert list(elsewhere.iterdir()) == []


def test_a_link_in_place_of_a_lock_is_not_followed(runtime: Path, tmp_path: Path) -> None:
    precious = tmp_path / 'precious'
    precious.write_bytes(b'precious')
    (runtime / 'masmc_ros').mkdir(mode=0o700)
    (runtime / 'masmc_ros' / f'domain_{FREE[0]}.lock').symlink_to(precious)
    with locked_domain(FREE[:2]) as domain:
        assert domain == FREE[1]
    assert precious.read_bytes() == b'precious'
