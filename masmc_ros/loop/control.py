# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""One tick of the control law in all lanes, from state and reference to the command."""

from __future__ import annotations

from masmc_ros.aliases import Joints, Record
from masmc_ros.jit.compiled import formula, inlined, large_part, part
from masmc_ros.jit.lanes import lane_of, shared
from masmc_ros.jit.record import copy_lane, copy_to, lane_count
from masmc_ros.jit.tuples import elementwise, tail, thirds
from masmc_ros.jit.vectors import free, mark
from masmc_ros.law import law
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.parts import delay_compensation, joint_limits, moving_base
from masmc_ros.law.parts.delay_prediction import State
from masmc_ros.law.parts.joint_limits import within_limits
from masmc_ros.law.parts.velocity_estimator import estimate_rates, ESTIMATED, note_disturbance
from masmc_ros.law.tick import Tick, tick_of
from masmc_ros.numerics.scalars import minus
from masmc_ros.plant_model.plant_fields import Signals
from masmc_ros.robot import mechanism


@inlined
def control(settings: Record, memory: Record, signals: Record) -> None:
    """Compute one tick of the law from the state and the reference in `signals`."""
    estimators = _estimate(settings, memory, signals)
    for lane in range(lane_count(settings)):
        _control(lane_of(settings, lane), lane_of(memory, lane), lane_of(signals, lane))
    _finish(settings, memory, signals, estimators)


@inlined
def control_by_shortcut(
    shortcut: Record, settings: Record, memory: Record, before: Record, signals: Record
) -> None:
    """
    Compute one tick as `control` does, by the shortcut of the reaching term where it applies.

    Parameters
    ----------
    shortcut
        The settings with the shortcut as their reaching term, see `law.reaching.SHORTCUT`.
    settings, memory, signals
        See `control`.
    before
        Record for the memory before the tick.

    """
    estimators = _estimate(settings, memory, signals)
    lanes, repeated = lane_count(settings), 0.0
    for lane in range(lanes):
        lane_of(memory, lane).needs_full = 0.0
    copy_to(memory, before)
    for lane in range(lanes):
        _control(lane_of(shortcut, lane), lane_of(memory, lane), lane_of(signals, lane))
    for lane in range(lanes):
        repeated += lane_of(memory, lane).needs_full
    if repeated != 0.0:
        for lane in range(lanes):
            if lane_of(memory, lane).needs_full != 0.0:
                copy_lane(before, memory, lane)
                _control(lane_of(settings, lane), lane_of(memory, lane), lane_of(signals, lane))
    _finish(settings, memory, signals, estimators)


@inlined
def _estimate(settings: Record, memory: Record, signals: Record) -> int:
    """Estimate the velocities in the lanes that need it; return the number of lanes, or 0."""
    lanes, estimated = lane_count(settings), 0
    for lane in range(lanes):
        estimated += lane_of(settings, lane).velocity_source == ESTIMATED
    # A vectorised loop computes all lanes or none.
    estimators = 0 if estimated == 0 or delay_compensation.is_on(settings) else lanes
    gains, state, row = shared(settings), shared(memory), shared(signals)
    for lane in range(estimators):
        _estimate_rates(lane_of(gains, lane), lane_of(state, lane), lane_of(row, lane))
    return estimators


@large_part
def _estimate_rates(settings: Settings, memory: Memory, signals: Signals) -> None:
    if settings.velocity_source == ESTIMATED:
        knows = not ((settings.takes_rates != 0) | moving_base.moves_by_velocity(settings))
        estimate_rates(settings, memory, signals.position, knows)


@inlined
def _finish(settings: Record, memory: Record, signals: Record, estimators: int) -> None:
    """Pass the disturbance to the estimators, and update the law's memory after the tick."""
    gains, state, row = shared(settings), shared(memory), shared(signals)
    for lane in range(estimators):
        _pass_disturbance(lane_of(gains, lane), lane_of(state, lane), lane_of(row, lane))
    for lane in range(lane_count(settings)):
        law.post_update(lane_of(settings, lane), lane_of(memory, lane))


@large_part
def _pass_disturbance(settings: Settings, memory: Memory, signals: Signals) -> None:
    if settings.velocity_source == ESTIMATED:
        model = mechanism.model_of(settings)
        posture = mechanism.posture(model, signals.position)
        note_disturbance(memory, model, posture, memory.disturbance)


@inlined
def _control(settings: Settings, memory: Memory, signals: Signals) -> None:
    """Compute one tick of one lane."""
    place = mark(settings)
    common, state = shared(settings), shared(memory)
    tick, rates = _tick(common, state, signals)
    raw = law.torque(settings, tick, memory)
    raw, torque = _commanded(common, state, tick, rates, raw)
    law.learn(settings, tick, memory, raw, torque)
    _report(common, state, signals, tick, raw, torque)
    free(settings, place)


@part
def _tick(settings: Settings, memory: Memory, signals: Signals) -> tuple[Tick, Joints]:
    """Return the inputs of the law, and the joint rates (joints) in that state."""
    before = memory.commanded
    model = mechanism.model_of(settings)
    measured = tail(signals.velocity, before)
    is_estimated = settings.velocity_source == ESTIMATED
    state = delay_compensation.state_of_torque(
        settings,
        memory,
        State(
            signals.position,
            elementwise(_chosen, is_estimated, memory.rates, measured),
            signals.velocity,
            thirds(signals.reference),
        ),
    )
    signals.estimate = memory.estimate
    posture = mechanism.posture(model, state.position)
    tick = tick_of(
        settings,
        posture,
        mechanism.motion(model, state.rates),
        state.position,
        state.position_rates,
        state.desired,
        memory.drift,
        delay_compensation.base_command(settings, memory),
    )
    return tick, state.rates


@part
def _commanded(
    settings: Settings, memory: Memory, tick: Tick, rates: Joints, raw: Joints
) -> tuple[Joints, Joints]:
    """Return the corrected torques (joints) that the law requests, and the commanded ones."""
    before = memory.commanded
    raw = delay_compensation.reduced_torque(settings, memory, tick.posture, raw)
    raw = moving_base.commanded_torque(settings, memory, tick.command, raw)
    torque = joint_limits.kept_torque(
        settings,
        memory,
        tick.posture,
        tail(tick.position, before),
        rates,
        before,
        within_limits(settings, raw, before),
    )
    memory.commanded = torque
    return raw, torque


@part
def _report(
    settings: Settings, memory: Memory, signals: Signals, tick: Tick, raw: Joints, torque: Joints
) -> None:
    """Update the drift, and write the results of the tick into the signals."""
    # The estimate of the compensation includes the drift.
    if not delay_compensation.is_on(settings):
        mechanism.follow_drift(
            tick.model,
            tick.posture,
            settings,
            memory,
            tick.velocity,
            tick.reference_velocity,
            tick.surface,
            elementwise(minus, raw, torque),
        )
        moving_base.restrict_drift(settings, memory, tick.posture)
    signals.raw_torque = raw
    signals.torque = torque
    signals.rates = memory.velocity_command
    x, v, _ = thirds(signals.reference)
    error = delay_compensation.error(settings, memory, x, v, tick.error)
    signals.error = error
    signals.surface = tick.surface
    signals.singular = tick.is_singular


@formula
def _chosen(is_first: bool, first: float, second: float) -> float:
    return first if is_first else second
