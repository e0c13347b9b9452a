# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Trials of the hardware benchmark: properties of real robots, alone and all together.

A changed condition gets another VERSION, so results of one version are comparable. Settings are
those of `--set`. Names in braces are quantities of the robot's drives: see `Trial.settings_for`.
"""

from __future__ import annotations

from typing import NamedTuple

VERSION = 2
"""Version of the conditions: 2 has the smaller torque limits of the file and of the URDF."""

NAME = f'hardware {VERSION}'
"""Name of the set in results."""


class Condition(NamedTuple):
    """Condition of a trial; `needs_base`: only robots with a driven base have it."""

    name: str
    description: str
    settings: tuple[str, ...]
    needs_base: bool = False


def _late(
    measurement: int, command: int, lag: int = 0, assumed: int | None = None
) -> tuple[str, ...]:
    """
    Return the settings of a latency with jitter.

    Parameters
    ----------
    measurement, command
        Delays of states and commands in ms.
    lag
        Time constant of the motors in ms, known to the controller.
    assumed
        Latency that the controller assumes in ms; None: the true one.

    """
    latency = measurement + command if assumed is None else assumed
    return (
        f'plant.measurement_delay={1e-3 * measurement:g}',
        f'plant.command_delay={1e-3 * command:g}',
        'plant.delay_jitter=0.25',
        f'plant.motor_lag={1e-3 * lag:g}',
        f'controller.latency={1e-3 * latency:g}',
        f'controller.motor_lag={1e-3 * lag:g}',
    )


_IDEAL = ('control_period=0.001', 'controller.model_scale=0.5')
"""Settings of all trials: 1 kHz, and half of the true masses assumed."""

_USUAL = (*_IDEAL, *_late(2, 3))
"""Settings of all trials with one further property: a known latency of 5 ms."""

_ENCODERS = (
    'plant.encoder_resolution=0.0001',
    'plant.measures_velocity=false',
    'controller.velocity_source=estimated',
)
_STICTION = ('plant.stiction.torque={stiction}',)
_LOSSES = ('plant.measurement_loss=0.01', 'plant.command_loss=0.01')
_PAYLOAD = ('plant.payload.mass={payload}',)
_LIMITS = (
    'plant.torque_limit={usable_torque}',
    'plant.torque_rate_limit={torque_rate_limit}',
    'controller.torque_limit={usable_torque}',
    'controller.torque_rate_limit={torque_rate_limit}',
)
_EVERYTHING = (*_ENCODERS, *_STICTION, *_LOSSES, *_PAYLOAD, *_LIMITS)

_SPLIT = {2: (1, 1), 5: (2, 3), 10: (5, 5), 20: (10, 10)}
"""Delays of states and commands by their sum, in ms."""

_LAGS = {2: 2, 5: 2, 10: 5, 20: 10}
"""Time constants of the motors in the trials with everything, by latency, in ms."""


def _everything(latency: int) -> Condition:
    lag = _LAGS[latency]
    return Condition(
        f'all {latency} ms',
        f'latency of {latency} ms with jitter, motor lag of {lag} ms, encoders without velocities,'
        ' stiction, lost messages, payload and torque limits together',
        (*_IDEAL, *_late(*_SPLIT[latency], lag), *_EVERYTHING),
    )


def _slower(period: int) -> Condition:
    return Condition(
        f'at {1000 // period} Hz',
        f'a control period of {period} ms and a known latency of one period',
        (*_IDEAL, f'control_period={1e-3 * period:g}', *_late(period, 0)),
    )


CONDITIONS = (
    _everything(5),
    _everything(2),
    _everything(10),
    _everything(20),
    Condition('ideal', 'a control period of 1 ms and a model of half the masses', _IDEAL),
    *(
        Condition(
            f'{latency} ms',
            f'a known latency of {latency} ms with a jitter of a quarter',
            (*_IDEAL, *_late(*_SPLIT[latency])),
        )
        for latency in _SPLIT
    ),
    Condition('5 ms unknown', 'the same 5 ms, unknown', (*_IDEAL, *_late(2, 3, assumed=0))),
    Condition('10 ms as 7', '10 ms, assumed to be 7 ms', (*_IDEAL, *_late(5, 5, assumed=7))),
    *(
        Condition(
            f'lag {lag} ms',
            f'a known latency of 5 ms and a known motor lag of {lag} ms',
            (*_IDEAL, *_late(2, 3, lag)),
        )
        for lag in (2, 5, 10)
    ),
    Condition(
        'encoders', '5 ms; encoders of 0.1 mrad without velocities', (*_USUAL, *_ENCODERS)
    ),
    Condition(
        'stiction',
        "5 ms; stiction of 2 % of the drives' torques",
        (*_USUAL, *_STICTION),
    ),
    Condition('losses', '5 ms; 1 % of the states and of the commands lost', (*_USUAL, *_LOSSES)),
    Condition(
        'payload',
        "5 ms; an unknown payload, whose weight at 1 m needs 0.1 of the strongest drive's torque",
        (*_USUAL, *_PAYLOAD),
    ),
    Condition(
        'torque limits', "5 ms; torques within 0.7 of the drives' limits", (*_USUAL, *_LIMITS)
    ),
    *map(_slower, (2, 4, 10)),
    Condition(
        'hybrid',
        'the base by velocity with a lag of 100 ms, the arm by torque',
        (
            *_IDEAL,
            'plant.command_interface=hybrid',
            'controller.command_interface=hybrid',
            'plant.base_lag=0.1',
            'controller.base_lag=0.1',
        ),
        needs_base=True,
    ),
    Condition(
        'slip',
        'torque limits, and wheels with a friction of 0.3 that can slip',
        (
            *_USUAL,
            *_LIMITS,
            'plant.physics=mujoco',
            'plant.friction=0.3',
            'controller.approach_on_start=true',
        ),
        needs_base=True,
    ),
)
"""Conditions of the set; results are sorted by the error in the first one."""
