# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What processes that tests start find in their environment, a ROS domain of their own with it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import itertools
import os
import random
import sys
from typing import Protocol, TypeVar

from masmc_ros.cli.private_domain import locked_domain

_DOMAINS = range(20, 60)
AnyStarted = TypeVar('AnyStarted', bound='Started')
_turn = itertools.count(random.randrange(len(_DOMAINS)))


def surroundings() -> dict[str, str]:
    """Return environment variables with which a child imports what this process imports."""
    path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
    return {
        **os.environ,
        'PYTHONPATH': path,
        'PYTHONFAULTHANDLER': '1',
        'RCUTILS_COLORIZED_OUTPUT': '0',
    }


def domain_variables(domain: int) -> dict[str, str]:
    """Return environment variables of a domain that does not leave this machine."""
    return {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


class Started(Protocol):
    """Processes of a test."""

    def tell(self) -> None:
        """Print what they printed."""

    def end(self) -> None:
        """End those that still run."""


@contextmanager
def ended(started: AnyStarted) -> Iterator[AnyStarted]:
    """Yield processes that end with the test, and tell what they printed where it fails."""
    try:
        yield started
    except BaseException:
        started.tell()
        raise
    finally:
        started.end()


@contextmanager
def domain() -> Iterator[int]:
    """Yield the next domain that nobody else uses meanwhile."""
    first = next(_turn)
    turns = (_DOMAINS[(first + number) % len(_DOMAINS)] for number in range(len(_DOMAINS)))
    with locked_domain(turns) as number:
        yield number
