# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Random robots and states for property tests, and functions shared by tests of the model."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from masmc_ros.robot.robot import Robot
from masmc_ros.robot.two_link.constants import base_parameters
from masmc_ros.robot.two_link.dynamics import BaseParameters
from masmc_ros.robot.two_link.geometry import Geometry, motion, Posture
from masmc_ros.robot.two_link.kinematics import SINGULAR_SINE
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
from numpy.typing import ArrayLike, NDArray

Quad = tuple[float, float, float, float]
Array = NDArray[np.float64]

PROPERTY = settings(max_examples=100)

STEP = 1.0e-30
"""Complex step: the imaginary part of f(x + i STEP xdot) is STEP fdot without rounding."""

DEFAULT = {
    'wheel_radius': 0.0508,
    'half_track': 0.182,
    'com_offset': 0.0,
    'arm_offset': 0.116,
    'link_1_length': 0.514,
    'link_2_length': 0.362,
    'link_1_com': 0.252,
    'link_2_com': 0.243,
    'platform_mass': 17.25,
    'wheel_mass': 0.159,
    'link_1_mass': 2.56,
    'link_2_mass': 1.07,
    'platform_inertia': 0.297,
    'wheel_spin_inertia': 0.0002,
    'wheel_yaw_inertia': 0.0,
    'link_1_inertia': 0.148,
    'link_2_inertia': 0.0228,
}

AXES = TWO_LINK.sizes['axes']
BASE_PARAMETERS = TWO_LINK.sizes['parameters']


def task_positions(geometry: ArrayLike, position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (x_E, y_E, x_F, y_F) (n, 4) in m from lengths (5) and positions (n, 7)."""
    robot = Robot(TWO_LINK, {}, np.asarray(geometry, dtype=np.float64), np.zeros(BASE_PARAMETERS))
    return robot.task_positions(position)


@dataclass(frozen=True)
class Machine:
    """Robot: its physical parameters, and the arguments of compiled functions."""

    physical: dict[str, float]

    @property
    def geometry(self) -> Geometry:
        """Return the lengths in the order of Geometry."""
        p = self.physical
        return Geometry(
            p['wheel_radius'],
            p['half_track'],
            p['com_offset'] + p['arm_offset'],
            p['link_1_length'],
            p['link_2_length'],
        )

    @property
    def theta(self) -> BaseParameters:
        """Return the base inertial parameters."""
        return base_parameters(**self.physical)


def between(low: float, high: float) -> st.SearchStrategy[float]:
    """Return a strategy of numbers in [low, high]."""
    return st.floats(low, high, allow_nan=False)


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    """Draw a physically valid robot: positive masses, and centres of mass on the links."""
    p = {
        'wheel_radius': draw(between(0.03, 0.3)),
        'half_track': draw(between(0.1, 0.6)),
        'com_offset': draw(between(-0.2, 0.3)),
        'link_1_length': draw(between(0.1, 1.0)),
        'link_2_length': draw(between(0.1, 1.0)),
        'platform_mass': draw(between(2.0, 80.0)),
        'wheel_mass': draw(between(0.0, 3.0)),
        'link_1_mass': draw(between(0.2, 8.0)),
        'link_2_mass': draw(between(0.2, 8.0)),
        'platform_inertia': draw(between(0.02, 8.0)),
        'wheel_spin_inertia': draw(between(0.0, 0.02)),
        'wheel_yaw_inertia': draw(between(0.0, 0.02)),
        'link_1_inertia': draw(between(1.0e-3, 0.5)),
        'link_2_inertia': draw(between(1.0e-3, 0.5)),
    }
    # The arm's base is in front of the axle or behind it, not on it.
    arm_base = draw(between(0.05, 0.8)) * draw(st.sampled_from((-1.0, 1.0)))
    p['arm_offset'] = arm_base - p['com_offset']
    p['link_1_com'] = p['link_1_length'] * draw(between(0.0, 1.0))
    p['link_2_com'] = p['link_2_length'] * draw(between(0.0, 1.0))
    return Machine(p)


@dataclass(frozen=True)
class Angles:
    """Yaw and joint angles of the arm in rad."""

    yaw: float
    arm_1: float
    arm_2: float

    def moving(self, rate: Quad) -> Posture:
        """Return the posture; its imaginary part is STEP times its rate for a quasi-velocity."""
        _, w, a, b = rate
        return trigonometry(
            self.yaw + 1j * STEP * w,
            self.arm_1 + 1j * STEP * (a - w),
            self.arm_2 + 1j * STEP * (b - a),
        )


def trigonometry(yaw: complex, arm_1: complex, arm_2: complex) -> Posture:
    """Return sines and cosines computed by NumPy, real or complex."""
    c, s = np.cos, np.sin
    values = c(yaw), s(yaw), c(arm_1), s(arm_1), c(arm_2), s(arm_2)
    return Posture(*(v.item() for v in (*values, c(arm_1 + arm_2), s(arm_1 + arm_2))))


ANGLE = between(-4.0, 4.0)


@st.composite
def regular_angles(draw: st.DrawFn) -> Angles:
    """Draw angles of an arm that is neither straight nor folded."""
    bend = draw(between(1.01 * SINGULAR_SINE, math.pi - 1.01 * SINGULAR_SINE))
    sign = draw(st.sampled_from((-1.0, 1.0)))
    return Angles(draw(ANGLE), draw(ANGLE), sign * bend)


@st.composite
def all_angles(draw: st.DrawFn) -> Angles:
    """Draw any angles, including those of straight and folded arms."""
    near = st.sampled_from((0.0, -0.0, math.pi, -math.pi, 1.0e-12, 0.01, 0.02, -0.0199))
    return Angles(draw(ANGLE), draw(ANGLE), draw(st.one_of(ANGLE, near)))


def quads(size: float = 3.0) -> st.SearchStrategy[Quad]:
    """Return a strategy of four numbers: quasi-velocities, quasi-forces, task vectors."""
    entry = between(-size, size)
    return st.tuples(entry, entry, entry, entry)


UNITS: tuple[Quad, ...] = (
    (1.0, 0.0, 0.0, 0.0),
    (0.0, 1.0, 0.0, 0.0),
    (0.0, 0.0, 1.0, 0.0),
    (0.0, 0.0, 0.0, 1.0),
)


def columns(function: Any) -> NDArray[Any]:
    """Return the 4 x 4 matrix of a linear map of four numbers."""
    return np.array([function(*unit) for unit in UNITS]).T


def quasi_map(geometry: Geometry) -> Array:
    """Return the constant matrix (4 x 4) from reduced velocities to quasi-velocities."""
    return columns(lambda *v: motion(geometry, v))


def assert_agree(actual: ArrayLike, expected: ArrayLike, rel: float, scale: float = 0.0) -> None:
    """Compare two arrays, relative to the larger of their size and `scale`."""
    values, references = np.asarray(actual), np.asarray(expected)
    assert values.shape == references.shape
    assert np.isfinite(values).all()
    assert np.isfinite(references).all()
    size = max(scale, float(np.abs(references).max()), np.finfo(float).tiny)
    difference = float(np.abs(values - references).max())
    assert difference <= rel * size, f'{difference / size:.2e} of {size:.3e}, limit {rel:.0e}'
