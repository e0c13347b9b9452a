# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Quality of service of a topic in a log, which a player offers again."""

from __future__ import annotations

from dataclasses import dataclass

_INFINITE = 'sec: 9223372036\n    nsec: 854775807'


@dataclass(frozen=True)
class Qos:
    """
    Quality of service of a publisher, with the names of ROS 2's QoS policies.

    Attributes
    ----------
    depth
        number of messages in the history.
    history
        `keep_last` or `keep_all`.
    reliability
        `reliable` or `best_effort`.
    durability
        `volatile` or `transient_local`.

    """

    depth: int = 1000
    history: str = 'keep_last'
    reliability: str = 'reliable'
    durability: str = 'volatile'

    def to_yaml(self) -> str:
        """Return an entry of the list `offered_qos_profiles` of rosbag2."""
        return (
            f'- history: {self.history}\n'
            f'  depth: {self.depth}\n'
            f'  reliability: {self.reliability}\n'
            f'  durability: {self.durability}\n'
            f'  deadline:\n    {_INFINITE}\n'
            f'  lifespan:\n    {_INFINITE}\n'
            '  liveliness: automatic\n'
            f'  liveliness_lease_duration:\n    {_INFINITE}\n'
            '  avoid_ros_namespace_conventions: false'
        )
