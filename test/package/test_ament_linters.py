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

"""What a package of ROS is checked by; skipped where ROS is not installed."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = [
    str(ROOT / name)
    for name in ('masmc_ros', 'test', 'launch', 'benchmarks', 'tools', 'scripts', 'setup.py')
    if (ROOT / name).exists()
]


@pytest.mark.parametrize('linter', ['ament_copyright', 'ament_flake8', 'ament_pep257'])
def test_linter_finds_nothing(linter: str) -> None:
    main = pytest.importorskip(f'{linter}.main')
    assert main.main(argv=SOURCES) == 0
