# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Compiled supervision of a tick, for programs without Python.

`supervision_start` decides before a tick whether the law is computed, and which reference it
follows. `supervision_end` replaces the torque of a law that is not active by that of the safe
stop. Between both, the caller computes `control_tick` with the reference `followed`. The approach,
the torque of the safe stop and the rules of faults are the functions that the controller core
calls; the order of the steps is that of the core in real time. Stamps and times are in ns.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.aliases import Array, Records
from masmc_ros.jit.arrays import array_of, changeable, to_vector
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.field import Field
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import copy_nan, copy_to, fill, new_record
from masmc_ros.jit.tuples import elementwise, joined, tail, thirds
from masmc_ros.jit.vectors import check_workspace
from masmc_ros.law.command_interface import COMMAND_INTERFACE, COMMAND_INTERFACES, EFFORT
from masmc_ros.law.parts.delay_compensation import note_skipped
from masmc_ros.law.parts.delay_fields import LATENCY, MOTOR_LAG
from masmc_ros.law.parts.velocity_estimator import ESTIMATED
from masmc_ros.loop import fault_rules, safe_stop
from masmc_ros.loop.closed_loop import finite_residual, NOT_FINITE
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_parameters import (
    APPROACH_SPEED,
    FAULT_ACTION,
    FAULT_ACTIONS,
    REFERENCE_TIMEOUT,
)
from masmc_ros.numerics.scalars import nearest, zero
from masmc_ros.params.declaration import Values
from masmc_ros.reference import approach

INACTIVE, ACTIVE, FAULT = 0, 1, 2
"""Modes."""

STATES, REFERENCE, LAW, STOPPED = 1, 2, 3, 4
"""Causes of faults; 0 without a fault."""

ENABLE, DISABLE, STOP, CLEAR = 1, 2, 3, 4
"""Requests; 0 without a request."""

VOID, GRAVITY, HOLD, BALANCE, UNFOLD = 0, 1, 2, 3, 4
"""Actions of the safe stop."""

NAMES = {
    'INACTIVE': INACTIVE, 'ACTIVE': ACTIVE, 'FAULT': FAULT,
    'CAUSE_STATES': STATES, 'CAUSE_REFERENCE': REFERENCE, 'CAUSE_LAW': LAW,
    'CAUSE_STOP': STOPPED, 'ENABLE': ENABLE, 'DISABLE': DISABLE, 'STOP': STOP, 'CLEAR': CLEAR,
    'VOID': VOID, 'GRAVITY': GRAVITY, 'HOLD': HOLD,
}  # fmt: skip
"""Numbers of modes, causes, requests and values of `fault_action`, by their names in C."""

_is_overdue = formula(fault_rules.is_overdue)
_recovers = formula(fault_rules.recovers)
_takes_fault = formula(fault_rules.takes_fault)

_BALANCE_NS = round(1e9 * safe_stop.BALANCE_TIME)
_UNFOLDING_NS = round(1e9 * safe_stop.UNFOLDING_TIME)

PROGRAM_FIELDS = (
    Field('request', description='ENABLE, DISABLE, STOP (emergency stop) or CLEAR (a fault); '
          'the next call processes it and writes 0', kind='i8'),
    Field('fault_action', description='HOLD, GRAVITY or VOID', kind='i8'),
    Field('state_timeout', description='Time without a new state until a fault', unit='ns',
          kind='i8'),
    Field('reference_timeout', description='Time from the end of the reference to a fault; 0: hold'
          ' its last position indefinitely', unit='ns', kind='i8'),
    Field('approach_speed', description='Speed per task axis of the approach; 0: no approach',
          unit='m/s'),
    Field('mode', description='INACTIVE, ACTIVE or FAULT; read only', kind='i8'),
    Field('cause', description='CAUSE_... of a fault, 0 without one; read only', kind='i8'),
    Field('is_latched', description='1: the fault stays until a request; read only', kind='i8'),
    Field('commands', description='0 if no torque is commanded, which then is 0; read only',
          kind='i8'),
)
"""Members of the record for programs."""

FIELDS = (
    *PROGRAM_FIELDS,
    *safe_stop.FIELDS,
    Field('delay', description='Delay in the gain of the safe stop', unit='s'),
    Field('restarts', kind='i8', description='1 if the next tick of the law restarts it'),
    Field('was_computed', kind='i8', description='1 if the law computed the last command'),
    Field('has_moved', kind='i8', description='1 after a torque of the law'),
    Field('has_state', kind='i8', description='1 after the first state'),
    Field('stamp', kind='i8', description='Stamp of the last state', unit='ns'),
    Field('arrival', kind='i8', description='Start of the state timeout', unit='ns'),
    Field('computed', kind='i8', description='Stamp of the last tick of the law', unit='ns'),
    Field('measured', 'positions', 'Positions of the last state', 'm, rad'),
    Field('measured_rates', 'positions', 'Velocities of the last state', 'm/s, rad/s'),
    Field('computes', kind='i8', description='1 between the calls if the law is computed'),
    Field('commanded', 'joints', 'Torque before the tick', 'N·m'),
    Field('action', kind='i8', description='Requested action of the safe stop'),
    Field('active_action', kind='i8', description='Its action, void after a result not finite'),
    Field('gain', description='alpha', unit='1/s'),
    Field('stiffness', description='Stiffness over gain', unit='1/s'),
    Field('pull', description='Pull to the goal', unit='1/s'),
    Field('unfolded_by', kind='i8', description='End of leaving a singular posture, or 0',
          unit='ns'),
    Field('stop_stamp', kind='i8', description='Stamp of its last state', unit='ns'),
    Field('is_stale', kind='i8', description='1 after a state timeout'),
    Field('lost', kind='i8', description='Time of the state timeout', unit='ns'),
    Field('should_stop', kind='i8', description='1 if the second call computes the safe stop'),
    Field('has_reference', kind='i8', description='1 after the first reference'),
    Field('is_held', kind='i8', description='1 while the last position is held'),
    Field('held_since', kind='i8', description='Time of the end of the reference', unit='ns'),
    Field('reference', 'desired', 'Last reference'),
    Field('reference_stamp', kind='i8', description='Its stamp', unit='ns'),
    Field('is_watched', kind='i8', description='1 if the next reference is compared with it'),
    Field('followed', 'desired', 'Reference for control_tick'),
    Field('approach_due', kind='i8', description='1 if an approach starts at the next tick'),
    Field('approach_on', kind='i8', description='1 during an approach'),
    Field('approach_start', kind='i8', description='Stamp of its start', unit='ns'),
    Field('approach_duration', description='Its duration', unit='s'),
    Field('distance', 'desired', 'Its distances'),
    Field('motion', 'axes', 'Its velocities at the start'),
    Field('start', 'axes', 'x at its start'),
)  # fmt: skip


def is_supervised(values: Values) -> bool:
    """Return True if a controller commands torques, for which the supervision is compiled."""
    interface = COMMAND_INTERFACE.of(values)
    return interface == COMMAND_INTERFACES[EFFORT]


def supervision_record(controller: Controller, state_timeout: float) -> Records:
    """Return the record (1) at the start: active, without a state; the timeout is in s."""
    kind, values = controller.mechanism, controller.values
    record = new_record(FIELDS, kind.sizes, 1, {'mechanism': kind.tag})
    for name, value in (
        ('geometry', controller.robot.geometry),
        ('period', controller.period),
        ('delay', LATENCY.of(values) + MOTOR_LAG.of(values)),
        ('fault_action', FAULT_ACTIONS.index(FAULT_ACTION.of(values))),
        ('state_timeout', round(1e9 * state_timeout)),
        ('reference_timeout', round(1e9 * REFERENCE_TIMEOUT.of(values))),
        ('approach_speed', APPROACH_SPEED.of(values)),
        ('mode', ACTIVE),
        ('restarts', 1),
    ):  # fmt: skip
        fill(record, name, value)
    return record


@kernel
def supervision_start(
    body: Records,
    initial: Records,
    settings: Records,
    memory: Records,
    stamp: int,
    now: int,
    position: Array,
    velocity: Array,
    reference: Array,
    has_reference: int,
) -> int:
    """
    Prepare a tick; return 1 if the caller computes the law with the reference `followed`.

    Parameters
    ----------
    body
        Record of the supervision.
    initial
        Memory at the start of a run.
    settings, memory
        Records of the controller.
    stamp
        Stamp of the state. A state with the stamp of the last one, or with numbers that are not
        finite, is no new state.
    now
        Time of the call.
    position, velocity
        State, in the order of joint_states.
    reference
        Reference at `stamp` (3 * axes).
    has_reference
        0 if there is no reference at `stamp`.

    """
    state, gains, before = lane_of(body[0], 0), lane_of(settings[0], 0), lane_of(memory[0], 0)
    was_active = state.mode == ACTIVE
    _process_request(state, now)
    state.computes, state.should_stop = 0, 0
    measured = to_vector(position, state.measured)
    rates = to_vector(velocity, state.measured)
    is_new = finite_residual(measured) + finite_residual(rates) == 0.0
    if is_new and state.has_state != 0:
        if 0 <= state.stamp - stamp <= state.state_timeout:
            is_new = False
        elif abs(stamp - state.stamp) > state.state_timeout:
            state.restarts = 1
            if state.active_action == VOID:
                before.commanded = elementwise(zero, before.commanded)
            # The safe stop restarts as well.
            state.was_computed = 1
    if not is_new:
        is_watched = state.mode == ACTIVE or (state.active_action != VOID and state.is_stale == 0)
        if state.has_state == 0:
            return 0
        if is_watched and _is_overdue(now, state.arrival, state.state_timeout):
            _take_fault(state, STATES, 0)
            state.is_stale, state.lost = 1, now
            _start_stop(state, gains, before, BALANCE if _stop_action(state) != VOID else VOID)
            state.was_computed, state.should_stop = 0, 1
        elif state.is_stale != 0 and now - state.lost >= _BALANCE_NS:
            state.active_action = VOID
            before.commanded = elementwise(zero, before.commanded)
            state.should_stop = 1
        elif was_active and state.mode != ACTIVE:
            _stop(state, gains, before)
        check_workspace(state)
        return 0
    state.has_state, state.stamp, state.arrival = 1, stamp, now
    state.measured, state.measured_rates = measured, rates
    if _recovers(state.mode == FAULT, state.is_latched != 0, state.cause == STATES):
        state.mode, state.cause, state.restarts = ACTIVE, 0, 1
    sample = to_vector(reference, state.reference)
    has_sample = has_reference != 0 and finite_residual(sample) == 0.0
    if has_sample:
        state.is_held = 0
        if _recovers(state.mode == FAULT, state.is_latched != 0, state.cause == REFERENCE):
            state.mode, state.cause, state.restarts = ACTIVE, 0, 1
    elif state.mode != ACTIVE:
        state.is_held = 0
    elif state.has_reference != 0:
        if state.is_held == 0:
            state.is_held, state.held_since = 1, now
        if state.reference_timeout > 0 and _is_overdue(
            now, state.held_since, state.reference_timeout
        ):
            _take_fault(state, REFERENCE, 0)
    if state.mode != ACTIVE or not (has_sample or state.has_reference != 0):
        if state.mode == ACTIVE:
            state.restarts = 1
        _stop(state, gains, before)
        check_workspace(state)
        return 0
    if state.restarts != 0 and _unfolds(state, gains, before):
        check_workspace(state)
        return 0
    state.unfolded_by = 0
    state.commanded = before.commanded
    if state.restarts != 0:
        copy_to(initial[0], memory[0])
        before.commanded = state.commanded
        _start_approach(state)
    else:
        skipped = nearest((stamp - state.computed) / (1e9 * state.period)) - 1
        if skipped > 0:
            copy_nan(initial[0], memory[0])
            before.uncomputed_ticks += skipped
            note_skipped(gains, before, skipped)
    state.restarts, state.was_computed, state.has_moved, state.is_stale = 0, 1, 1, 0
    state.active_action, state.computed, state.computes = VOID, stamp, 1
    if has_sample:
        desired = sample
    else:
        x, v, a = thirds(state.reference)
        desired = joined(joined(x, elementwise(zero, v)), elementwise(zero, a))
    _follow(body, state, gains, before, stamp, desired)
    state.reference, state.has_reference, state.commands = desired, 1, 1
    check_workspace(state)
    return 1


@kernel
def supervision_end(
    body: Records, settings: Records, memory: Records, signals: Records, status: int
) -> int:
    """
    Complete a tick: a law whose result is not finite is a fault, and the safe stop commands.

    Parameters
    ----------
    body, settings, memory, signals
        Records of supervision and controller.
    status
        Flags of `control_tick`; 0 if it was not called.

    Returns
    -------
    int
        `status`.

    """
    state, gains, row = lane_of(body[0], 0), lane_of(settings[0], 0), lane_of(signals[0], 0)
    before = lane_of(memory[0], 0)
    if state.computes != 0 and status & NOT_FINITE != 0:
        before.commanded = state.commanded
        _take_fault(state, LAW, 1)
        _stop(state, gains, before)
    state.computes = 0
    if state.should_stop == 0:
        check_workspace(state)
        return status
    state.should_stop = 0
    torque = changeable(row.torque)
    is_commanded = False
    if state.active_action != VOID:
        elapsed = max((state.stamp - state.stop_stamp) * 1e-9, 0.0)
        state.stop_stamp = state.stamp
        is_commanded = safe_stop.stop_torque(
            body,
            array_of(state.measured),
            array_of(state.measured_rates),
            elapsed,
            state.gain,
            state.stiffness,
            state.pull,
            gains.velocity_source == ESTIMATED,
            torque,
        )
    if is_commanded:
        row.torque = to_vector(torque, row.torque)
        state.commands = 1
    else:
        row.torque = elementwise(zero, row.torque)
        state.active_action, state.commands = VOID, 0
    before.commanded = row.torque
    check_workspace(state)
    return status


@formula
def _process_request(state: Any, now: int) -> None:
    """Change the mode as requested."""
    if state.request == ENABLE:
        if state.mode != ACTIVE:
            state.restarts, state.arrival = 1, now
        state.mode, state.cause, state.is_latched = ACTIVE, 0, 0
    elif state.request == DISABLE or (state.request == CLEAR and state.mode == FAULT):
        state.mode, state.cause, state.is_latched = INACTIVE, 0, 0
    elif state.request == STOP:
        _take_fault(state, STOPPED, 1)
    state.request = 0


@formula
def _take_fault(state: Any, cause: int, latches: int) -> None:
    is_latched_fault = state.mode == FAULT and state.is_latched != 0
    if _takes_fault(state.mode == ACTIVE, is_latched_fault, latches != 0):
        state.mode, state.cause, state.is_latched = FAULT, cause, latches


@formula
def _stop_action(state: Any) -> int:
    # A controller that has not moved the robot does not hold it either.
    return state.fault_action if state.has_moved != 0 else VOID


@formula
def _stop(state: Any, gains: Any, memory: Any) -> None:
    """Let the safe stop command; start it if the law or another action has commanded before."""
    action = _stop_action(state)
    if state.was_computed != 0 or action != state.action or state.is_stale != 0:
        _start_stop(state, gains, memory, action)
    state.action, state.was_computed, state.is_stale, state.should_stop = action, 0, 0, 1
    state.unfolded_by = 0


@formula
def _unfolds(state: Any, gains: Any, memory: Any) -> bool:
    """Leave a singular posture before the law starts; return False if it is regular."""
    angles = tail(state.measured, state.torque)
    is_singular, _ = safe_stop.unfolded(state, angles, _driven_rates(state, gains, memory))
    if not is_singular or (state.unfolded_by != 0 and state.stamp >= state.unfolded_by):
        return False
    if state.unfolded_by == 0:
        state.unfolded_by = state.stamp + _UNFOLDING_NS
        state.has_moved, state.was_computed, state.action = 1, 0, UNFOLD
        _start_stop(state, gains, memory, UNFOLD)
    state.should_stop, state.is_stale = 1, 0
    return True


@formula
def _start_stop(state: Any, gains: Any, memory: Any, action: int) -> None:
    """Brake from the last state; see `safe_stop.SafeStop.start`."""
    state.active_action, state.stop_stamp = action, state.stamp
    angles = tail(state.measured, state.torque)
    rates = elementwise(_finite_or_zero, _driven_rates(state, gains, memory))
    memory.estimator_initialised = 0
    state.nominal = gains.nominal
    state.limit, state.rate_limit = gains.torque_limit, gains.torque_rate_limit
    gain = safe_stop.largest_gain(state.period, state.delay, state.limit, state.rate_limit)
    state.gain = 0.0 if action == BALANCE else gain
    state.stiffness = 0.25 * gain if action in (HOLD, UNFOLD) else 0.0
    state.pull = safe_stop.UNFOLDING if action == UNFOLD else 0.0
    state.angles, state.rates = angles, rates
    state.reference_angles, state.reference_rates = angles, rates
    state.goal = safe_stop.unfolded(state, angles, rates)[1] if action == UNFOLD else angles
    state.torque = memory.commanded


@formula
def _driven_rates(state: Any, gains: Any, memory: Any) -> Any:
    """Return the velocities of the driven joints; see `Controller.rates`."""
    measured = tail(state.measured_rates, memory.rates)
    is_estimated = gains.velocity_source == ESTIMATED
    is_known = memory.estimator_initialised != 0
    return elementwise(_chosen, is_estimated, is_known, memory.rates, measured)


@formula
def _chosen(is_estimated: bool, is_known: bool, estimate: float, measured: float) -> float:
    return (estimate if is_known else 0.0) if is_estimated else measured


@formula
def _finite_or_zero(value: float) -> float:
    return value if value - value == 0.0 else 0.0


@formula
def _start_approach(state: Any) -> None:
    is_on = 1 if state.approach_speed > 0.0 else 0
    state.approach_due, state.approach_on = is_on, is_on


@formula
def _follow(
    body: Any, state: Any, gains: Any, memory: Any, stamp: int, desired: Any
) -> None:
    """Write the reference to follow; see `reference.approach.Approach`."""
    sample = array_of(desired)
    if state.has_reference != 0 and state.is_watched != 0:
        elapsed, speed = (stamp - state.reference_stamp) * 1e-9, state.approach_speed
        if approach.steps(
            array_of(state.reference), sample, elapsed, speed * approach.CONTINUOUS, speed
        ):
            _start_approach(state)
    state.is_watched, state.reference_stamp = 1, stamp
    state.followed = desired
    if state.approach_on == 0:
        return
    distance, motion = changeable(state.distance), changeable(state.motion)
    start = changeable(state.start)
    position = array_of(state.measured)
    if state.approach_due != 0:
        state.approach_due, state.approach_start = 0, stamp
        rates = array_of(_driven_rates(state, gains, memory))
        way = approach.approach_start(
            body, position, rates, sample, state.approach_speed, distance, motion, start
        )
        state.approach_duration = approach.duration_of(way, state.approach_speed)
        state.distance = to_vector(distance, state.distance)
        state.motion = to_vector(motion, state.motion)
        state.start = to_vector(start, state.start)
    part = (stamp - state.approach_start) * 1e-9 / state.approach_duration
    if 0.0 <= part < 1.0:
        out = changeable(state.followed)
        approach.approach_sample(
            body, sample, distance, motion, start, state.approach_duration, part, out
        )
        state.followed = to_vector(out, state.followed)
    else:
        state.approach_on = 0
