# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Torques of a controller whose law is not active: the safe end of torque control.

An arm without brakes falls when its torque ends. After a fault, after `~/enable` with false and
after `~/emergency_stop` the controller therefore continues to command

    tau = sat(g(q) - alpha H(q) [(v - v_r) + (alpha / 4) (q - q_r)])

with gravity g and full inertia H of the nominal model. The reference brakes from the joint
velocities at the end of the law: v_r' = -8 v_r, q_r' = v_r. Wheels are held like other joints.
`gravity` and hand guiding have no stiffness, the term with q - q_r.

Three times bound the gain alpha: the period T, the delay (`latency` and `motor_lag`, or another
period if they are shorter), and the time in which `torque_rate_limit` allows a torque to rise to
`torque_limit`. The full inertia is essential: with its diagonal alone, damping is stable only at a
fifth of the gain.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.aliases import Array, Joints, Numbers, Records
from masmc_ros.jit.arrays import to_vector, write_along
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.dispatch import by_tag, interface
from masmc_ros.jit.field import Field
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import fill, new_record
from masmc_ros.jit.tuples import dot, elementwise, tail
from masmc_ros.jit.vectors import check_workspace
from masmc_ros.law.parts.delay_fields import LATENCY, MOTOR_LAG
from masmc_ros.law.parts.joint_limits import TORQUE_LIMIT, TORQUE_RATE_LIMIT
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, SOURCES, VELOCITY_SOURCE
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_parameters import HOLD, VOID
from masmc_ros.numerics.scalars import clipped, limited, minus, moved, times, zero
from masmc_ros.robot import mechanism
from masmc_ros.robot.declaration import formulas_of_tag
import numpy as np

GUIDE = 'guide'
"""Action while the arm is guided by hand: gravity torque and light damping."""

UNFOLD = 'unfold'
"""Action before a law starts in a singular posture: the joints move to a regular one."""

BALANCE = 'balance'
"""Action after a loss of the states: the gravity torque of the last state, no damping."""

BALANCE_TIME = 0.1
"""
Time in s for which the last gravity torque is better than no torque.

With wrong masses the arm falls after 0.2 s as with void, but in another direction.
"""

_MOST_GAIN = 40.0
"""Largest gain alpha in 1/s."""

_GUIDE_GAIN = 5.0
"""Gain alpha of hand guiding in 1/s: a hand feels a viscous load of 5 N·s/m per kg."""

_BRAKING = 8.0
"""Rate in 1/s at which the reference comes to rest."""

UNFOLDING = 4.0
"""Rate in 1/s at which the reference goes to a regular posture, and its largest speed in rad/s."""
_UNFOLDING_SPEED = 0.5

UNFOLDING_TIME = 5.0
"""Longest time in s to leave a singular joint position."""

_FILTER = 0.005
"""Time constant in s of the filter for velocities computed from joint angles."""

_LONGEST = 0.1
"""Longest time in s between two states that the reference accounts for."""

FIELDS = (
    Field('geometry', 'lengths', 'Lengths of the robot', 'm'),
    Field('nominal', 'parameters', 'theta of the nominal model'),
    Field('limit', 'joints', 'Limit of the torque; 0 disables it', 'N·m'),
    Field('rate_limit', 'joints', 'Limit of its rate; 0 disables it', 'N·m/s'),
    Field('period', description='Control period T', unit='s'),
    Field('position', 'positions', 'Positions of the last state', 'm, rad'),
    Field('angles', 'joints', 'Joint angles of the last state', 'rad'),
    Field('rates', 'joints', 'Joint velocities of the last state', 'rad/s'),
    Field('reference_angles', 'joints', 'q_r', 'rad'),
    Field('goal', 'joints', 'Joint angles to go to', 'rad'),
    Field('reference_rates', 'joints', 'v_r', 'rad/s'),
    Field('torque', 'joints', 'Torque commanded last', 'N·m'),
)
"""Record of `stop_torque`."""


@formula
def largest_gain(period: float, delay: float, limit: Numbers, rate: Numbers) -> float:
    """
    Return the largest gain alpha in 1/s for period, delay (s) and the limits of a torque.

    A delay shorter than the period counts as a period.
    """
    gain = min(0.4 / (period + max(period, delay)), _MOST_GAIN)
    for i in range(len(limit)):
        if limit[i] > 0.0 and rate[i] > 0.0:
            gain = min(gain, 4.0 * rate[i] / limit[i])
    return gain


@kernel
def stop_torque(
    stop: Records,
    position: Array,
    velocity: Array,
    elapsed: float,
    gain: float,
    stiffness: float,
    pull: float,
    is_estimated: bool,
    out: Array,
) -> bool:
    """Write the torque for a state, `elapsed` s after the one before; False if not finite."""
    body = lane_of(stop[0], 0)
    template = body.torque
    model = mechanism.model_of(body)
    at = to_vector(position, body.position)
    angles = tail(at, template)
    rates = tail(to_vector(velocity, body.position), template)
    if is_estimated:
        share = elapsed / (elapsed + _FILTER)
        before = body.angles
        rates = elementwise(_filtered, body.rates, before, angles, elapsed, share)
    elapsed = min(elapsed, _LONGEST)
    v_r = elementwise(
        _led,
        body.reference_rates,
        body.reference_angles,
        body.goal,
        1.0 / (1.0 + _BRAKING * elapsed),
        pull,
    )
    q_r = elementwise(moved, body.reference_angles, v_r, elapsed)
    body.position = at
    body.angles = angles
    body.rates = rates
    body.reference_rates = v_r
    body.reference_angles = q_r
    theta = body.nominal
    bend = mechanism.posture(model, at)
    apart = elementwise(_apart, rates, v_r, angles, q_r, stiffness)
    motion = mechanism.motion(model, apart)
    weight = mechanism.coriolis(model, bend, theta, elementwise(zero, motion))
    inertia = mechanism.inertia(model, bend, theta)
    feedback = mechanism.inertia_times(model, inertia, elementwise(times, motion, gain))
    raw = mechanism.joint_torques(model, elementwise(minus, weight, feedback))
    torque = elementwise(limited, raw, body.torque, body.limit, body.rate_limit, body.period)
    # The sum is zero for finite numbers and NaN otherwise.
    is_finite = dot(elementwise(minus, torque, torque), torque) == 0.0
    check_workspace(body)
    if is_finite:
        body.torque = torque
        write_along(out, 0, torque)
    return is_finite


@formula
def _led(rate: float, angle: float, goal: float, share: float, pull: float) -> float:
    """Return the next reference velocity: braked, and directed to a goal if `pull` is not zero."""
    return rate * share + (1.0 - share) * clipped(pull * (goal - angle), _UNFOLDING_SPEED)


@formula
def _filtered(rate: float, before: float, angle: float, elapsed: float, share: float) -> float:
    measured = (angle - before) / elapsed if elapsed > 0.0 else rate
    return rate + share * (measured - rate)


@formula
def _apart(rate: float, v_r: float, angle: float, q_r: float, stiffness: float) -> float:
    return (rate - v_r) + stiffness * (angle - q_r)


@interface(by_tag('mechanism', formulas_of_tag), formula)
def unfolded(body: Any, angles: Joints, rates: Joints) -> tuple[bool, Joints]:
    """
    Return whether no law should start from these joint angles and velocities, and a goal.

    Without a formula of the mechanism in `body` a law can start everywhere.
    """
    return False, angles


class SafeStop:
    """
    Torque commands in place of a controller's law.

    Results are written into `torque` and `commanded` of the controller.

    Attributes
    ----------
    action
        Current action: VOID, GRAVITY, HOLD, GUIDE, UNFOLD or BALANCE.

    """

    def __init__(self, controller: Controller) -> None:
        """
        Initialise the safe stop of a controller.

        Parameters
        ----------
        controller
            Controller with the robot, the nominal model, the limits and the parameter values.

        """
        self._controller = controller
        kind = controller.mechanism
        self._record = new_record(FIELDS, kind.sizes, 1, {'mechanism': kind.tag})
        fill(self._record, 'geometry', controller.robot.geometry)
        fill(self._record, 'period', controller.period)
        self._gain = self._stiffness = self._pull = 0.0
        self._stamp = 0
        self.action = VOID

    @property
    def commands(self) -> bool:
        """Return True if the action commands torques."""
        return self.action != VOID

    def start(self, action: str, stamp: int, position: Array, velocity: Array) -> None:
        """
        End the law and brake from a state.

        Parameters
        ----------
        action
            VOID, GRAVITY, HOLD, GUIDE, UNFOLD or BALANCE. Commanded rates always end with VOID.
        stamp
            Stamp of the state in ns.
        position, velocity
            State, (positions) each, in the order of joint_states.

        """
        controller = self._controller
        rates = controller.rates(velocity).copy()
        # After a divergence the estimated ones may not be finite.
        rates[~np.isfinite(rates)] = 0.0
        commanded = controller.commanded.copy()
        controller.output_not_applied()
        self.action = VOID if controller.commands_rates else action
        if not self.commands:
            return
        controller.commanded[:] = commanded
        self._stamp = stamp
        if action == GUIDE:
            rates[:] = 0.0
        self.change()
        angles = position[-len(rates):]
        goal = self._regular_posture(angles, rates) if action == UNFOLD else None
        for name, value in (
            ('angles', angles),
            ('rates', rates),
            ('reference_angles', angles),
            ('goal', angles if goal is None else goal),
            ('reference_rates', rates),
            ('torque', commanded),
        ):
            fill(self._record, name, np.asarray(value, np.float64))

    def change(self) -> None:
        """Use the nominal model and the parameter values of the controller from now on."""
        controller, gain = self._controller, self._largest_gain()
        if self.action == GUIDE:
            gain = min(gain, _GUIDE_GAIN)
        self._gain = 0.0 if self.action == BALANCE else gain
        self._stiffness = 0.25 * gain if self.action in (HOLD, UNFOLD) else 0.0
        self._pull = UNFOLDING if self.action == UNFOLD else 0.0
        for name, value in (
            ('nominal', controller.nominal),
            ('limit', TORQUE_LIMIT.of(controller.values)),
            ('rate_limit', TORQUE_RATE_LIMIT.of(controller.values)),
        ):
            fill(self._record, name, np.asarray(value, np.float64))

    def update(self, stamp: int, position: Array, velocity: Array) -> bool:
        """
        Compute the torque for a state.

        Parameters
        ----------
        stamp
            Stamp of the state in ns.
        position, velocity
            State, (positions) each, in the order of joint_states.

        Returns
        -------
        bool
            False if there is no torque: the action is VOID, or the result is not finite, after
            which the action is VOID.

        """
        if not self.commands:
            return False
        controller = self._controller
        elapsed = max((stamp - self._stamp) * 1e-9, 0.0)
        self._stamp = stamp
        is_estimated = controller.values[VELOCITY_SOURCE.name] == SOURCES[ESTIMATED]
        if not stop_torque(
            self._record,
            position,
            velocity,
            elapsed,
            self._gain,
            self._stiffness,
            self._pull,
            is_estimated,
            controller.torque,
        ):
            self.release()
            return False
        # A base that follows velocities comes to rest by its own drives.
        controller.torque[controller.by_velocity] = 0.0
        controller.commanded[:] = controller.torque
        return True

    def is_singular(self, position: Array, velocity: Array) -> bool:
        """Return True if the law should not start in this state (positions, positions)."""
        controller = self._controller
        if controller.commands_rates:
            return False
        angles = position[-len(controller.torque):]
        return self._regular_posture(angles, controller.rates(velocity)) is not None

    def _regular_posture(self, angles: Array, rates: Array) -> Array | None:
        body = lane_of(self._record[0], 0)
        is_singular, posture = unfolded(body, tuple(angles.tolist()), tuple(rates.tolist()))
        return np.array(posture) if is_singular else None

    def release(self) -> None:
        """End all commands; the commanded torque is zero."""
        self.action = VOID
        self._controller.output_not_applied()

    def end(self) -> None:
        """Let the law continue from the last commanded torque."""
        self.action = VOID

    def hand_over(self) -> None:
        """Restart the controller from the last commanded torque, zero after a void command."""
        commanded = self._controller.commanded.copy()
        self._controller.reset()
        self._controller.commanded[:] = commanded
        self.action = VOID

    def _largest_gain(self) -> float:
        """Return the largest gain alpha in 1/s for period, delay and torque rate limit."""
        values, joints = self._controller.values, len(self._controller.torque)
        limit, rate = (
            tuple(np.broadcast_to(values[name], joints).tolist())
            for name in ('torque_limit', 'torque_rate_limit')
        )
        delay = LATENCY.of(values) + MOTOR_LAG.of(values)
        return largest_gain(self._controller.period, delay, limit, rate)
