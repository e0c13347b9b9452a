# SPDX-License-Identifier: Apache-2.0
"""The controller's parameters: gains, what lets adaptation last, limits."""

from __future__ import annotations

from typing import Any

from masmc_ros.law import registry
from masmc_ros.law.command_interface import COMMAND_INTERFACE, ENABLE_STAMPED_CMD_VEL
from masmc_ros.law.parts.velocity_estimator import SOURCES
from masmc_ros.numerics.limits import TORQUE_LIMIT, TORQUE_RATE_LIMIT
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import AXES, BASE_PARAMETERS

ADAPTATION = (
    Parameter(
        'leakage',
        0.02,
        'Rate at which theta_hat returns to the nominal model (sigma-modification); 0 is off',
        unit='1/s',
        minimum=0.0,
        read_only=False,
    ),
    Parameter(
        'e_modification',
        0.0,
        'Leakage in proportion to |s| outside the dead zone; 0 is off',
        unit='1/m',
        minimum=0.0,
        read_only=False,
    ),
    Parameter(
        'dead_zone',
        0.0,
        'Norm |s| within which nothing is learned; 0 is none',
        unit='m/s',
        minimum=0.0,
        read_only=False,
    ),
    Parameter(
        'projection.lower',
        0.2,
        'Least theta_hat as a multiple of the nominal model; 0 is no projection',
        minimum=0.0,
        maximum=1.0,
        exclusive_maximum=True,
        read_only=False,
    ),
    Parameter(
        'projection.upper',
        5.0,
        'Largest theta_hat as a multiple of the nominal model, with projection',
        minimum=1.0,
        exclusive_minimum=True,
        read_only=False,
    ),
    Parameter(
        'freeze_when_saturated',
        True,
        'Learn nothing while torque_limit or torque_rate_limit cuts the torque',
        read_only=False,
    ),
)
"""What lets the adaptation last."""


def _limit(
    name: str, default: tuple[float, ...], description: str, unit: str
) -> Parameter:
    return Parameter(
        name,
        default,
        f'{description}, on wheel_right, wheel_left, arm_1, arm_2; 0 is none',
        unit=unit,
        length=AXES,
        size='joints',
        broadcast=True,
        minimum=0.0,
        read_only=False,
    )


LIMITS = (
    _limit('torque_limit', TORQUE_LIMIT, 'Limit of the commanded torque', 'N·m'),
    _limit('torque_rate_limit', TORQUE_RATE_LIMIT, 'Limit of its change per time', 'N·m/s'),
)


ESTIMATOR = (
    Parameter(
        'velocity_source',
        'measured',
        'Rates as measured, or estimated from the joint angles alone',
        choices=SOURCES,
        read_only=False,
    ),
    Parameter(
        'estimator_bandwidth',
        1000.0,
        'Bandwidth of the velocity estimator',
        unit='rad/s',
        minimum=0.0,
        exclusive_minimum=True,
        read_only=False,
    ),
)


def _gain(name: str, default: float, description: str, unit: str, **bounds: Any) -> Parameter:
    return Parameter(
        name,
        (default,) * AXES,
        f'{description}, per task axis x_E, y_E, x_F, y_F',
        unit=unit,
        length=AXES,
        size='axes',
        broadcast=True,
        minimum=0.0,
        read_only=False,
        **bounds,
    )


def parameters() -> tuple[Parameter, ...]:
    """Return the controller's declarations, those of plugged-in laws with them."""
    return (
        Parameter('law', 'rasmc', 'Control law', choices=registry.names(), read_only=False),
        _gain('k_s1', 100.0, 'Gain K_s1 of the linear reaching term', 'N·s/m'),
        _gain('k_s2', 100.0, 'Gain K_s2 of the switching term', 'N'),
        _gain('sigma', 2.0, 'Slope sigma of the sliding surface', '1/s'),
        Parameter(
            'gamma',
            (1.0,) * BASE_PARAMETERS,
            'Adaptation matrix Gamma, per base inertial parameter; larger adapts more slowly',
            unit='J·s/θ²',
            length=BASE_PARAMETERS,
            size='parameters',
            broadcast=True,
            minimum=0.0,
            exclusive_minimum=True,
            read_only=False,
        ),
        Parameter(
            'switching',
            'implicit',
            'Switching term: the sign, a smooth approximation of it, or implicit Euler',
            choices=registry.SWITCHING,
            read_only=False,
        ),
        Parameter(
            'boundary_layer',
            0.2,
            'Thickness delta of the boundary layer of the smooth approximations',
            unit='m/s',
            minimum=0.0,
            exclusive_minimum=True,
            read_only=False,
        ),
        Parameter(
            'observer_gain',
            0.5,
            'Gain beta of the disturbance estimate of the implicit law; 0 is off',
            minimum=0.0,
            maximum=1.0,
            read_only=False,
        ),
        Parameter(
            'model_scale',
            0.5,
            'Nominal model as a multiple of the robot parameters, and the start of theta_hat',
            minimum=0.0,
            exclusive_minimum=True,
        ),
        *ADAPTATION,
        *LIMITS,
        *ESTIMATOR,
        COMMAND_INTERFACE,
        ENABLE_STAMPED_CMD_VEL,
        *registry.parameters(),
    )
