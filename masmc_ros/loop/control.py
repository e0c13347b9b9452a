# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""One tick of the control law in all lanes, from state and reference to the command."""

from __future__ import annotations

from typing import Any

from masmc_ros.law import law
from masmc_ros.law.parts import velocity_estimator
from masmc_ros.law.parts.command_limits import within_limits
from masmc_ros.law.parts.model import ESTIMATE
from masmc_ros.law.parts.velocity_estimator import estimate_rates, ESTIMATED, note_disturbance
from masmc_ros.law.tick import tick_of
from masmc_ros.numerics.compiled import formula, inlined
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.record import get, lane_count, put
from masmc_ros.numerics.scalars import minus
from masmc_ros.numerics.tuples import elementwise, tail, thirds
from masmc_ros.robot import drift, mechanism

SETTINGS = (
    Field('geometry', 'lengths', 'Lengths of the robot', 'm'),
    Field('nominal', 'parameters', 'theta of the nominal model'),
    Field('period', description='Control period T', unit='s'),
    Field('takes_rates', description='1 if joint velocities are commanded', kind='i8'),
    Field('group', 'joints', 'Number of the group of each joint: 0, 1, ...', kind='i8'),
)
"""Settings of every law in addition to its declared parameters."""

MEMORY = (
    ESTIMATE,
    *velocity_estimator.MEMORY,
    *drift.MEMORY,
    Field('velocity_command', 'joints', 'Rates commanded at the last tick', 'm/s, rad/s'),
    Field('disturbance', 'axes', "The law's disturbance estimate d", 'N'),
)
"""Memory of every law in addition to its declared fields."""


@inlined
def control(settings: Any, memory: Any, signals: Any) -> None:
    """Compute one tick of the law from the state and the reference in `signals`."""
    lanes, estimated = lane_count(settings), 0
    for lane in range(lanes):
        estimated += get(settings, 'velocity_source', lane) == ESTIMATED
    # A vectorised loop computes all lanes or none.
    estimators = lanes if estimated > 0 else 0
    for lane in range(estimators):
        if get(settings, 'velocity_source', lane) == ESTIMATED:
            knows = get(settings, 'takes_rates', lane) == 0
            estimate_rates(settings, memory, get(signals, 'position', lane), lane, knows)
    for lane in range(lanes):
        _control(settings, memory, signals, lane)
    for lane in range(estimators):
        if get(settings, 'velocity_source', lane) == ESTIMATED:
            model = mechanism.model_of(settings, lane)
            posture = mechanism.posture(model, get(signals, 'position', lane))
            note_disturbance(memory, model, posture, get(memory, 'disturbance', lane), lane)
    for lane in range(lanes):
        law.post_update(settings, memory, lane)


@inlined
def _control(settings: Any, memory: Any, signals: Any, lane: int) -> None:
    position = get(signals, 'position', lane)
    before = get(memory, 'commanded', lane)
    model = mechanism.model_of(settings, lane)
    posture = mechanism.posture(model, position)
    measured = tail(get(signals, 'velocity', lane), before)
    is_estimated = get(settings, 'velocity_source', lane) == ESTIMATED
    rates = elementwise(_chosen, is_estimated, get(memory, 'rates', lane), measured)
    tick = tick_of(
        settings,
        lane,
        posture,
        mechanism.motion(model, rates),
        position,
        get(signals, 'velocity', lane),
        thirds(get(signals, 'reference', lane)),
        get(memory, 'drift', lane),
    )
    put(signals, 'estimate', lane, get(memory, 'estimate', lane))
    raw = law.torque(settings, tick, memory, lane)
    torque = within_limits(settings, raw, before, lane)
    put(memory, 'commanded', lane, torque)
    law.learn(settings, tick, memory, lane, raw, torque)
    mechanism.follow_drift(
        model,
        posture,
        settings,
        memory,
        lane,
        tick.velocity,
        tick.reference_velocity,
        tick.surface,
        elementwise(minus, raw, torque),
    )
    put(signals, 'raw_torque', lane, raw)
    put(signals, 'torque', lane, torque)
    put(signals, 'rates', lane, get(memory, 'velocity_command', lane))
    put(signals, 'error', lane, tick.error)
    put(signals, 'surface', lane, tick.surface)
    put(signals, 'singular', lane, tick.is_singular)


@formula
def _chosen(is_first: bool, first: float, second: float) -> float:
    return first if is_first else second
