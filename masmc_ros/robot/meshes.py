# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The files of the meshes that a description names."""

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

    Relative names are left out: a description that was published has no folder. Raises
    InputError for what is no description.
    """
    found = {}
    for link in read_urdf(description, 'the description').links.values():
        for name in link.meshes:
            with suppress(InputError):
                path = resource_path(name)
                if '://' in name and path.suffix.lower() in _SUFFIXES and path.is_file():
                    found[name] = path
    return found
