# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Message definitions of ROS 2 Jazzy, with text and hash, as in a log.

The file next to this one has those of the package's topics; `tools/definitions.py` writes it.
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
    Definition of a message type.

    Attributes
    ----------
    text
        Definition in the form `ros2msg`, with those of the types that it uses.
    type_hash
        Version hash of REP-2011, `RIHS01_...`.

    """

    text: str
    type_hash: str


KEPT = Path(__file__).with_suffix('.json')
"""Text and hash of the types of every run; loading all types of Jazzy takes 0.15 s."""


@cache
def _kept() -> dict[str, list[str]]:
    definitions: dict[str, list[str]] = json.loads(KEPT.read_text('utf-8'))
    return definitions


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
        Name such as `sensor_msgs/msg/JointState`.

    Raises
    ------
    InputError
        If Jazzy does not have the type.

    """
    kept = _kept().get(type_name)
    return Definition(*kept) if kept else definition_of_jazzy(type_name)


@cache
def members(type_name: str) -> dict[str, list[list[str]]]:
    """Return type and name of the members of a message type and of those that it uses, by type."""
    text = f'MSG: {type_name}\n{definition(type_name).text}'
    return {
        head.removeprefix('MSG: '): [line.split() for line in lines]
        for head, *lines in map(str.splitlines, text.split('=' * 80 + '\n'))
    }


def definition_of_jazzy(type_name: str) -> Definition:
    """Return the definition of a message type from the library, which has all types of Jazzy."""
    store = _store()
    if type_name not in store.fielddefs:
        raise InputError(
            f"message type '{type_name}' is not one of ROS 2 Jazzy's own:"
            f' {suggestion(type_name, store.fielddefs)}'
        )
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    return Definition(text, store.hash_rihs01(type_name))
