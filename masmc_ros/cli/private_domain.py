# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Private ROS domain on this machine, separate from other runs and robots."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
import fcntl
import os
import random
import socket

from masmc_ros.errors import UserError
from masmc_ros.user_folder import runtime_folder

_DOMAINS = range(1, 102)
"""Domains whose ports lie below those that the system assigns automatically."""


@contextmanager
def private_domain() -> Iterator[dict[str, str]]:
    """
    Yield the environment variables of a domain that no other run uses.

    Raises UserError if all are in use.
    """
    used = os.environ.get('ROS_DOMAIN_ID', '0')
    candidates = [domain for domain in _DOMAINS if str(domain) != used]
    random.shuffle(candidates)
    with locked_domain(candidates) as domain:
        yield {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


@contextmanager
def locked_domain(candidates: Iterable[int]) -> Iterator[int]:
    """
    Yield the first unused domain that no other process of this user has locked.

    Raises UserError if all are in use.
    """
    folder = runtime_folder()
    for domain in candidates:
        path = folder / f'domain_{domain}.lock'
        try:
            lock = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        except OSError:
            continue  # for example a link
        try:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            if not _is_used(domain):
                yield domain
                return
        finally:
            os.close(lock)
    raise UserError('no free ROS domain on this machine; end other runs of masmc demo')


def _is_used(domain: int) -> bool:
    """Return True if a process of any user has the port of the first node of a domain."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', 7410 + 250 * domain))
        except OSError:
            return True
    return False
