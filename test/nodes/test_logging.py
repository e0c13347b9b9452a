# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Cost of a log line, measured in function calls."""

from __future__ import annotations

import subprocess
import sys

_PROGRAM = """
import sys
import masmc_ros.nodes.controller.node
from masmc_ros.nodes.middleware.rcl_setup import prepare_logging
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
    """Return the number of function calls of the first and of the second line."""
    program = [sys.executable, '-c', _PROGRAM, kind]
    result = subprocess.run(program, check=True, capture_output=True, text=True, timeout=120)
    return [int(count) for count in result.stdout.split()]


def test_prepared_logging_first_line_not_expensive() -> None:
    """The first warning does not delay a node; without the preparation it would."""
    first, second = calls('prepared')
    assert first < 3 * second
    first, second = calls('unprepared')
    assert first > 5 * second
