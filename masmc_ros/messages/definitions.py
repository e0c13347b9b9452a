# SPDX-License-Identifier: Apache-2.0
"""Message definitions of ROS 2 Jazzy: their text and hash, as a log keeps them."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple, TYPE_CHECKING

from masmc_ros.errors import InputError, suggestion

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


class Definition(NamedTuple):
    """What a message is.

    Attributes:
        text: the definition with those that it is made of, in the form `ros2msg`.
        hash: the version hash of REP-2011, `RIHS01_...`.
    """

    text: str
    hash: str


@cache
def _store() -> Typestore:
    # Imported when first needed: it takes 0.1 s, and a plant needs no definitions.
    from rosbags.typesys import get_typestore, Stores

    return get_typestore(Stores.ROS2_JAZZY)


@cache
def definition(type_name: str) -> Definition:
    """Return the definition of a message type.

    Args:
        type_name: such as `sensor_msgs/msg/JointState`.

    Raises:
        InputError: for a type that is none of Jazzy's own.
    """
    store = _store()
    if type_name not in store.fielddefs:
        raise InputError(
            f"message type '{type_name}' is not one of ROS 2 Jazzy's own:"
            f' {suggestion(type_name, store.fielddefs)}'
        )
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    return Definition(text, store.hash_rihs01(type_name))
