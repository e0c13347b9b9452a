# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Transforms computed from logged states, if no node publishes them."""

from __future__ import annotations

from masmc_ros.loop.timing import Timing
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.transforms import TransformsCdr
from masmc_ros.params.declaration import Values
from masmc_ros.robot.mechanisms import check_frame_prefix, joint_names
from masmc_ros.robot.robot import robot_of


class StateTransforms:
    """Conversion of joint states to the messages of a plant on /tf."""

    def __init__(self, values: Values) -> None:
        """
        Initialise with the checked parameter values of the plant.

        Raises InputError for an invalid robot or prefix of frame names.
        """
        self._decimation: int = values['tf_decimation']
        self._timing = Timing.from_values(values)
        self._robot = robot_of(values)
        self._state = JointStateCdr(joint_names(values))
        prefix = check_frame_prefix(values['frame_prefix'])
        self._message = TransformsCdr(prefix, self._robot.mechanism.frames)

    def of_state(self, raw: bytes) -> bytes | None:
        """
        Return the TFMessage of a joint state.

        Parameters
        ----------
        raw
            Joint state with its encapsulation header.

        Returns
        -------
            Serialised message; None for another layout, and for ticks that the decimation skips.

        """
        state = self._state
        if not (self._decimation and state.load(raw)):
            return None
        tick = round(state.stamp_ns / (1e9 * self._timing.period))
        if tick % self._decimation and tick != self._timing.last:
            return None
        return self._message.fill(
            state.stamp_ns, self._robot.frame_transforms(state.position[None])[0]
        )
