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

"""`masmc export`: logged runs as tables and arrays."""

from __future__ import annotations

from collections.abc import Sequence

from masmc_ros.log.read.reader import read_run
from masmc_ros.report.export import check_export, write_export
from tqdm import tqdm


def export(logs: Sequence[str], output: str, file_format: str, *, overwrite: bool) -> int:
    """Read logs, write a file for each into a folder, print what is there."""
    check_export(logs, output, file_format, overwrite=overwrite)
    runs = [read_run(log) for log in tqdm(logs, unit='log', desc='reading', disable=None)]
    for path in write_export(runs, output, file_format, overwrite=overwrite):
        print(f'{path}: {path.stat().st_size} bytes')
    return 0
