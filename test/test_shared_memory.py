# SPDX-License-Identifier: Apache-2.0
"""Half-made files that killed processes left in shared memory hold nobody up."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import time

import pytest

pytest.importorskip('rclpy')

from processes import PATIENCE, processes, ros_arguments

from masmc_ros.nodes.shared_memory import clear_half_made

LONG_AGO = 60.0
WHOLE = b'\x02\0\0\0' + bytes(60)


def age(path: Path) -> None:
    """Let a file be as old as one whose maker is long gone."""
    then = time.time() - LONG_AGO
    os.utime(path, (then, then))


@contextmanager
def port_file(domain: int) -> Iterator[Path]:
    """Yield the file of the port that a domain's first participant listens on, removed."""
    # RTPS 2.2, 9.6.1.1: PB + DG * domain + d3, of participant 0.
    path = Path(f'/dev/shm/fastrtps_port{7400 + 250 * domain + 11}')
    if not path.parent.is_dir():
        pytest.skip('no shared memory in the file system')
    path.unlink(missing_ok=True)
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)


def test_only_what_is_half_made_is_removed(tmp_path: Path) -> None:
    contents = {
        'fastrtps_port1': b'',
        'fastrtps_port2': bytes(64),
        'fastrtps_0123456789abcdef': b'\x01\0\0\0' + bytes(60),
        'fastrtps_port3': WHOLE,
        'fastrtps_port3_el': b'',
        'fastrtps_0123456789abcdef_el': b'',
        'sem.fastrtps_port1_mutex': b'',
        'of_somebody_else': b'',
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
        age(tmp_path / name)
    removed = {path.name for path in clear_half_made(tmp_path)}
    assert removed == {'fastrtps_port1', 'fastrtps_port2', 'fastrtps_0123456789abcdef'}
    assert {path.name for path in tmp_path.iterdir()} == contents.keys() - removed
    assert clear_half_made(tmp_path) == []
    assert clear_half_made(tmp_path / 'missing') == []


def test_a_file_in_the_making_is_waited_for(tmp_path: Path) -> None:
    """It is new; only when its maker has had time enough, it is taken for left."""
    path = tmp_path / 'fastrtps_port1'
    begun = time.time()
    path.write_bytes(b'')
    assert clear_half_made(tmp_path) == [path]
    assert time.time() - begun > 1.0


def test_a_node_starts_where_one_was_killed_at_its_start(tmp_path: Path) -> None:
    with processes(tmp_path) as started, port_file(started.domain) as path:
        path.touch()
        age(path)
        log = tmp_path / 'run.mcap'
        recorder = started.start('recorder', *ros_arguments(None, recorder__output=log))
        limit = time.monotonic() + PATIENCE
        while not recorder.logged('INFO', 'recording into'):
            assert time.monotonic() < limit, 'the recorder did not begin'
            time.sleep(0.05)
        recorder.signal(signal.SIGTERM)
        assert recorder.wait() == 0
