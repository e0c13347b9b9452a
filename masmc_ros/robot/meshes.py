# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mesh files of a robot description."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.robot.packages import resource_path
from masmc_ros.robot.urdf import read_urdf

_SUFFIXES = {'.dae', '.glb', '.gltf', '.obj', '.ply', '.stl'}
"""Suffixes of mesh files; a viewer gets no other files of this machine."""


def mesh_files(description: str) -> dict[str, Path]:
    """
    Return the files of those meshes that are on this machine, by their names in a description.

    Relative names are ignored, because a published description has no folder. Raises InputError
    for an invalid description.
    """
    paths = {}
    for link in read_urdf(description, 'the description').links.values():
        for name in link.meshes:
            with suppress(InputError):
                path = resource_path(name)
                if '://' in name and path.suffix.lower() in _SUFFIXES and path.is_file():
                    paths[name] = path
    return paths
