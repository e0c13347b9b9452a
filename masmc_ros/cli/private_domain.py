# SPDX-License-Identifier: Apache-2.0
"""A ROS domain of one's own on this machine, so that a run meets no other and no robot."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import fcntl
import os
from pathlib import Path
import random
import tempfile

from masmc_ros.errors import UserError

_DOMAINS = range(1, 102)
"""Domains whose ports lie below those that the system hands out by itself."""


@contextmanager
def private_domain() -> Iterator[dict[str, str]]:
    """Yield environment variables of a domain that no other such run uses meanwhile.

    Raises UserError where all are taken.
    """
    used = os.environ.get('ROS_DOMAIN_ID', '0')
    candidates = [domain for domain in _DOMAINS if str(domain) != used]
    random.shuffle(candidates)
    for domain in candidates:
        path = Path(tempfile.gettempdir()) / f'masmc_ros_domain_{domain}.lock'
        try:
            lock = path.open('w')
        except OSError:
            continue  # another user's
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            yield {
                'ROS_DOMAIN_ID': str(domain),
                'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            }
            return
    raise UserError('no free ROS domain on this machine; end other runs of masmc demo')
