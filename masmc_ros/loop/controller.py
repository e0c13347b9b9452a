# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The controller as an object: gains, memory between ticks, and live changes of gains."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.law import registry
from masmc_ros.law.command_interface import takes_rates
from masmc_ros.law.law import Law
from masmc_ros.law.parts import velocity_estimator
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, SOURCES
from masmc_ros.law.plug_in import PlugInLaw
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import (
    control_tick,
    estimate_velocity,
    limit_torque,
    post_update,
    SINGULAR,
)
from masmc_ros.loop.dense import tick_input
from masmc_ros.loop.signals import inputs, SIGNALS
from masmc_ros.numerics.aliases import Array
from masmc_ros.numerics.compiled import bound
from masmc_ros.numerics.record import take_over
from masmc_ros.robot.robot import Robot
import numpy as np

ESTIMATED_RATES = SOURCES[ESTIMATED]


class Controller:
    """
    A control law with its memory; arrays are written in place at every tick.

    `torque` (joints, N m), `error` (axes, m) and `surface` (axes, m/s) are the last tick's
    results, `raw_torque` what the law asked for before `torque_limit` and `torque_rate_limit`,
    `used_estimate` (parameters) the theta_hat in that torque. With `command_interface` velocity
    `velocity_command` (joints) stands in for the torque: the base's own velocities, then the
    rates of the joints it does not move by. All of them are of `now`, the signals of the tick.

    `estimate` is the next tick's theta_hat; `commanded` (joints, N m) is what was really
    commanded last: the rate is limited against it, the velocity estimator and laws in plain
    Python account for it. A caller that commands nothing in place of the controller's output
    calls `output_not_applied`.
    """

    def __init__(self, robot: Robot, period: float, values: Mapping[str, Any]) -> None:
        """Take the robot, the control period in s and checked values of `parameters()`."""
        self.period = period
        self.robot, self.mechanism = robot, robot.mechanism
        self.now = records.signals(self.mechanism)
        signals = {field.name: self.now[field.name][0] for field in SIGNALS}
        self._inputs = inputs(self.now)
        self.torque, self.raw_torque = signals['torque'][:, 0], signals['raw_torque'][:, 0]
        self.error, self.surface = signals['error'][:, 0], signals['surface'][:, 0]
        self.used_estimate = signals['estimate'][:, 0]
        self.velocity_command = signals['rates'][:, 0]
        self.nominal = values['model_scale'] * robot.theta
        self.commands_rates = takes_rates(values)
        self.values: dict[str, Any] = {}
        self._plug_in: PlugInLaw | None = None
        self._law: Law = registry.OF_RATES
        self._kernel: Callable[..., Any] | None = None
        self.memory = self._new_memory()
        self._choose(values)
        self.estimate[:] = self.nominal
        self._apply(values)

    @property
    def estimate(self) -> Array:
        """theta_hat of the next tick."""
        estimate: Array = self.memory['estimate'][0, :, 0]
        return estimate

    @property
    def commanded(self) -> Array:
        """Torque commanded last, N m."""
        commanded: Array = self.memory['commanded'][0, :, 0]
        return commanded

    @property
    def has_limits(self) -> bool:
        """Whether torques or their rates are limited."""
        return any(self.values['torque_limit']) or any(self.values['torque_rate_limit'])

    def reset(self) -> None:
        """Forget what was learned and commanded: everything as at the start."""
        self.output_not_applied()
        self.reset_adaptation()

    def output_not_applied(self) -> None:
        """
        Note that no torque is commanded in place of one that is computed.

        Predictions for the next tick are discarded, and the velocity estimator restarts;
        what was learned stays.
        """
        self.memory['commanded'] = 0.0
        self._void()
        self.memory['velocity_command'] = 0.0
        self.velocity_command[:] = 0.0
        self.memory['estimator_initialised'] = 0

    def rates(self, velocity: Array) -> Array:
        """
        Return the driven joints' speeds in rad/s before a tick of these velocities.

        Measured ones, or the estimate of the last tick; the estimator starts at zero.
        """
        joints = len(self.torque)
        if self.values['velocity_source'] != ESTIMATED_RATES:
            return velocity[-joints:]
        is_initialised = self.memory['estimator_initialised'][0, 0]
        return self.memory['rates'][0, :, 0].copy() if is_initialised else np.zeros(joints)

    def skip(self, periods: int) -> None:
        """
        Note that so many ticks were left out, with the last torque held meanwhile.

        The disturbance estimate takes nothing from what happened in them, and the velocity
        estimator goes through them at once.
        """
        self._void()
        self.memory['left_out'] += periods

    def reset_adaptation(self) -> None:
        """Forget what was learned: theta_hat is nominal, the law's memory as at its start."""
        kept = ('velocity_command', *(field.name for field in velocity_estimator.MEMORY))
        before, self.memory = self.memory, self._new_memory()
        for name in kept:
            self.memory[name] = before[name]
        self.estimate[:] = self.nominal
        if self._plug_in is not None:
            self._plug_in = type(self._plug_in)()

    def change(self, values: Mapping[str, Any]) -> None:
        """
        Apply checked values of some parameters from the next tick on.

        theta_hat persists, within the bounds of an active projection. Entering the
        implicit law, or a disturbance estimate switched on or off, starts that estimate from
        zero.
        """
        before, law = self.values, self._law
        now = {**before, **values}
        if any(now[name] != before[name] for name in ('law', 'switching')):
            self._choose(now)
        self._apply(now)
        switched = now['switching'] != before['switching'] or law.uses_switching != (
            self._law.uses_switching
        )
        if switched or (now['observer_gain'] == 0.0) != (before['observer_gain'] == 0.0):
            self.memory['disturbance'] = 0.0
            self.memory['predicted'] = np.nan
        if now['velocity_source'] != before['velocity_source']:
            self.memory['estimator_initialised'] = 0

    @property
    def is_compiled(self) -> bool:
        """
        Return True if the active law consists of compiled functions, as compiled runs need.

        So does the kinematic law of commanded rates, whatever `law` says.
        """
        return self._plug_in is None

    def tick(self, position: Array, velocity: Array, reference: Array) -> bool:
        """
        Compute one tick; True where the task is close to singular.

        `position` and `velocity` in the order of joint_states, `reference` x_d, xdot_d, xddot_d.
        """
        self._write(position, velocity, reference)
        return bool(self.answer(*self._inputs) & SINGULAR)

    def answer(self, position: Array, velocity: Array, reference: Array) -> int:
        """
        Compute one tick as `tick` does; return what `control_tick` says of it.

        Other than there, nobody looks whether the arrays are what they have to be: contiguous
        float64 of the sizes of this robot.
        """
        if self._plug_in is not None:
            self._write(position, velocity, reference)
            return SINGULAR * self._tick_plug_in(self._plug_in)
        if self._kernel is None:
            self._kernel = bound(control_tick, self.settings, self.memory, self.now, *self._inputs)
        found: int = self._kernel(
            self.settings, self.memory, self.now, position, velocity, reference
        )
        return found

    def _write(self, position: Array, velocity: Array, reference: Array) -> None:
        # Once a tick: a loop takes longer.
        now = self._inputs
        now[0][:], now[1][:], now[2][:] = position, velocity, reference

    def _void(self) -> None:
        """Forget what memory has of the tick before this one: it was another one than computed."""
        for name in self._of_tick_before:
            self.memory[name] = np.nan

    @property
    def uses_switching(self) -> bool:
        """Return True if the active law uses the reaching term named by `switching`."""
        return self._law.uses_switching

    def _choose(self, values: Mapping[str, Any]) -> None:
        """Create the records of a law; fields shared with the previous law keep their values."""
        law = registry.load_for(values['law'], self.mechanism)
        plug_in = None
        if self.commands_rates:
            law = registry.OF_RATES
        elif not isinstance(law, Law):
            plug_in = law()
            # The parts that plain Python shares with the built-in laws are theirs.
            law = registry.LAWS['smc']
        settings = records.law_settings(self.mechanism, law, values['switching'])
        records.write_law(settings, self.robot, self.period, values)
        read = records.read_by(settings, self.mechanism)
        memory = records.law_memory(self.mechanism, law)
        take_over(memory, self.memory)
        # An invalid law has raised by now, and the active one is unchanged.
        self._law, self._plug_in, self._kernel = law, plug_in, None
        self._of_tick_before = records.of_tick_before(law)
        self.settings, self._read, self.memory = settings, read, memory

    def _new_memory(self) -> records.Records:
        return records.law_memory(self.mechanism, self._law)

    def _apply(self, values: Mapping[str, Any]) -> None:
        self.values = dict(values)
        records.write_parameters(self.settings, self._read, values)
        if self._plug_in is None and values['projection.lower'] > 0.0:
            post_update(self.settings, self.memory)

    def _tick_plug_in(self, law: PlugInLaw) -> bool:
        if self.values['velocity_source'] == ESTIMATED_RATES:
            estimate_velocity(self.settings, self.memory, self.now)
        gains = {
            name: np.array(value) if isinstance(value, tuple) else value
            for name, value in self.values.items()
        }
        inputs = tick_input(self.settings, self.now, gains, self.estimate, self.commanded)
        self.used_estimate[:] = self.estimate
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
        limit_torque(self.settings, self.memory, self.now)
        self.error[:] = inputs.error
        self.surface[:] = inputs.surface
        return inputs.singular
