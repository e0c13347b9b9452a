# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Files by URI: packages of ROS 2, ROS 1 and Python."""

from __future__ import annotations

from pathlib import Path
import sys

from masmc_ros.errors import InputError
from masmc_ros.robot.packages import resource_path
from masmc_ros.robot.urdf import read_urdf_file
import pytest

URDF = (
    '<robot name="box">\n<link name="box"><visual><geometry>'
    '<mesh filename="package://box_robot/meshes/box.stl"/></geometry></visual><collision>'
    '<geometry><mesh filename="box%20hull.stl"/></geometry></collision></link></robot>'
)


@pytest.fixture(autouse=True)
def _nothing_sourced(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ('AMENT_PREFIX_PATH', 'ROS_PACKAGE_PATH'):
        monkeypatch.delenv(name, raising=False)


def box_robot(folder: Path) -> Path:
    """Write a package of a robot."""
    share = folder / 'box_robot'
    (share / 'meshes').mkdir(parents=True)
    (share / 'meshes/box.stl').write_bytes(b'')
    (share / 'box.urdf').write_text(URDF, encoding='utf-8')
    return share


def mesh_path() -> Path:
    """Return the path of the mesh in the description."""
    description = read_urdf_file('package://box_robot/box.urdf')
    mesh, _ = description.links['box'].meshes
    path = resource_path(mesh)
    assert path.is_file()
    return path


def test_package_uri_ament_index_names_package_is_located(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = box_robot(tmp_path / 'ws/share')
    index = tmp_path / 'ws/share/ament_index/resource_index/packages'
    index.mkdir(parents=True)
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{tmp_path / "other"}:{tmp_path / "ws"}')
    with pytest.raises(InputError):
        mesh_path()
    (index / 'box_robot').touch()
    assert mesh_path() == share / 'meshes/box.stl'
    # Sourced packages take precedence over those of Python.
    monkeypatch.setattr(sys, 'prefix', str(tmp_path / 'other'))
    assert mesh_path() == share / 'meshes/box.stl'


@pytest.mark.parametrize('folder', ['src', 'src/box_robot'])
def test_package_uri_ros_package_path_is_searched(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = box_robot(tmp_path / 'src')
    monkeypatch.setenv('ROS_PACKAGE_PATH', f'/nowhere::{tmp_path / folder}')
    assert mesh_path() == share / 'meshes/box.stl'


def test_package_uri_python_package_is_located_not_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = box_robot(tmp_path)
    (share / '__init__.py').write_text('raise RuntimeError("imported")', encoding='utf-8')
    monkeypatch.syspath_prepend(tmp_path)
    assert mesh_path() == share / 'meshes/box.stl'


def test_package_uri_prefix_of_python_wheel_is_searched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = box_robot(tmp_path / 'cmeel.prefix/share')
    index = tmp_path / 'cmeel.prefix/share/ament_index/resource_index/packages'
    index.mkdir(parents=True)
    (index / 'box_robot').touch()
    monkeypatch.syspath_prepend(tmp_path)
    assert mesh_path() == share / 'meshes/box.stl'


def test_resource_path_plain_paths_and_file_uris_are_resolved(tmp_path: Path) -> None:
    assert resource_path('/a/b.urdf') == Path('/a/b.urdf')
    assert resource_path('meshes/b.stl', tmp_path) == tmp_path / 'meshes/b.stl'
    assert resource_path('b.urdf') == Path('b.urdf')
    assert resource_path('file:///a/b%20c.urdf') == Path('/a/b c.urdf')


@pytest.mark.parametrize(
    ('uri', 'expected'),
    [
        (
            'package://no_robot/a.urdf',
            "package://no_robot/a.urdf: no package 'no_robot' in the ament indices of"
            f' AMENT_PREFIX_PATH (/opt/none) and {sys.prefix}, in ROS_PACKAGE_PATH (not set), or'
            " among Python's; source the workspace that has it, or give a path",
        ),
        ('package://no-robot/a.urdf', "no package 'no-robot' in"),
        ('package://__main__/a.urdf', "no package '__main__' in"),
        ('package:///no_robot/a.urdf', 'expected package://NAME/PATH, file:///PATH or a path'),
        ('http://x/a.urdf', 'http://x/a.urdf: expected package://NAME/PATH'),
        ('package://masmc_ros/a.urdf', 'masmc_ros/a.urdf: No such file or directory'),
    ],
)
def test_package_uri_invalid_raises_one_line(
    uri: str, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('AMENT_PREFIX_PATH', '/opt/none')
    with pytest.raises(InputError) as raised:
        read_urdf_file(uri)
    assert expected in str(raised.value)
    assert '\n' not in str(raised.value)
