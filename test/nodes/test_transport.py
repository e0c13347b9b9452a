# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes of this package keep out of the shared memory of Fast DDS, unless told otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
import subprocess
import sys

from masmc_ros.nodes.middleware import transport
import pytest
from rclpy.utilities import get_rmw_implementation_identifier
from surroundings import surroundings

PROFILES = Path(transport.__file__).with_name('fast_dds')
RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
VARIABLES = ('FASTDDS_BUILTIN_TRANSPORTS', 'FASTRTPS_DEFAULT_PROFILES_FILE', RANGE)

PREPARE = f"""
import os
from masmc_ros.nodes.middleware.transport import prepare_transport
prepare_transport()
print(*(os.environ.get(name, '-') for name in {VARIABLES}), sep='|')
"""

JOIN = """
import rclpy
rclpy.init()
node = rclpy.create_node('one')
with open('/proc/self/maps') as maps:
    print(any('/dev/shm/fastrtps' in line for line in maps))
"""

pytestmark = pytest.mark.skipif(
    not get_rmw_implementation_identifier().startswith('rmw_fastrtps'),
    reason='another middleware',
)


def output(program: str, folder: Path, environment: Mapping[str, str]) -> list[str]:
    """Return what a Python program prints in an environment and a folder."""
    given = {k: v for k, v in surroundings().items() if k not in VARIABLES}
    found = subprocess.run(
        [sys.executable, '-c', program],
        env={**given, 'ROS_DOMAIN_ID': '59', **environment},
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
        timeout=120.0,
    )
    assert not found.stderr
    return found.stdout.splitlines()


@pytest.mark.parametrize('discovery', ['LOCALHOST', 'SUBNET', 'OFF'])
def test_a_node_maps_no_shared_memory(discovery: str, tmp_path: Path) -> None:
    ours = output(PREPARE + JOIN, tmp_path, {RANGE: discovery})
    middleware = output(JOIN, tmp_path, {RANGE: discovery})
    assert middleware == ['True'], 'nothing to keep out of: the test tests nothing'
    assert ours[1:] == ['False']


def test_what_the_user_has_decided_stays(tmp_path: Path) -> None:
    own = tmp_path / 'own.xml'
    for decided in (
        ('DEFAULT', '-', 'LOCALHOST'),
        ('-', str(own), 'SUBNET'),
        ('SHM', str(own), 'LOCALHOST'),
    ):
        environment = {
            name: value
            for name, value in zip(VARIABLES, decided, strict=True)
            if value != '-'
        }
        assert output(PREPARE, tmp_path, environment) == ['|'.join(decided)]
    (tmp_path / 'DEFAULT_FASTRTPS_PROFILES.xml').touch()
    assert output(PREPARE, tmp_path, {RANGE: 'LOCALHOST'}) == ['-|-|LOCALHOST']


def test_it_goes_on_to_children(tmp_path: Path) -> None:
    """Also where the child's graph is told anew to stay on its machine."""
    local = ['|'.join(('-', str(PROFILES / 'localhost.xml'), 'SYSTEM_DEFAULT'))]
    wide = ['|'.join(('-', str(PROFILES / 'subnet.xml'), '-'))]
    assert output(PREPARE, tmp_path, {RANGE: 'LOCALHOST'}) == local
    assert output(PREPARE, tmp_path, {'ROS_LOCALHOST_ONLY': '1'}) == local
    assert output(PREPARE, tmp_path, {}) == wide
    inherited = {'FASTRTPS_DEFAULT_PROFILES_FILE': str(PROFILES / 'localhost.xml')}
    for again in ('LOCALHOST', 'SYSTEM_DEFAULT'):
        assert output(PREPARE, tmp_path, {**inherited, RANGE: again}) == local
    # The file does not know peers, so that the middleware must.
    peers = {RANGE: 'LOCALHOST', 'ROS_STATIC_PEERS': '127.0.0.2'}
    assert output(PREPARE, tmp_path, peers) == ['-|-|LOCALHOST']


def test_both_profiles_differ_in_discovery_alone() -> None:
    local, wide = (
        [line.strip() for line in (PROFILES / name).read_text().splitlines()]
        for name in ('localhost.xml', 'subnet.xml')
    )
    begin, end = local.index('<builtin>'), local.index('</builtin>')
    rest = local[:begin] + local[end + 1:]
    rest.remove('<maxInitialPeersRange>32</maxInitialPeersRange>')
    assert rest[2:] == wide[2:]
