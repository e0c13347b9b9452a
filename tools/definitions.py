# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Renew `masmc_ros/messages/definitions.json`: `python tools/definitions.py`."""

from __future__ import annotations

import json

from masmc_ros.messages.definitions import definition_of_jazzy, KEPT
from masmc_ros.messages.topics import SYSTEM_TOPICS, TOPICS


def kept() -> str:
    """Return what the file should hold: text and hash of the types of the package's topics."""
    names = sorted({topic.type_name for topic in (*TOPICS, *SYSTEM_TOPICS)})
    return json.dumps({name: definition_of_jazzy(name) for name in names}, indent=1) + '\n'


if __name__ == '__main__':
    KEPT.write_text(kept(), 'utf-8')
