# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Trials of a comparison: the unmodified scenario, other conditions, and the hardware benchmark.

The benchmark has the properties of real robots, alone and all together. A changed condition gets
another BENCHMARK_VERSION, so results of one version are comparable. Settings are those of `--set`.
Names in braces are quantities of the robot's drives: see `Trial.settings_for`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

from masmc_ros.errors import InputError, suggestion
from masmc_ros.law.command_interface import COMMAND_INTERFACE, COMMAND_INTERFACES, HYBRID
from masmc_ros.law.reaching.implicit import OBSERVER_GAIN
from masmc_ros.loop.plant_parameters import AMPLITUDE
from masmc_ros.loop.scenario import Scenario
from masmc_ros.params.declaration import Values
from masmc_ros.robot.declaration import Mechanism
import numpy as np

BENCHMARK_VERSION = 2
"""Version of the conditions: 2 has the smaller torque limits of the file and of the URDF."""

BENCHMARK = f'hardware {BENCHMARK_VERSION}'
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


_STICTION_SHARE, _USABLE = 0.02, 0.7
"""Stiction, and usable torque, as parts of the torque limit of each drive."""

_LOADED = 0.1
"""Part of the torque of the strongest arm drive that the payload's weight needs at 1 m."""

_GRAVITY = 9.81

_HYBRID = COMMAND_INTERFACES[HYBRID]


@dataclass(frozen=True)
class Trial:
    """
    Settings that change a scenario, in the form of `--set`.

    Attributes
    ----------
    name, description, settings
        Its texts and settings; names in braces are quantities of the drives.
    needs_base
        True if only robots with a driven base have it.
    benchmark
        Name and version of the set that it belongs to; empty without one.

    """

    name: str
    description: str
    settings: tuple[str, ...] = ()
    needs_base: bool = False
    benchmark: str = ''

    def settings_for(
        self, mechanism: Mechanism, controller: Values | None = None
    ) -> tuple[str, ...]:
        """
        Return the settings for a robot.

        Parameters
        ----------
        mechanism
            Its type, with the limits of its drives.
        controller
            Values of the controller; its limits apply if they are smaller than those of the
            drives, or if those are unknown.

        """
        torques = mechanism.default('torque_limit', 'joints')
        drives = {
            name: _smaller(mechanism.default(name, 'joints'), (controller or {}).get(name))
            for name in ('torque_limit', 'torque_rate_limit')
        }
        drives['stiction'] = [_STICTION_SHARE * torque for torque in torques]
        drives['usable_torque'] = [
            _USABLE * limit if torque > 0.0 else limit
            for limit, torque in zip(drives['torque_limit'], torques, strict=True)
        ]
        payload = _LOADED * _strongest(mechanism) / _GRAVITY
        return tuple(setting.format(**drives, payload=payload) for setting in self.settings)

    @property
    def is_hybrid(self) -> bool:
        """Return True if the base follows velocities, which laws in plain Python cannot."""
        return f'controller.{COMMAND_INTERFACE.name}={_HYBRID}' in self.settings

    def suits(self, mechanism: Mechanism) -> bool:
        """Return True if a robot can run the trial."""
        return bool(mechanism.twist) or not self.needs_base


def _smaller(limits: Sequence[float], others: Sequence[float] | None) -> list[float]:
    """Return the smaller limits of two; a limit of 0 is unknown, and the other one applies."""
    pairs = zip(limits, others or limits, strict=True)
    return [min(filter(None, pair), default=0.0) for pair in pairs]


def _strongest(mechanism: Mechanism) -> float:
    """Return the largest torque limit in N·m of the revolute joints behind the base."""
    limits = mechanism.default('torque_limit', 'joints')[len(mechanism.twist):]
    joints = zip(limits, mechanism.own_rates, strict=True)
    return max((limit for limit, joint in joints if joint.unit == 'rad'), default=0.0)


_SMALLER_LIMITS = (
    'controller.torque_limit={torque_limit}',
    'controller.torque_rate_limit={torque_rate_limit}',
)
"""Settings of a controller that knows the limits of the drives."""

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
        _SMALLER_LIMITS,
    ),
)


def _trial_of_laws(milliseconds: int, *, is_limited: bool, observes: bool) -> Trial:
    """
    Return a trial of all laws with a control period.

    The disturbance estimate is the one that every law can use, and the implicit reaching term's
    own one is off. Laws are therefore compared with the same estimate.
    """
    gain = 0.3 if observes else 0.0
    settings = [
        f'control_period={1e-3 * milliseconds}',
        f'controller.{OBSERVER_GAIN.name}=0.0',
        f'controller.compensation.gain={gain}',
        *(_SMALLER_LIMITS if is_limited else ()),
    ]
    name = f'{milliseconds} ms{", limits" if is_limited else ""}{", observer" if observes else ""}'
    parts = [f'a control period of {milliseconds} ms']
    parts += ["the drives' limits"] if is_limited else []
    parts += [f'a disturbance estimate for all laws, gain {gain}'] if observes else []
    return Trial(name, ', '.join(parts), tuple(settings))


TRIALS_OF_LAWS = tuple(
    _trial_of_laws(milliseconds, is_limited=is_limited, observes=observes)
    for milliseconds in (1, 2, 10)
    for is_limited in (False, True)
    for observes in (False, True)
)
"""Trials of the table of all laws: periods, with and without limits and a disturbance estimate."""

HARDWARE = tuple(
    Trial(*condition, benchmark=BENCHMARK) for condition in CONDITIONS
)
"""Trials of the hardware benchmark."""

_GROUPS = {'all': TRIALS, 'laws': TRIALS_OF_LAWS, 'hardware': HARDWARE}


def sets_observer(trials: Iterable[Trial]) -> bool:
    """Return True if trials choose the gain of the disturbance estimate."""
    settings = (setting for trial in trials for setting in trial.settings)
    return any(setting.startswith(f'controller.{OBSERVER_GAIN.name}=') for setting in settings)


def trials_named(names: str, mechanism: Mechanism) -> tuple[Trial, ...]:
    """
    Return the trials of a robot by their names, separated by commas.

    `all`, `laws` and `hardware` are groups of trials, reduced to the suitable ones.
    Raises InputError for a name that is unknown or does not suit the robot.
    """
    known = {trial.name: trial for trial in (*TRIALS, *HARDWARE)}
    if names in _GROUPS:
        return tuple(trial for trial in _GROUPS[names] if trial.suits(mechanism))
    selected = []
    for name in map(str.strip, names.split(',')):
        if name not in known:
            raise InputError(f"--trials: '{name}' is unknown; {suggestion(name, known)}")
        if not known[name].suits(mechanism):
            raise InputError(f"--trials: '{name}' needs a driven base, which the robot lacks")
        selected.append(known[name])
    return tuple(dict.fromkeys((AS_IS, *selected)))


_INERTIAL = ('kg', 'kg·m²')
"""Units of the robot's parameters that are drawn randomly."""


def drawn_robot(scenario: Scenario, mechanism: Mechanism, seed: int) -> Scenario:
    """
    Return a scenario with a true robot, disturbance and noise that are drawn by a seed.

    Seed 0 is the unmodified scenario. Otherwise masses and inertias among the parameters of the
    robot, unknown to the controller, are multiplied by 0.6 to 1.4, amplitudes of the disturbance
    by 0.5 to 1.5; phases are uniformly distributed. Masses of a URDF are no parameters.
    """
    if seed == 0:
        return scenario
    rng = np.random.default_rng(seed)
    plant = dict(scenario.plant)
    for parameter in mechanism.parameters:
        if parameter.unit in _INERTIAL:
            plant[parameter.name] *= rng.uniform(0.6, 1.4)
    count = len(mechanism.joints)
    amplitude = np.array(AMPLITUDE.of(plant)) * rng.uniform(0.5, 1.5, count)
    plant['disturbance.amplitude'] = tuple(amplitude.tolist())
    plant['disturbance.phase'] = tuple(rng.uniform(0.0, 2.0 * math.pi, count).tolist())
    plant['seed'] = seed
    return scenario.with_nodes({'plant': plant})
