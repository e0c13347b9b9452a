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

"""Runs of a tree side by side in lanes: each has the bits of the run alone."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import subprocess
import sys

import pytest
from surroundings import surroundings

ROOT = Path(__file__).resolve().parents[2]
HELPER = ROOT / 'test' / 'helpers' / 'tree_in_lanes.py'


def test_lanes_of_small_tree_have_bits_of_single_runs() -> None:
    done = subprocess.run(
        [sys.executable, HELPER], env={**surroundings(), 'NUMBA_DISABLE_JIT': '1'},
        stdout=subprocess.PIPE, text=True, timeout=300.0, check=True,
    )  # fmt: skip
    assert done.stdout == ''


@pytest.mark.slow
@pytest.mark.skipif(find_spec('pinocchio') is None, reason='its URDF comes with the extra robots')
def test_four_lanes_of_tiago_have_bits_of_single_runs() -> None:
    done = subprocess.run(
        [sys.executable, HELPER, ROOT / 'config' / 'tiago.yaml', '0.2'], env=surroundings(),
        stdout=subprocess.PIPE, text=True, timeout=2400.0, check=True,
    )  # fmt: skip
    assert done.stdout == ''
