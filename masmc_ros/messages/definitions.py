# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Message definitions of ROS 2 Jazzy: their text and hash, as a log keeps them.

Those of the package's own topics are next to this file, written by `tools/definitions.py`.
"""

from __future__ import annotations

from functools import cache
import json
from pathlib import Path
from typing import NamedTuple, TYPE_CHECKING

from masmc_ros.errors import InputError, suggestion

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


class Definition(NamedTuple):
    """
    What a message is.

    Attributes
    ----------
    text
        the definition with those that it is made of, in the form `ros2msg`.
    type_hash
        the version hash of REP-2011, `RIHS01_...`.

    """

    text: str
    type_hash: str


KEPT = Path(__file__).with_suffix('.json')
"""Text and hash of the types that every run needs: all of Jazzy's take 0.15 s to load."""


@cache
def _kept() -> dict[str, list[str]]:
    found: dict[str, list[str]] = json.loads(KEPT.read_text('utf-8'))
    return found


@cache
def _store() -> Typestore:
    from rosbags.typesys import get_typestore, Stores

    return get_typestore(Stores.ROS2_JAZZY)


@cache
def definition(type_name: str) -> Definition:
    """
    Return the definition of a message type.

    Parameters
    ----------
    type_name
        such as `sensor_msgs/msg/JointState`.

    Raises
    ------
    InputError
        for a type that is none of Jazzy's own.

    """
    kept = _kept().get(type_name)
    return Definition(*kept) if kept else definition_of_jazzy(type_name)


def definition_of_jazzy(type_name: str) -> Definition:
    """Return the same from the library that has all types."""
    store = _store()
    if type_name not in store.fielddefs:
        raise InputError(
            f"message type '{type_name}' is not one of ROS 2 Jazzy's own:"
            f' {suggestion(type_name, store.fielddefs)}'
        )
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    return Definition(text, store.hash_rihs01(type_name))
