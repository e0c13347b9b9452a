# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Choices of installed packages."""

from __future__ import annotations

from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.params.plug_ins import load_plug_in, plugged_in
import pytest


def install(folder: Path, package: str, value: str) -> None:
    """Write the metadata of a package that brings the choice `push` to a group."""
    metadata = folder / package / f'{package}-1.0.dist-info'
    metadata.mkdir(parents=True)
    (metadata / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n')
    (metadata / 'entry_points.txt').write_text(f'[test.choices]\npush = {value}\n')


def test_plug_in_of_two_packages_raises_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package in ('one', 'other'):
        install(tmp_path, package, f'{package}.laws:Push')
        monkeypatch.syspath_prepend(tmp_path / package)
    assert plugged_in('test.choices') == ('push',)
    with pytest.raises(InputError) as raised:
        load_plug_in('test.choices', 'law', 'push')
    assert str(raised.value) == (
        'law = push: several installed packages bring it: other.laws:Push, one.laws:Push;'
        ' uninstall all of them but one'
    )


def test_plug_in_equal_entry_of_two_packages_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # For example an installed package and its checkout on PYTHONPATH under another name.
    for package in ('one', 'other'):
        install(tmp_path, package, 'pathlib:Path')
        monkeypatch.syspath_prepend(tmp_path / package)
    assert load_plug_in('test.choices', 'law', 'push') is Path
