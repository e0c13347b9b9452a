# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Preparation of rcl in a process of this package: transport, log files, and the first log line.

`client_node` is the node of a command that talks to running nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import inspect
import os
from pathlib import Path

from masmc_ros.user_folder import runtime_folder
import rclpy
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_rmw_implementation_identifier

_PROFILES = Path(__file__).with_name('fast_dds')

_BUILT_IN = 'FASTDDS_BUILTIN_TRANSPORTS'

_PROFILES_FILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'

_LOCAL_PROFILES = 'DEFAULT_FASTRTPS_PROFILES.xml'
"""Profiles that Fast DDS reads from the working directory."""

_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'

_AS_IN_PROFILES = 'SYSTEM_DEFAULT'


def prepare_rcl() -> None:
    """Prepare transport and log files; call this before rclpy is initialized."""
    prepare_transport()
    prepare_log_folder()


def prepare_transport() -> None:
    """
    Restrict the nodes that this process creates from here on to UDP.

    A killed process cannot block UDP. Fast DDS prefers shared memory and guards it by mutexes
    within that memory. If a subscriber is killed while it holds one, its publishers block in
    `publish` indefinitely and ignore SIGINT (ros2/rmw_fastrtps issue 908, "Long running ROS stacks
    reaching deadlock with shared memory"). This function and `fast_dds/` can be removed when
    publishers on shared memory pass `test/nodes/recorder/test_listeners_killed.py`.

    Nothing changes with another middleware, or if the user has chosen transports
    (FASTDDS_BUILTIN_TRANSPORTS) or profiles of Fast DDS.
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


_CONFIGURED = ('ROS_LOG_DIR', 'ROS_HOME')


def prepare_log_folder() -> None:
    """
    Let rcl write its log files into the user's runtime folder if the home cannot take them.

    rcl writes into `~/.ros/log`, and no node starts if that is not possible. This function can be
    removed when nodes start without it (`test/cli/test_environment.py`).

    Nothing changes if the user has chosen a folder.
    """
    if any(os.environ.get(name) for name in _CONFIGURED):
        return
    home = os.environ.get('HOME')
    if not home or not _is_writable(Path(home) / '.ros' / 'log'):
        os.environ[_CONFIGURED[0]] = str(runtime_folder() / 'log')


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def prepare_logging() -> None:
    """
    Fill the cache that maps modules to their files, so the first log line does not delay a tick.

    rclpy looks up the caller of each log line by `inspect.getframeinfo` (`_find_caller` in
    rclpy/impl/rcutils_logger.py of rclpy 7.1). Its first call inspects all modules of the process:
    50 ms, and a third of a second on a busy machine. Later calls use a cache. No upstream issue is
    known. This function can be removed when rclpy takes the file name from the code object.
    """
    frame = inspect.currentframe()
    if frame is not None:
        inspect.getframeinfo(frame)


@contextmanager
def client_node(name: str, domain: int | None = None) -> Iterator[tuple[Node, Executor]]:
    """Yield a node and its executor, in a ROS domain; None: that of the environment."""
    prepare_rcl()
    context = Context()
    options = SignalHandlerOptions.NO
    # Without the arguments of the command: rcl accepts only UTF-8.
    rclpy.init(args=[], context=context, domain_id=domain, signal_handler_options=options)
    node = rclpy.create_node(name, context=context, enable_rosout=False)
    executor = EventsExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
        context.try_shutdown()
