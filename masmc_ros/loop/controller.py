# SPDX-License-Identifier: Apache-2.0
"""The controller as an object: gains, memory between ticks, and live changes of gains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from masmc_ros.control.command_interface import COMMAND_INTERFACES, VELOCITY
from masmc_ros.control.laws import registry
from masmc_ros.control.laws.plug_in import PlugInLaw
from masmc_ros.control.laws.update import BUILT_IN
from masmc_ros.control.reaching import SWITCHING
from masmc_ros.control.velocity_estimator import ESTIMATED, SOURCES
from masmc_ros.errors import InputError
from masmc_ros.loop.adaptation_tick import project_estimate
from masmc_ros.loop.control_tick import control_tick
from masmc_ros.loop.controller_records import MEMORY, SETTINGS
from masmc_ros.loop.dense import tick_input
from masmc_ros.loop.torque_limits import limit_command
from masmc_ros.loop.velocity_tick import estimated_velocity
from masmc_ros.robot import AXES, BASE_PARAMETERS
from masmc_ros.robot.parameters import Robot

_AS_THEY_ARE = (
    'k_s1',
    'k_s2',
    'sigma',
    'gamma',
    'boundary_layer',
    'observer_gain',
    'torque_limit',
    'torque_rate_limit',
    'leakage',
    'e_modification',
    'dead_zone',
    'freeze_when_saturated',
    'estimator_bandwidth',
)
"""Parameters whose values compiled code reads under their own names."""


class Controller:
    """A control law with its memory; arrays are written in place at every tick.

    `torque` (4, N m), `error` (4, m) and `surface` (4, m/s) are the last tick's results,
    `raw_torque` (4) what the law asked for before `torque_limit` and `torque_rate_limit`,
    `used_estimate` (7) the theta_hat in that torque, `estimate` (7) the next tick's.
    With `command_interface` velocity `velocity_command` (4) stands in for the torque: forward
    speed of the platform in m/s, its yaw rate and the rates of both arm joints in rad/s.
    `commanded` (4, N m) is what was really commanded last: the rate is limited against it,
    the velocity estimator and laws in plain Python reckon with it. Who commands nothing in
    the controller's place says so by `rest`.
    """

    def __init__(self, robot: Robot, period: float, values: Mapping[str, Any]) -> None:
        """Take the robot, the control period in s and checked values of `parameters()`."""
        self.period = period
        self.settings = np.zeros(1, SETTINGS)
        self.memory = np.zeros(1, MEMORY)
        self.settings['geometry'] = robot.geometry
        self.settings['nominal'] = values['model_scale'] * robot.theta
        self.settings['period'] = period
        self.geometry, self.nominal = self.settings['geometry'][0], self.settings['nominal'][0]
        memory = self.memory
        self.estimate, self.disturbance = memory['estimate'][0], memory['disturbance'][0]
        self.predicted, self.commanded = memory['predicted'][0], memory['commanded'][0]
        self.velocity_command = memory['velocity_command'][0]
        self.torque, self.raw_torque = np.zeros(AXES), np.zeros(AXES)
        self.error, self.surface = np.zeros(AXES), np.zeros(AXES)
        self.used_estimate = np.zeros(BASE_PARAMETERS)
        self.values: dict[str, Any] = {}
        self._plug_in: PlugInLaw | None = None
        self.estimate[:] = self.nominal
        self._forget_disturbance()
        self._apply(values)

    def reset(self) -> None:
        """Forget what was learned and commanded: everything as at the start."""
        self.rest()
        self.forget()

    def rest(self) -> None:
        """Note that no torque is commanded in place of one that is computed.

        What was predicted for the next tick is void, and the velocity estimator begins anew;
        what was learned stays.
        """
        self.commanded[:] = 0.0
        self.predicted[:] = np.nan
        self.velocity_command[:] = 0.0
        self.memory['follows'] = 0

    def rates(self, velocity: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the driven joints' rates (4, rad/s) before a tick of these velocities (7).

        Those measured, or the last tick's estimate, with which the estimator begins at zero.
        """
        if self.settings['velocity_source'][0] != ESTIMATED:
            return velocity[-AXES:]
        memory = self.memory[0]
        return np.array(memory['rates']) if memory['follows'] else np.zeros(AXES)

    def skip(self, periods: int) -> None:
        """Note that so many ticks were left out, with the last torque held meanwhile.

        The disturbance estimate takes nothing from what happened in them, and the velocity
        estimator goes through them at once.
        """
        self.predicted[:] = np.nan
        self.memory['left_out'] += periods

    def forget(self) -> None:
        """Forget what was learned: theta_hat is nominal, the disturbance estimate zero."""
        self.estimate[:] = self.nominal
        self._forget_disturbance()
        if not self.is_compiled:
            self._plug_in = self._new_plug_in(self.values)

    def change(self, values: Mapping[str, Any]) -> None:
        """Apply checked values of some parameters from the next tick on.

        theta_hat persists, within the bounds of a projection that is in force. Entering the
        implicit law, or a disturbance estimate switched on or off, starts that estimate from
        zero.
        """
        before = self.values
        self._apply({**before, **values})
        now = self.values
        switched = now['switching'] != before['switching']
        if switched or (now['observer_gain'] == 0.0) != (before['observer_gain'] == 0.0):
            self._forget_disturbance()
        if now['velocity_source'] != before['velocity_source']:
            self.memory['follows'] = 0

    @property
    def is_compiled(self) -> bool:
        """Whether the law in force is a built-in one, which whole runs are compiled with.

        So is the kinematic law of commanded rates, whatever `law` says.
        """
        return self._plug_in is None or self.commands_rates

    @property
    def commands_rates(self) -> bool:
        """Whether the command is `velocity_command` instead of `torque`."""
        return bool(self.settings['command_interface'][0] == VELOCITY)

    def tick(
        self,
        position: NDArray[np.float64],
        velocity: NDArray[np.float64],
        reference: NDArray[np.float64],
    ) -> bool:
        """Compute one tick; True where the arm is close to singular.

        `position` and `velocity` (7) in the order of joint_states, `reference` (12).
        """
        self.used_estimate[:] = self.estimate
        if self._plug_in is not None and not self.commands_rates:
            return self._tick_plug_in(self._plug_in, position, velocity, reference)
        return bool(
            control_tick(
                self.settings,
                self.memory,
                position,
                velocity,
                reference,
                self.raw_torque,
                self.torque,
                self.error,
                self.surface,
            )
        )

    def _apply(self, values: Mapping[str, Any]) -> None:
        plug_in = None
        if values['law'] not in BUILT_IN:
            plug_in = self._new_plug_in(values)
        self.values = dict(values)
        self._plug_in = plug_in
        settings = self.settings
        settings['law'] = BUILT_IN.index(values['law']) if plug_in is None else -1
        settings['switching'] = SWITCHING.index(values['switching'])
        for name in _AS_THEY_ARE:
            settings[name] = values[name]
        settings['command_interface'] = COMMAND_INTERFACES.index(values['command_interface'])
        settings['velocity_source'] = SOURCES.index(values['velocity_source'])
        settings['has_limits'] = any(values['torque_limit']) or any(values['torque_rate_limit'])
        settings['projection_lower'] = values['projection.lower']
        settings['projection_upper'] = values['projection.upper']
        if plug_in is None and values['projection.lower'] > 0.0:
            project_estimate(settings, np.empty(BASE_PARAMETERS), self.estimate)

    @staticmethod
    def _new_plug_in(values: Mapping[str, Any]) -> PlugInLaw:
        return registry.load(values['law'])()

    def _forget_disturbance(self) -> None:
        self.disturbance[:] = 0.0
        self.predicted[:] = np.nan

    def _tick_plug_in(
        self,
        law: PlugInLaw,
        position: NDArray[np.float64],
        velocity: NDArray[np.float64],
        reference: NDArray[np.float64],
    ) -> bool:
        if self.settings['velocity_source'][0] == ESTIMATED:
            velocity = np.empty(7)
            estimated_velocity(self.settings, self.memory, position, velocity)
        gains = {
            name: np.array(value) if isinstance(value, tuple) else value
            for name, value in self.values.items()
        }
        inputs = tick_input(
            self.geometry,
            self.nominal,
            self.period,
            gains,
            position,
            velocity,
            reference,
            self.estimate,
            self.commanded,
        )
        torque, estimate = law.step(inputs)
        for array, given, what in (
            (self.raw_torque, torque, 'torque'),
            (self.estimate, estimate, 'estimate'),
        ):
            found = np.asarray(given, dtype=np.float64)
            if found.shape != array.shape or not np.isfinite(found).all():
                raise InputError(
                    f'law = {self.values["law"]}: its {what} is {found.tolist()}, expected '
                    f'{array.size} finite numbers'
                )
            array[:] = found
        limit_command(self.settings, self.memory, self.raw_torque, self.torque)
        self.error[:] = inputs.error
        self.surface[:] = inputs.surface
        return inputs.singular
