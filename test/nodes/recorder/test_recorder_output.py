# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Files and folders into which a recorder writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.log.read.scan import scan
from masmc_ros.log.write.recording import Recording
from masmc_ros.nodes.recorder.attachments import Attachments
from masmc_ros.nodes.recorder.output import open_recording
from masmc_ros.params.declaration import check_all
from masmc_ros.params.node_parameters import declared
import pytest


def opened(output: Path, **values: Any) -> Recording:
    """Start the recording of a recorder with some parameters."""
    checked = check_all(declared('recorder'), {'output': str(output), **values})
    return open_recording(checked, Attachments({}, dict))


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
