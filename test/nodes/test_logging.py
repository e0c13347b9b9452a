# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What a line that is logged costs, in calls of functions."""

from __future__ import annotations

import subprocess
import sys

_PROGRAM = """
import sys
import masmc_ros.nodes.controller.node
from masmc_ros.nodes.middleware.logging import prepare_logging
from rclpy.logging import get_logger

if sys.argv[1] == 'prepared':
    prepare_logging()
counts = []

def count(frame, event, argument):
    counts[-1] += event == 'call'

def log(text):
    counts.append(0)
    sys.setprofile(count)
    get_logger('test').warning(text)
    sys.setprofile(None)

log('the first')
log('the second')
print(*counts)
"""


def calls(kind: str) -> list[int]:
    """Return how many functions the first and the second line call."""
    program = [sys.executable, '-c', _PROGRAM, kind]
    ended = subprocess.run(program, check=True, capture_output=True, text=True, timeout=120)
    return [int(each) for each in ended.stdout.split()]


def test_the_first_line_costs_no_more_than_others() -> None:
    """A node is not held up by its first warning; without what it prepares it would be."""
    first, second = calls('prepared')
    assert first < 3 * second
    first, second = calls('as it is')
    assert first > 5 * second
