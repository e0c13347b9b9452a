# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Generator of `masmc_ros/messages/definitions.json`: `python tools/definitions.py`."""

from __future__ import annotations

import json

from masmc_ros.messages.cdr_layout import definition_of_jazzy, KEPT
from masmc_ros.messages.path import POSE_STAMPED
from masmc_ros.messages.topics import SYSTEM_TOPICS, TOPICS, TWIST_STAMPED


def expected_content() -> str:
    """Return the expected content of the file: text and hash of the types of all layouts."""
    types = {topic.type_name for topic in (*TOPICS, *SYSTEM_TOPICS)}
    names = sorted(types | {TWIST_STAMPED, POSE_STAMPED})
    return json.dumps({name: definition_of_jazzy(name) for name in names}, indent=1) + '\n'


if __name__ == '__main__':
    KEPT.write_text(expected_content(), 'utf-8')
