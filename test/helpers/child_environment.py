# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Environment of processes that tests start, with a separate ROS domain."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import itertools
import os
import random
import sys
from typing import Protocol, TypeVar

from masmc_ros.cli.node_processes import locked_domain

_DOMAINS = range(20, 60)
AnyStarted = TypeVar('AnyStarted', bound='Started')
_turn = itertools.count(random.randrange(len(_DOMAINS)))


def child_environment() -> dict[str, str]:
    """Return environment variables for a child process with this process's import path."""
    path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
    return {
        **os.environ,
        'PYTHONPATH': path,
        'PYTHONFAULTHANDLER': '1',
        'RCUTILS_COLORIZED_OUTPUT': '0',
    }


def domain_variables(domain: int) -> dict[str, str]:
    """Return environment variables of a ROS domain that is limited to this machine."""
    return {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


class Started(Protocol):
    """Processes of a test."""

    def print_output(self) -> None:
        """Print their output."""

    def end(self) -> None:
        """Kill those that still run."""


@contextmanager
def ended(started: AnyStarted) -> Iterator[AnyStarted]:
    """Yield processes that end with the test; print their output if the test fails."""
    try:
        yield started
    except BaseException:
        started.print_output()
        raise
    finally:
        started.end()


@contextmanager
def domain() -> Iterator[int]:
    """Yield the next ROS domain that no other process uses."""
    first = next(_turn)
    turns = (_DOMAINS[(first + number) % len(_DOMAINS)] for number in range(len(_DOMAINS)))
    with locked_domain(turns) as number:
        yield number
