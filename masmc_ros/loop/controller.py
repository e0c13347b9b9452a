# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Controller with its gains, its memory between ticks, and live changes of parameters."""

from __future__ import annotations

from collections.abc import Callable

from masmc_ros.aliases import Array, Records
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import bound
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import fill, take_over
from masmc_ros.law import registry
from masmc_ros.law.command_interface import by_velocity, is_hybrid, takes_rates
from masmc_ros.law.fields import EstimatorMemory
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import PROJECTION_LOWER
from masmc_ros.law.parts.delay_compensation import note_skipped
from masmc_ros.law.parts.joint_limits import LimitMemory, TORQUE_LIMIT, TORQUE_RATE_LIMIT
from masmc_ros.law.parts.model import PAYLOAD
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, SOURCES, VELOCITY_SOURCE
from masmc_ros.law.plug_in import PlugInLaw
from masmc_ros.law.reaching.implicit import OBSERVER_GAIN
from masmc_ros.law.registry import LAW, SWITCHING_TERM
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import (
    control_tick,
    estimate_velocity,
    limit_torque,
    post_update,
    predict_state,
    reduce_torque,
    SINGULAR,
)
from masmc_ros.loop.dense import tick_input
from masmc_ros.loop.law_dry_run import check
from masmc_ros.loop.signals import inputs, SIGNALS
from masmc_ros.params.declaration import MutableValues, Values
from masmc_ros.robot.robot import Robot
import numpy as np

ESTIMATED_RATES = SOURCES[ESTIMATED]


class Controller:
    """
    Control law with its memory; every tick writes the arrays in place.

    A caller that commands nothing in place of the controller's output calls `output_not_applied`.

    Attributes
    ----------
    signals
        Record (1) with the signals of the last tick. The arrays below, except the properties, are
        views of it.
    torque
        Commanded torque (joints) in N·m.
    raw_torque
        Torque (joints) of the law before `torque_limit` and `torque_rate_limit`.
    error, surface
        Task error (axes) in m and sliding surface (axes) in m/s.
    used_estimate
        theta_hat (parameters) in the torque.
    memory
        Record (1) of the values between ticks.
    commanded
        Torque (joints) of the last command in N·m, a view of `memory`. The torque rate limit, the
        velocity estimator and laws in plain Python use it.
    velocity_command
        Commanded velocities (joints) with `command_interface` velocity and hybrid: of the base,
        then the rates of the joints that do not move it.
    by_velocity
        True for joints (joints) with a commanded velocity.
    is_compensated
        True if latency is compensated.
    keeps_joint_limits
        True if joint limits are enforced.

    """

    def __init__(self, robot: Robot, period: float, values: Values) -> None:
        """
        Initialise the controller as at the start of a run.

        Parameters
        ----------
        robot
            Robot of the nominal model, before `model_scale`.
        period
            Control period in s.
        values
            Checked values of `parameters()`.

        """
        self.period = period
        self.robot, self.mechanism = robot, robot.mechanism
        self.signals = records.signals(self.mechanism)
        self._predicted = records.signals(self.mechanism)
        signals = {field.name: self.signals[field.name][0] for field in SIGNALS}
        self._inputs = inputs(self.signals)
        self.torque, self.raw_torque = signals['torque'][:, 0], signals['raw_torque'][:, 0]
        self.error, self.surface = signals['error'][:, 0], signals['surface'][:, 0]
        self.used_estimate = signals['estimate'][:, 0]
        self.velocity_command = signals['rates'][:, 0]
        self.nominal = records.nominal_theta(robot, values)
        self.commands_rates = takes_rates(values)
        self.is_hybrid = is_hybrid(values)
        self.by_velocity = by_velocity(values, self.mechanism)
        self.values: MutableValues = {}
        self._plug_in: PlugInLaw | None = None
        self._law: Law = registry.OF_RATES
        self._kernel: Callable[..., int] | None = None
        self.is_compensated = records.is_compensated(values)
        self.keeps_joint_limits = records.is_limited(values, self.mechanism)
        self._stamp_age = 0.0
        self._use_memory(self._new_memory())
        self._choose(values)
        self.estimate[:] = self.nominal
        self._apply(values)

    @property
    def estimate(self) -> Array:
        """Return theta_hat (parameters) of the next tick."""
        estimate: Array = self.memory['estimate'][0, :, 0]
        return estimate

    @property
    def has_limits(self) -> bool:
        """Return True if torques, their rates or the motion of joints are limited."""
        return (
            self.keeps_joint_limits
            or any(TORQUE_LIMIT.of(self.values))
            or any(TORQUE_RATE_LIMIT.of(self.values))
        )

    @property
    def limited_ticks(self) -> int:
        """Return the number of ticks in which joint limits changed the torque."""
        return int(self.memory['limited_ticks'][0, 0]) if self.keeps_joint_limits else 0

    def reset(self) -> None:
        """Reset the adaptation and the last command, as at the start."""
        self.output_not_applied()
        self.reset_adaptation()

    def output_not_applied(self) -> None:
        """
        Account for a tick whose computed torque was not commanded, and no other torque either.

        This discards predictions for the next tick and restarts the velocity estimator. Adapted
        parameters persist.
        """
        self.memory['commanded'] = 0.0
        self._void()
        self.memory['velocity_command'] = 0.0
        self.velocity_command[:] = 0.0
        self.memory['estimator_initialised'] = 0
        if self.is_compensated:
            self.memory['history_initialised'] = 0

    def rates(self, velocity: Array) -> Array:
        """
        Return the velocities of the driven joints in rad/s before a tick.

        They are measured or, according to `velocity_source`, the estimates of the last tick. The
        estimates start at zero.
        """
        joints = len(self.torque)
        if self.values[VELOCITY_SOURCE.name] != ESTIMATED_RATES:
            return velocity[-joints:]
        is_initialised = self.memory['estimator_initialised'][0, 0]
        return self.memory['rates'][0, :, 0].copy() if is_initialised else np.zeros(joints)

    def skip(self, periods: int) -> None:
        """
        Account for skipped ticks, during which the last torque was held.

        The disturbance estimate ignores them, and the velocity estimator treats them as one long
        period. The compensation of latency restarts if they exceed its history of commands.
        """
        self._void()
        self.memory['uncomputed_ticks'] += periods
        note_skipped(lane_of(self.settings[0], 0), lane_of(self.memory[0], 0), periods)

    def reset_adaptation(self) -> None:
        """Reset the adaptation: set theta_hat to nominal and re-initialise the law's memory."""
        fields = (*EstimatorMemory, *(LimitMemory if self.keeps_joint_limits else ()))
        kept = ('velocity_command', *(field.name for field in fields))
        before = self.memory
        self._use_memory(self._new_memory())
        for name in kept:
            self.memory[name] = before[name]
        self.estimate[:] = self.nominal
        if self._plug_in is not None:
            self._plug_in = type(self._plug_in)()

    def change(self, values: Values) -> None:
        """
        Apply checked values of some parameters from the next tick onwards.

        theta_hat persists, within the bounds of an active projection; a change of the payload is
        added to it. The disturbance estimate restarts at zero if it is enabled or disabled, if
        the implicit law becomes active, or if a law in plain Python starts or ends.
        """
        before, law, was_compensated = self.values, self._law, self.is_compensated
        was_plain = self._plug_in is not None
        changed = {**before, **values}
        chooses = any(changed[name] != before[name] for name in ('law', 'switching'))
        if chooses or records.is_compensated(changed) != was_compensated:
            self._choose(changed)
        if any(changed[name] != before[name] for name in PAYLOAD):
            self._carry(records.nominal_theta(self.robot, changed))
        self._apply(changed)
        is_other = SWITCHING_TERM.of(changed) != SWITCHING_TERM.of(before)
        switched = is_other or law.uses_switching != self._law.uses_switching
        switched |= self.is_compensated != was_compensated
        if (self._plug_in is not None) != was_plain:
            # Plain Python does not continue predictions and the disturbance estimate.
            switched = True
            self._void()
            self.memory['disturbance_torque'] = 0.0
        if switched or (OBSERVER_GAIN.of(changed) == 0.0) != (OBSERVER_GAIN.of(before) == 0.0):
            self.memory['disturbance'] = 0.0
            self.memory['predicted'] = np.nan
        if self.is_compensated and not was_compensated:
            self.memory['drift'] = 0.0
            self.memory['drift_predicted'] = np.nan
        if changed[VELOCITY_SOURCE.name] != before[VELOCITY_SOURCE.name]:
            self.memory['estimator_initialised'] = 0

    def set_lateness(self, lateness: float) -> None:
        """Set by how much the next torque acts later in s after its state than `latency`."""
        self.memory['later'] = lateness

    @property
    def stamp_age(self) -> float:
        """Return the time in s from the measurement of a state to its stamp."""
        return self._stamp_age

    def set_stamp_age(self, age: float) -> None:
        """Set the time in s from the measurement of a state to its stamp."""
        self._stamp_age = age
        if self.is_compensated:
            fill(self.settings, 'stamp_age', age)

    @property
    def is_compiled(self) -> bool:
        """
        Return True if the active law is compiled, which compiled runs require.

        The kinematic law of commanded rates is always compiled and ignores `law`.
        """
        return self._plug_in is None

    def tick(self, position: Array, velocity: Array, reference: Array) -> bool:
        """
        Compute one tick.

        Parameters
        ----------
        position, velocity
            Measured state (positions), in the order of joint_states.
        reference
            x_d, xdot_d and xddot_d (3 * axes).

        Returns
        -------
        bool
            True if the task is close to singular.

        """
        self._write(position, velocity, reference)
        return bool(self.answer(*self._inputs) & SINGULAR)

    def answer(self, position: Array, velocity: Array, reference: Array) -> int:
        """
        Compute one tick like `tick`, and return the status flags of `control_tick`.

        The arrays are not checked: they must be contiguous float64 of the sizes of this robot.
        """
        if self._plug_in is not None:
            self._write(position, velocity, reference)
            return SINGULAR * self._tick_plug_in(self._plug_in)
        if self._kernel is None:
            self._kernel = bound(
                control_tick, self.settings, self.memory, self.signals, *self._inputs
            )
        status: int = self._kernel(
            self.settings, self.memory, self.signals, position, velocity, reference
        )
        return status

    def _write(self, position: Array, velocity: Array, reference: Array) -> None:
        # A loop takes longer, and this is computed at every tick.
        inputs = self._inputs
        inputs[0][:], inputs[1][:], inputs[2][:] = position, velocity, reference

    def _void(self) -> None:
        """Invalidate the memory of the previous tick, which was not as computed."""
        for name in self._of_tick_before:
            self.memory[name] = np.nan

    @property
    def uses_switching(self) -> bool:
        """Return True if the active law uses the reaching term named by `switching`."""
        return self._law.uses_switching

    def _choose(self, values: Values) -> None:
        """Create the records of a law; fields shared with the previous law keep their values."""
        law = registry.load_for(LAW.of(values), self.mechanism)
        plug_in = None
        if self.commands_rates:
            law = registry.OF_RATES
        elif not isinstance(law, Law):
            if self.is_hybrid:
                raise InputError(
                    f'law = {LAW.of(values)}: it is plain Python, expected a compiled law with '
                    'command_interface hybrid'
                )
            plug_in = law()
            # Limits and estimator of a plain-Python law are those of a built-in law.
            law = registry.LAWS['smc']
        check(law, self.mechanism, SWITCHING_TERM.of(values))
        compensated = records.is_compensated(values)
        settings = records.law_settings(
            self.mechanism,
            law,
            SWITCHING_TERM.of(values),
            is_hybrid=self.is_hybrid,
            compensated=compensated,
            limited=self.keeps_joint_limits,
        )
        records.write_law(settings, self.robot, self.period, values)
        if compensated:
            fill(settings, 'stamp_age', self._stamp_age)
        read = records.read_by(settings, self.mechanism)
        memory = records.law_memory(
            self.mechanism, law, compensated=compensated, limited=self.keeps_joint_limits
        )
        take_over(memory, self.memory)
        # An invalid law has raised by now, and the active one is unchanged.
        self._law, self._plug_in, self._kernel = law, plug_in, None
        self.is_compensated = compensated
        self._of_tick_before = records.of_tick_before(
            law, compensated=compensated, limited=self.keeps_joint_limits
        )
        self.settings, self._read = settings, read
        self._use_memory(memory)

    def _carry(self, nominal: Array) -> None:
        """Replace the nominal model (parameters), and change theta_hat as much."""
        self.estimate[:] += nominal - self.nominal
        self.nominal = nominal
        fill(self.settings, 'nominal', nominal)

    def _use_memory(self, memory: Records) -> None:
        self.memory = memory
        self.commanded: Array = memory['commanded'][0, :, 0]

    def _new_memory(self) -> Records:
        return records.law_memory(
            self.mechanism,
            self._law,
            compensated=self.is_compensated,
            limited=self.keeps_joint_limits,
        )

    def _apply(self, values: Values) -> None:
        self.values = dict(values)
        records.write_parameters(self.settings, self._read, values)
        if self._plug_in is None and PROJECTION_LOWER.of(values) > 0.0:
            post_update(self.settings, self.memory)

    def _tick_plug_in(self, law: PlugInLaw) -> bool:
        signals = self.signals
        if self.is_compensated:
            signals = self._predicted
            predict_state(self.settings, self.memory, self.signals, signals)
        elif self.values[VELOCITY_SOURCE.name] == ESTIMATED_RATES:
            estimate_velocity(self.settings, self.memory, self.signals)
        gains = {
            name: np.array(value) if isinstance(value, tuple) else value
            for name, value in self.values.items()
        }
        inputs = tick_input(self.settings, signals, gains, self.estimate, self.commanded)
        self.used_estimate[:] = self.estimate
        torque, estimate = law.step(inputs)
        for array, result, what in (
            (self.raw_torque, torque, 'torque'),
            (self.estimate, estimate, 'estimate'),
        ):
            checked = np.asarray(result, dtype=np.float64)
            if checked.shape != array.shape or not np.isfinite(checked).all():
                raise InputError(
                    f'law = {LAW.of(self.values)}: its {what} is {checked.tolist()}, expected '
                    f'{array.size} finite numbers'
                )
            array[:] = checked
        if self.is_compensated:
            reduce_torque(self.settings, self.memory, self.signals, signals)
        limit_torque(self.settings, self.memory, self.signals)
        self.error[:] = signals['error'][0, :, 0] if self.is_compensated else inputs.error
        self.surface[:] = inputs.surface
        return inputs.singular
