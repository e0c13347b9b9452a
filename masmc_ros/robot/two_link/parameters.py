# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The robot's physical parameters, and the lengths and base parameters made of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot.two_link.dynamics import BaseParameters
from masmc_ros.robot.two_link.geometry import Geometry
import numpy as np
from numpy.typing import NDArray

_SHORTEST_ARM_BASE = 1.0e-3


def _length(name: str, default: float, description: str, *, positive: bool = True) -> Parameter:
    bounds: dict[str, Any] = {'minimum': 0.0, 'exclusive_minimum': True} if positive else {}
    return Parameter(f'robot.{name}', default, description, unit='m', **bounds)


def _inertial(
    name: str, default: float, description: str, unit: str, *, positive: bool
) -> Parameter:
    return Parameter(
        f'robot.{name}',
        default,
        description,
        unit=unit,
        minimum=0.0,
        exclusive_minimum=positive,
    )


ROBOT = (
    _length('wheel_radius', 0.0508, 'Radius r of the driving wheels'),
    _length('half_track', 0.182, 'Half the distance b between the driving wheels'),
    _length(
        'com_offset', 0.0, "Platform's centre of mass C ahead of the axle, d", positive=False
    ),
    _length('arm_offset', 0.116, "Arm's base F ahead of C, L_a", positive=False),
    _length('link_1_length', 0.514, 'Length L_1 of link 1'),
    _length('link_2_length', 0.362, 'Length L_2 of link 2'),
    _length('link_1_com', 0.252, 'Joint 1 to the centre of mass of link 1, l_c1', positive=False),
    _length('link_2_com', 0.243, 'Joint 2 to the centre of mass of link 2, l_c2', positive=False),
    _inertial('platform_mass', 17.25, 'Mass m_c of the platform', 'kg', positive=True),
    _inertial('wheel_mass', 0.159, 'Mass m_w of each wheel', 'kg', positive=False),
    _inertial('link_1_mass', 2.56, 'Mass m_1 of link 1', 'kg', positive=True),
    _inertial('link_2_mass', 1.07, 'Mass m_2 of link 2', 'kg', positive=True),
    _inertial(
        'platform_inertia',
        0.297,
        'Yaw inertia I_c of the platform about C',
        'kg·m²',
        positive=True,
    ),
    _inertial(
        'wheel_spin_inertia',
        0.0002,
        'Inertia I_w of each wheel about its axle',
        'kg·m²',
        positive=False,
    ),
    _inertial(
        'wheel_yaw_inertia', 0.0, 'Yaw inertia I_m of each wheel', 'kg·m²', positive=False
    ),
    _inertial(
        'link_1_inertia',
        0.148,
        'Inertia I_1 of link 1 about its centre of mass',
        'kg·m²',
        positive=True,
    ),
    _inertial(
        'link_2_inertia',
        0.0228,
        'Inertia I_2 of link 2 about its centre of mass',
        'kg·m²',
        positive=True,
    ),
)
"""Parameters of every node that needs the robot; defaults are a published platform and arm."""


@dataclass(frozen=True)
class Robot:
    """A robot as the formulas take it."""

    geometry: NDArray[np.float64]
    """Lengths (5) in m, in the order of Geometry."""
    theta: NDArray[np.float64]
    """Base inertial parameters (7) in the order of BaseParameters."""
    com_offset: float
    """d in m, from the axle's middle O to the platform's centre of mass C."""

    @property
    def reach(self) -> tuple[float, float]:
        """Smallest and largest distance of the end effector from the arm's base, in m."""
        lengths = Geometry(*self.geometry)
        return abs(lengths.link_1 - lengths.link_2), lengths.link_1 + lengths.link_2

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> Robot:
        """
        Make a robot from checked parameter values, names as declared in ROBOT.

        Raises InputError where the arm's base lies on the axle: its sideways motion would
        then not depend on the platform's rotation, and (3) could not be inverted.
        """
        p = {name.removeprefix('robot.'): value for name, value in values.items()}
        arm_base = p['com_offset'] + p['arm_offset']
        if abs(arm_base) < _SHORTEST_ARM_BASE:
            raise InputError(
                f'robot.com_offset + robot.arm_offset = {arm_base:g}: expected at least '
                f'{_SHORTEST_ARM_BASE:g} m between the axle and the base of the arm'
            )
        geometry = Geometry(
            p['wheel_radius'],
            p['half_track'],
            arm_base,
            p['link_1_length'],
            p['link_2_length'],
        )
        theta = base_parameters(**p)
        return cls(np.array(geometry), np.array(theta), p['com_offset'])


def base_parameters(
    *,
    wheel_radius: float,
    half_track: float,
    com_offset: float,
    arm_offset: float,
    link_1_length: float,
    link_2_length: float,
    link_1_com: float,
    link_2_com: float,
    platform_mass: float,
    wheel_mass: float,
    link_1_mass: float,
    link_2_mass: float,
    platform_inertia: float,
    wheel_spin_inertia: float,
    wheel_yaw_inertia: float,
    link_1_inertia: float,
    link_2_inertia: float,
) -> BaseParameters:
    """Return theta (7) of a robot given by its physical parameters (m, kg, kg m2)."""
    arm_mass = link_1_mass + link_2_mass
    arm_base = com_offset + arm_offset
    spin = 2.0 * wheel_spin_inertia / (wheel_radius * wheel_radius)
    return BaseParameters(
        mass=platform_mass + 2.0 * wheel_mass + spin + arm_mass,
        yaw_inertia=platform_inertia
        + platform_mass * com_offset * com_offset
        + 2.0 * wheel_yaw_inertia
        + 2.0 * wheel_mass * half_track * half_track
        + spin * half_track * half_track
        + arm_mass * arm_base * arm_base,
        offset=platform_mass * com_offset + arm_mass * arm_base,
        moment_1=link_1_mass * link_1_com + link_2_mass * link_1_length,
        moment_2=link_2_mass * link_2_com,
        inertia_1=link_1_inertia
        + link_1_mass * link_1_com * link_1_com
        + link_2_mass * link_1_length * link_1_length,
        inertia_2=link_2_inertia + link_2_mass * link_2_com * link_2_com,
    )
