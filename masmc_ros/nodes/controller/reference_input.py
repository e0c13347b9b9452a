# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The reference as it comes: windows that lie over one another, and set-points."""

from __future__ import annotations

from collections.abc import Callable

from masmc_ros.errors import InputError
from masmc_ros.messages.names import REFERENCE_TOPIC
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.nodes.middleware.messages import deserialized
from masmc_ros.nodes.middleware.past import subscribe_with_past
from masmc_ros.nodes.process.refusals import Refusals
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray


class ReferenceInput:
    """Reads the reference topic."""

    def __init__(
        self,
        node: Node,
        axes: int,
        refusals: Refusals,
        on_reference: Callable[[ReferenceWindow], None],
    ) -> None:
        """Pass on messages with this number of task axes; an InputError rejects one."""
        self._axes = axes
        self._refusals = refusals
        self._on_reference = on_reference
        subscribe_with_past(node, Float64MultiArray, REFERENCE_TOPIC, self._take, depth=100)

    def _take(self, raw: bytes) -> None:
        try:
            window = ReferenceWindow.from_bytes(raw, self._axes)
            if window is None:
                message = deserialized(raw, Float64MultiArray)
                window = ReferenceWindow.from_message(message, self._axes)
            self._on_reference(window)
        except InputError as error:
            self._refusals.add(REFERENCE_TOPIC, error)
