# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Restriction of this package's processes to UDP, which a killed process cannot block.

Fast DDS prefers shared memory and guards it by mutexes within that memory. If a subscriber is
killed while it holds one, its publishers block in `publish` indefinitely and ignore SIGINT
(ros2/rmw_fastrtps issue 908, "Long running ROS stacks reaching deadlock with shared memory").
This file and `fast_dds/` can be removed when publishers on shared memory pass
`test/nodes/recorder/test_listeners_killed.py`.
"""

from __future__ import annotations

import os
from pathlib import Path

from rclpy.utilities import get_rmw_implementation_identifier

_PROFILES = Path(__file__).with_name('fast_dds')

_BUILT_IN = 'FASTDDS_BUILTIN_TRANSPORTS'

_PROFILES_FILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'

_LOCAL_PROFILES = 'DEFAULT_FASTRTPS_PROFILES.xml'
"""Profiles that Fast DDS reads from the working directory."""

_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'

_AS_IN_PROFILES = 'SYSTEM_DEFAULT'


def prepare_transport() -> None:
    """
    Restrict the nodes that this process creates from here on to UDP.

    Call this before rclpy is initialized. Nothing changes with another middleware, or if the
    user has chosen transports (FASTDDS_BUILTIN_TRANSPORTS) or profiles of Fast DDS.
    """
    environment = os.environ
    if not get_rmw_implementation_identifier().startswith('rmw_fastrtps'):
        return
    configured = environment.get(_PROFILES_FILE)
    is_inherited = configured is not None and Path(configured).parent == _PROFILES
    has_transports = environment.get(_BUILT_IN) or Path(_LOCAL_PROFILES).exists()
    if has_transports or (configured and not is_inherited):
        return
    discovery = environment.get(_RANGE)
    if is_inherited and discovery == _AS_IN_PROFILES:
        return
    profiles = 'subnet.xml'
    # For a graph on one machine ROS 2 always adds shared memory. So its other settings for this
    # case are in a file, and ROS 2 gets no request for one machine.
    if environment.get('ROS_LOCALHOST_ONLY') == '1' or discovery == 'LOCALHOST':
        # The file does not contain static peers.
        if environment.get('ROS_STATIC_PEERS'):
            return
        profiles = 'localhost.xml'
        environment.pop('ROS_LOCALHOST_ONLY', None)
        environment[_RANGE] = _AS_IN_PROFILES
    environment[_PROFILES_FILE] = str(_PROFILES / profiles)
