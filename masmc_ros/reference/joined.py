# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Motion that continues a reference without a jump.

At the start the motion and the reference up to there differ in position, velocity and
acceleration. The difference is added to the motion, and decays to zero as that of an approach does
(`robot/approach_blend.py`).
"""

from __future__ import annotations

from typing import Protocol

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import kernel
from masmc_ros.reference.approach import PEAK
from masmc_ros.reference.joint_path import JointPath, JointState, JointTask
from masmc_ros.reference.pose_path import TaskPath
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.approach_blend import decayed, SHORTEST
from masmc_ros.robot.robot import Robot
import numpy as np


class Motion(Protocol):
    """
    Motion in task coordinates from its start on; it holds its end.

    Attributes
    ----------
    end
        Time of its end in s.

    """

    end: float

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s."""
        ...


class TrajectoryMotion:
    """
    Motion of a trajectory from its time 0 on.

    Attributes
    ----------
    end
        A time in s after every run, because a trajectory may have no end.

    """

    end = 1e9

    def __init__(self, trajectory: Trajectory) -> None:
        """Initialise the motion."""
        self._trajectory = trajectory

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s."""
        return self._trajectory.at_times(times)


class JoinedMotion:
    """
    Motion on the control grid, from a tick and a sample of the reference on.

    Attributes
    ----------
    motion
        The motion.
    tick
        Its first tick on the grid.

    """

    def __init__(
        self,
        motion: Motion,
        start: Array,
        *,
        tick: int,
        period: float,
        offset: float = 0.0,
        speed: float,
    ) -> None:
        """
        Join a motion to a reference.

        Parameters
        ----------
        motion
            Motion from the tick on.
        start
            Sample (3 axes) of the reference at the tick.
        tick
            First tick of the motion.
        period
            Control period in s.
        offset
            Time in s of the motion at this tick.
        speed
            Largest velocity of the decaying difference on an axis in m/s or rad/s, apart from that
            of the reference. The decay takes at least half a second.

        """
        self.motion, self.tick = motion, tick
        self._period, self._offset = period, offset
        self._difference = start - motion.sample(np.array([offset]))[0]
        way = float(np.abs(self._difference[:len(start) // 3]).max())
        self._duration = max(SHORTEST, PEAK * way / speed)

    @property
    def last(self) -> int:
        """Return the last tick at which the samples move."""
        duration = max(self._duration, self.motion.end - self._offset)
        return self.tick + int(np.ceil(duration / self._period))

    def time(self, tick: int) -> float:
        """Return the time in s of the motion at a tick."""
        return self._offset + (tick - self.tick) * self._period

    def sample(self, first: int, count: int) -> Array:
        """Return (count, 3 axes) samples at ticks first, first + 1, ..., none before `tick`."""
        ticks = np.arange(first - self.tick, first - self.tick + count, dtype=np.float64)
        elapsed = ticks * self._period
        samples = self.motion.sample(self._offset + elapsed)
        _add_decayed(self._difference, self._duration, elapsed, samples)
        return samples


def load_code(robot: Robot) -> None:
    """Load the compiled code of paths from messages for a robot, or compile it."""
    state = JointState.at_rest(np.zeros(len(robot.mechanism.positions)))
    sample = np.zeros(3 * len(robot.mechanism.axes))
    motion = JointTask(JointPath.braking(state, 1.0), robot, sample[:len(sample) // 3])
    JoinedMotion(motion, sample, tick=0, period=1.0, speed=1.0).sample(0, 1)
    path = TaskPath.braking(sample, 1.0)
    if robot.mechanism.carrier is not None:
        path.with_base(robot, sample[:len(sample) // 3])


@kernel
def _add_decayed(difference: Array, duration: float, elapsed: Array, samples: Array) -> None:
    """Add what is left of a difference (3 axes) to samples (n, 3 axes), `elapsed` (n) s later."""
    axes = len(difference) // 3
    for k in range(len(elapsed)):
        part = max(elapsed[k] / duration, 0.0)
        if part < 1.0:
            for i in range(axes):
                x, v, a = decayed(
                    difference[i], difference[axes + i], difference[2 * axes + i], duration, part
                )
                samples[k, i] += x
                samples[k, axes + i] += v
                samples[k, 2 * axes + i] += a
