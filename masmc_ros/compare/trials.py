# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Trials of a comparison: the unmodified scenario, and conditions that break some laws."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

from masmc_ros.errors import InputError, suggestion
from masmc_ros.robot.declaration import Mechanism
import numpy as np


@dataclass(frozen=True)
class Trial:
    """Settings that change a scenario, in the form of `--set`."""

    name: str
    description: str
    settings: tuple[str, ...] = ()

    def settings_for(self, mechanism: Mechanism) -> tuple[str, ...]:
        """Return the settings for a robot, with the limits of its drives."""
        drives = {
            name: list(mechanism.default(name, 'joints'))
            for name in ('torque_limit', 'torque_rate_limit')
        }
        return tuple(setting.format(**drives) for setting in self.settings)


AS_IS = Trial('as it is', 'the scenario itself')

TRIALS = (
    AS_IS,
    Trial('half model', 'a model of half the masses', ('controller.model_scale=0.5',)),
    Trial('true model', 'the model of the robot itself', ('controller.model_scale=1.0',)),
    Trial(
        'noise',
        'rates measured with noise of 0.05 rad/s, encoders of 0.1 mrad',
        ('plant.velocity_noise=0.05', 'plant.encoder_resolution=0.0001'),
    ),
    Trial('delay', 'states that are 5 ms old', ('plant.measurement_delay=0.005',)),
    Trial('100 Hz', 'a control period of 10 ms', ('control_period=0.01',)),
    Trial(
        'limits',
        "torques and their rates within the drives' limits",
        (
            'controller.torque_limit={torque_limit}',
            'controller.torque_rate_limit={torque_rate_limit}',
        ),
    ),
)


def trials_named(names: str) -> tuple[Trial, ...]:
    """Return trials by their names, separated by commas; InputError for an unknown one."""
    known = {trial.name: trial for trial in TRIALS}
    if names == 'all':
        return TRIALS
    selected = []
    for name in map(str.strip, names.split(',')):
        if name not in known:
            raise InputError(f"--trials: '{name}' is unknown; {suggestion(name, known)}")
        selected.append(known[name])
    return tuple(dict.fromkeys((AS_IS, *selected)))


_INERTIAL = ('kg', 'kg·m²')
"""Units of the robot's parameters that are drawn randomly."""


def drawn(scenario: dict[str, dict[str, Any]], mechanism: Mechanism, seed: int) -> Any:
    """
    Return a scenario with a true robot, disturbance and noise that are drawn by a seed.

    Seed 0 is the unmodified scenario. Otherwise masses and inertias of the robot, unknown to the
    controller, are multiplied by 0.6 to 1.4, amplitudes of the disturbance by 0.5 to 1.5; phases
    are uniformly distributed.
    """
    if seed == 0:
        return scenario
    rng = np.random.default_rng(seed)
    plant = dict(scenario['plant'])
    for parameter in mechanism.parameters:
        if parameter.unit in _INERTIAL:
            plant[parameter.name] *= rng.uniform(0.6, 1.4)
    count = len(mechanism.joints)
    amplitude = np.array(plant['disturbance.amplitude']) * rng.uniform(0.5, 1.5, count)
    plant['disturbance.amplitude'] = tuple(amplitude.tolist())
    plant['disturbance.phase'] = tuple(rng.uniform(0.0, 2.0 * math.pi, count).tolist())
    plant['seed'] = seed
    return {**scenario, 'plant': plant}
