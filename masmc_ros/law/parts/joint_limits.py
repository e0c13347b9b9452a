# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Limits of joint positions and speeds that every law keeps: `joint_limits` with enforce.

Each tick has an interval of accelerations per joint. Within it, the joint keeps its speed limit,
and it can still stop before the end of its range with `limit_deceleration`. The nominal model
gives the accelerations a = a_0 + A d of the joints under a change d of their torques, A = H^-1.
a_0 contains the filtered difference between measured accelerations and those of the model, such as
from a load that the model does not have: without it, a lift whose assumed mass is half of the
true one would seem to accelerate upwards while it falls. If a_0 leaves an interval, d minimises

    1/2 d' A d + sum_i max over a_i in its interval of -d_i a_i + d' a_0,

which is the dual of min (a - a_0)' H (a - a_0) with all a_i in their intervals: Gauss' principle,
as if the joint touched an end stop. Only the torques of joints at their limits change. Bounds of
d_i keep `torque_limit` and `torque_rate_limit`. Each d_i has a closed form for the others fixed,
and A is positive definite, so sweeps over the joints converge. A general QP solver needs the same
solution, its own code in each law, and more memory.

Without this choice the compiled code contains none of it: `LIMITS` selects it.

The magnitude and the rate of the commanded torques are limited by `torque_limit` and
`torque_rate_limit`.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

from masmc_ros.aliases import Array, Joints, Numbers
from masmc_ros.jit.arrays import array_of, to_vector, write_part
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.dispatch import by_tag, interface
from masmc_ros.jit.field import field
from masmc_ros.jit.scratch import scratch
from masmc_ros.jit.tuples import elementwise, unit
from masmc_ros.law.declared import PerEntry
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.numerics.scalars import limited
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import mechanism
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.formula_types import Lengths, MechanismPosture
import numpy as np

TORQUE_LIMIT = PerEntry(
    'torque_limit',
    'joints',
    'torque_limit',
    'Limit of the commanded torque',
    'N·m',
    note='; 0: no limit',
)

TORQUE_RATE_LIMIT = PerEntry(
    'torque_rate_limit',
    'joints',
    'torque_rate_limit',
    'Limit of the rate of the commanded torque',
    'N·m/s',
    note='; 0: no limit',
)


@formula
def within_limits(settings: Settings, raw: Joints, before: Joints) -> Joints:
    """
    Return the commanded torques: those of a law within `torque_limit` and `torque_rate_limit`.

    Parameters
    ----------
    settings
        Settings of the law; a limit of 0 does not limit.
    raw
        Joint torques (joints) that the law requests in N·m.
    before
        Commanded torques (joints) of the last tick in N·m.

    """
    return elementwise(
        limited,
        raw,
        before,
        settings.torque_limit,
        settings.torque_rate_limit,
        settings.period,
    )


IGNORE, ENFORCE = 'ignore', 'enforce'

CHOICE = Parameter(
    'joint_limits',
    IGNORE,
    'Limits of joint positions (URDF) and speeds (URDF, robot.speed_limits): ignore, or enforce, '
    'which changes the torques of any law as little as necessary to keep them',
    choices=(IGNORE, ENFORCE),
)

PARAMETERS = (
    TORQUE_LIMIT,
    TORQUE_RATE_LIMIT,
    CHOICE,
    Parameter(
        'limit_deceleration',
        10.0,
        'Deceleration with which a joint stops before the end of its range, with joint_limits '
        'enforce; in m/s² for prismatic joints',
        unit='rad/s²',
        minimum=0.0,
        exclusive_minimum=True,
        read_only=False,
    ),
)

OFF, ON = '', 'joints'
"""Tags of settings."""

MARGIN, SPEED_SHARE = 1e-3, 0.99
"""
Distance of the kept range from the ends in rad or m, and share of the speed limit that is kept.

Accelerations vary within a period, so the interval of a tick is not exact.
"""

_HORIZON = 2.0
"""
Time in periods for which an acceleration stays within its interval.

With one period, the loop oscillates if the true inertia is half of the nominal one.
"""

_RETURN_RATE = 10.0
"""Rate in 1/s at which a joint outside its range returns."""

_HARDEST = 10.0
"""Largest deceleration before the ends, relative to `limit_deceleration`."""

_NEW_SHARE = 0.05
"""
Share of a new difference of accelerations in the filtered one.

With true inertias of half of the nominal ones, larger shares oscillate at 10 ms of latency and
1 kHz.
"""

_ENOUGH, _MOST_SWEEPS = 1e-7, 200
"""Last change of an acceleration in rad/s², and largest number of sweeps."""


class LimitSettings(Settings):
    """Settings of the law with limits, infinite without a limit."""

    lowest_position: Joints = field('Lower end of the kept range', 'rad')
    highest_position: Joints = field('Upper end of the kept range', 'rad')
    highest_speed: Joints = field('Largest kept speed', 'rad/s')


class LimitMemory(Memory):
    """Memory of the law with limits."""

    limited_ticks: int = field('Ticks with torques changed by joint limits')
    expected_acceleration: Joints = field(
        'Accelerations of the last tick by the nominal model; NaN: no such tick',
        'rad/s^2',
        initial=math.nan,
    )
    rates_before: Joints = field('Velocities of the joints at the last tick', 'rad/s')
    acceleration_error: Joints = field(
        'Filtered accelerations of the joints less those of the nominal model', 'rad/s^2'
    )


def kept_limits(mechanism: Mechanism) -> tuple[Array, Array, Array]:
    """Return lower ends, upper ends and speeds (joints) within the limits by the margins."""
    lower, upper = np.transpose(np.array(mechanism.position_limits))
    speed = SPEED_SHARE * np.array(mechanism.speed_limits)
    # A narrow range keeps its middle.
    margin = np.minimum(MARGIN, 0.25 * (upper - lower))
    return lower + margin, upper - margin, speed


@formula
def highest_acceleration(
    distance: float, speed: float, fastest: float, horizon: float, deceleration: float
) -> float:
    """
    Return the largest acceleration of a joint towards the upper end of its range.

    Parameters
    ----------
    distance
        Distance to the end in rad, negative beyond it, infinite without an end.
    speed, fastest
        Speed towards the end, and its limit in rad/s.
    horizon
        Time for which the acceleration acts in s.
    deceleration
        Deceleration available afterwards in rad/s².

    """
    travel = distance - 0.5 * speed * horizon
    if distance < 0.0:
        bound = (_RETURN_RATE * distance - speed) / horizon
    elif travel >= 0.0:
        # The speed after the horizon from which the joint stops at the end.
        loss = deceleration * horizon
        after = 0.5 * (math.sqrt(loss * loss + 8.0 * deceleration * travel) - loss)
        bound = (after - speed) / horizon
    else:
        # The joint turns within the horizon; at the end of its range within a quarter of it.
        bound = -0.5 * speed * speed / max(distance, 0.125 * speed * horizon)
    # Braking hard must not end in the other direction, faster than the limit.
    bound = max(bound, -_HARDEST * deceleration, -(fastest + speed) / horizon)
    return min(bound, (fastest - speed) / horizon)


@kernel
def limit_change(
    inverse: Array, free: Array, lowest: Array, highest: Array, least: Array, most: Array,
    change: Array,
) -> None:
    """
    Write the smallest change of torques with which accelerations are in their intervals.

    Parameters
    ----------
    inverse
        Inverse H^-1 (joints, joints) of the inertia.
    free
        Accelerations (joints) without a change in rad/s²; overwritten by those with the change.
    lowest, highest
        Intervals (joints) in rad/s².
    least, most
        Bounds (joints) of the change in N·m.
    change
        Output (joints) in N·m.

    """
    count = len(free)
    for i in range(count):
        change[i] = 0.0
    for _ in range(_MOST_SWEEPS):
        largest = 0.0
        for i in range(count):
            gain = inverse[i, i]
            without = free[i] - gain * change[i]
            target = 0.0
            if without > highest[i]:
                target = (highest[i] - without) / gain
            elif without < lowest[i]:
                target = (lowest[i] - without) / gain
            target = min(max(target, least[i]), most[i])
            step = target - change[i]
            if step != 0.0:
                change[i] = target
                for j in range(count):
                    free[j] += inverse[i, j] * step
                largest = max(largest, abs(step * gain))
        if largest <= _ENOUGH:
            break


@kernel
def _kept(
    model: Lengths,
    posture: MechanismPosture,
    settings: LimitSettings,
    angles: Numbers,
    rates: Numbers,
    before: Numbers,
    torque: Numbers,
    error: Numbers,
) -> tuple[Numbers, Numbers]:
    """
    Return torques, within their limits, that keep those of positions and speeds.

    `error` is the part of the accelerations that the nominal model lacks; also returns those of
    the model under the returned torques.
    """
    count, theta = len(torque), settings.nominal
    limit, rate_limit = array_of(settings.torque_limit), array_of(settings.torque_rate_limit)
    lower, upper = array_of(settings.lowest_position), array_of(settings.highest_position)
    fastest = array_of(settings.highest_speed)
    at, speed = array_of(angles), array_of(rates)
    last, request, lacking = array_of(before), array_of(torque), array_of(error)
    accelerations = array_of(
        mechanism.joint_accelerations(model, posture, theta, rates, torque)
    )
    horizon, deceleration = _HORIZON * settings.period, settings.limit_deceleration
    free, lowest, highest, out = scratch(count), scratch(count), scratch(count), scratch(count)
    is_outside = False
    for i in range(count):
        free[i], out[i] = accelerations[i] + lacking[i], request[i]
        high = highest_acceleration(upper[i] - at[i], speed[i], fastest[i], horizon, deceleration)
        low = -highest_acceleration(
            at[i] - lower[i], -speed[i], fastest[i], horizon, deceleration
        )
        if low > high:
            low = high = 0.5 * (low + high)
        lowest[i], highest[i] = low, high
        is_outside |= (free[i] < low) | (free[i] > high)
    if is_outside:
        h = mechanism.inertia(model, posture, theta)
        inverse, change = scratch(count, count), scratch(count)
        least, most = scratch(count), scratch(count)
        for i in range(count):
            forces = mechanism.forces(model, unit(torque, i))
            column = mechanism.joint_rates(model, mechanism.inertia_solve(model, h, forces))
            write_part(inverse, i, 0, column)
            top = limit[i] if limit[i] > 0.0 else math.inf
            step = rate_limit[i] * settings.period if rate_limit[i] > 0.0 else math.inf
            # The request itself is within both, so zero is.
            least[i] = min(max(-top, last[i] - step) - request[i], 0.0)
            most[i] = max(min(top, last[i] + step) - request[i], 0.0)
        limit_change(inverse, free, lowest, highest, least, most, change)
        for i in range(count):
            out[i] = request[i] + change[i]
    for i in range(count):
        free[i] -= lacking[i]
    return to_vector(out, torque), to_vector(free, torque)


@formula
def _filtered(error: float, expected: float, before: float, rate: float, period: float) -> float:
    change = (rate - before) / period - expected - error
    # NaN after a tick that was not computed.
    return error + _NEW_SHARE * change if change == change else error


@formula
def _kept_torque(
    settings: LimitSettings,
    memory: LimitMemory,
    posture: MechanismPosture,
    angles: Numbers,
    rates: Numbers,
    before: Numbers,
    torque: Numbers,
) -> Numbers:
    model = mechanism.model_of(settings)
    error = elementwise(
        _filtered, memory.acceleration_error, memory.expected_acceleration, memory.rates_before,
        rates, settings.period,
    )  # fmt: skip
    kept, expected = _kept(model, posture, settings, angles, rates, before, torque, error)
    memory.acceleration_error = error
    memory.expected_acceleration = expected
    memory.rates_before = rates
    memory.limited_ticks = memory.limited_ticks + (1 if kept != torque else 0)
    return kept


LIMITS = {
    OFF: SimpleNamespace(),
    ON: SimpleNamespace(kept_torque=_kept_torque),
}
"""Formulas by the tag `limits` of the settings of a law; the body below is that of OFF."""


@interface(by_tag('limits', LIMITS.__getitem__), formula)
def kept_torque(
    settings: Settings,
    memory: Memory,
    posture: MechanismPosture,
    angles: Numbers,
    rates: Numbers,
    before: Numbers,
    torque: Numbers,
) -> Numbers:
    """
    Return the torques (joints) that keep positions and speeds; `torque` if they are ignored.

    Parameters
    ----------
    settings, memory
        Settings and memory of the law.
    posture
        Posture of the state in which the law was evaluated.
    angles, rates
        Positions and velocities of the joints (joints) in that state.
    before
        Commanded torques (joints) of the last tick in N·m.
    torque
        Torques (joints) of the law within `torque_limit` and `torque_rate_limit` in N·m.

    """
    return torque
