# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Files and folders into which a recorder writes."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
import re
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.log.read.scan import scan
from masmc_ros.log.write.recording import Recording
from masmc_ros.nodes.recorder.output import Attachments, open_recording
from masmc_ros.params.declaration import check_all
from masmc_ros.scenario.node_parameters import declared
import pytest


def opened(output: Path, namespace: str = '/', **values: Any) -> Recording:
    """Start the recording of a recorder with some parameters."""
    checked = check_all(declared('recorder'), {'output': str(output), **values})
    return open_recording(checked, Attachments({}, dict), namespace)


@pytest.mark.parametrize('max_duration', [0.0, 60.0])
def test_recorder_overwrite_of_running_recording_rejected(
    max_duration: float, tmp_path: Path
) -> None:
    path = tmp_path / 'run.mcap'
    first = opened(path, max_duration=max_duration, overwrite=True)
    channel = first.channel('/a', 'geometry_msgs/msg/Twist')
    with pytest.raises(InputError, match=r'run(\.mcap)?: another recorder writes it'):
        opened(path, max_duration=max_duration, overwrite=True)
    for n in range(10):
        first.write(channel, n, bytes([n]))
    first.close()
    assert len(scan(first.path).topics['/a'].messages) == 10
    # A recording that has ended is replaced.
    second = opened(path, max_duration=max_duration, overwrite=True)
    second.close()
    assert scan(second.path).topics == {}


@pytest.mark.parametrize('values', [{}, {'max_duration': 60.0}, {'overwrite': True}])
def test_recorder_output_folder_names_are_unique(
    values: dict[str, Any], tmp_path: Path
) -> None:
    with ThreadPoolExecutor(4) as pool:
        recordings = list(pool.map(lambda _: opened(tmp_path, **values), range(8)))
    for number, recording in enumerate(recordings):
        channel = recording.channel('/a', 'std_msgs/msg/String')
        recording.write(channel, 0, bytes([number]))
        recording.close()
    contents = [scan(recording.path).topics['/a'].messages for recording in recordings]
    assert contents == [[bytes([number])] for number in range(8)]
    # Automatic names have a number within the same second.
    pattern = re.compile(r'masmc_[-\d]{10}_[-\d]{8}(_\d)?(\.mcap)?')
    assert all(pattern.fullmatch(path.name) for path in tmp_path.iterdir())
    assert len(list(tmp_path.iterdir())) == 8


def test_recorder_output_folder_name_has_namespace(tmp_path: Path) -> None:
    recording = opened(tmp_path, '/fleet/robot_1')
    recording.close()
    assert recording.path.name.startswith('masmc_fleet_robot_1_20')


def test_recorder_output_folder_missing_rejected(tmp_path: Path) -> None:
    for values in ({}, {'max_duration': 60.0}):
        with pytest.raises(InputError, match='none does not exist; create it or name another'):
            opened(tmp_path / 'none', **values)
