# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Transport of nodes: no shared memory of Fast DDS by default, and settings of the user."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment, domain
from masmc_ros.nodes.middleware import rcl_setup
import pytest
from rclpy.utilities import get_rmw_implementation_identifier

PROFILES = Path(rcl_setup.__file__).with_name('fast_dds')
RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
VARIABLES = ('FASTDDS_BUILTIN_TRANSPORTS', 'FASTRTPS_DEFAULT_PROFILES_FILE', RANGE)

PREPARE = f"""
import os
from masmc_ros.nodes.middleware.rcl_setup import prepare_transport
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
    """Return the lines that a Python program prints in an environment and a folder."""
    inherited = {k: v for k, v in child_environment().items() if k not in VARIABLES}
    with domain() as own:
        result = subprocess.run(
            [sys.executable, '-c', program],
            env={**inherited, 'ROS_DOMAIN_ID': str(own), **environment},
            cwd=folder,
            capture_output=True,
            text=True,
            check=True,
            timeout=120.0,
        )
    assert not result.stderr
    return result.stdout.splitlines()


@pytest.mark.parametrize('discovery', ['LOCALHOST', 'SUBNET', 'OFF'])
def test_transport_node_maps_no_shared_memory(discovery: str, tmp_path: Path) -> None:
    ours = output(PREPARE + JOIN, tmp_path, {RANGE: discovery})
    middleware = output(JOIN, tmp_path, {RANGE: discovery})
    assert middleware == ['True'], 'the middleware itself uses no shared memory'
    assert ours[1:] == ['False']


def test_transport_settings_of_user_kept(tmp_path: Path) -> None:
    own = tmp_path / 'own.xml'
    for user_values in (
        ('DEFAULT', '-', 'LOCALHOST'),
        ('-', str(own), 'SUBNET'),
        ('SHM', str(own), 'LOCALHOST'),
    ):
        environment = {
            name: value
            for name, value in zip(VARIABLES, user_values, strict=True)
            if value != '-'
        }
        assert output(PREPARE, tmp_path, environment) == ['|'.join(user_values)]
    (tmp_path / 'DEFAULT_FASTRTPS_PROFILES.xml').touch()
    assert output(PREPARE, tmp_path, {RANGE: 'LOCALHOST'}) == ['-|-|LOCALHOST']


def test_transport_child_process_same_settings(tmp_path: Path) -> None:
    """The settings are also the same if the child sets the discovery range again."""
    local = ['|'.join(('-', str(PROFILES / 'localhost.xml'), 'SYSTEM_DEFAULT'))]
    wide = ['|'.join(('-', str(PROFILES / 'subnet.xml'), '-'))]
    assert output(PREPARE, tmp_path, {RANGE: 'LOCALHOST'}) == local
    assert output(PREPARE, tmp_path, {'ROS_LOCALHOST_ONLY': '1'}) == local
    assert output(PREPARE, tmp_path, {}) == wide
    inherited = {'FASTRTPS_DEFAULT_PROFILES_FILE': str(PROFILES / 'localhost.xml')}
    for again in ('LOCALHOST', 'SYSTEM_DEFAULT'):
        assert output(PREPARE, tmp_path, {**inherited, RANGE: again}) == local
    # The profile has no peers; therefore the middleware's own settings apply.
    peers = {RANGE: 'LOCALHOST', 'ROS_STATIC_PEERS': '127.0.0.2'}
    assert output(PREPARE, tmp_path, peers) == ['-|-|LOCALHOST']


def test_transport_profiles_differ_only_in_discovery() -> None:
    local, wide = (
        [line.strip() for line in (PROFILES / name).read_text().splitlines()]
        for name in ('localhost.xml', 'subnet.xml')
    )
    start, end = local.index('<builtin>'), local.index('</builtin>')
    common = local[:start] + local[end + 1:]
    common.remove('<maxInitialPeersRange>32</maxInitialPeersRange>')
    assert common[2:] == wide[2:]
