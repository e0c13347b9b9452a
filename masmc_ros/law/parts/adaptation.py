# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Bounded adaptation: dead zone, leakage, e-modification and projection.

With g = Y' sigma, sigma = J^-1 s, the gradient of (23), theta_0 the nominal estimate and f in
[0, 1] its reduction by the dead zone and a saturated torque, one tick is

    theta <- theta_0 + (theta - theta_0 - T f g / gamma) / (1 + T (leakage + nu f |s|)),

explicit in the gradient (a mechanism may have a better step, `theta_step`) and implicit in the
leakage, which is stable at any rate. The projection follows. docs/theory/adaptation.md has the
sources and the purpose of each part.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Array, Joints, Numbers, Parameters
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import formula, kernel, large_part, part
from masmc_ros.jit.lanes import shared
from masmc_ros.jit.scratch import scratch
from masmc_ros.jit.tuples import dot, elementwise
from masmc_ros.jit.vectors import free, mark
from masmc_ros.law.declared import PerEntry
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.parts.delay_compensation import gradient, is_on
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import minus, plus, times
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import Lengths

GAMMA = PerEntry(
    'gamma',
    'parameters',
    1.0,
    'Adaptation matrix Gamma',
    'J·s/θ²',
    note='; larger adapts more slowly',
    is_positive=True,
)

LEAKAGE = Parameter(
    'leakage',
    0.02,
    'Rate at which theta_hat returns to the nominal model (sigma-modification); 0: no leakage',
    unit='1/s',
    minimum=0.0,
    read_only=False,
)

E_MODIFICATION = Parameter(
    'e_modification',
    0.0,
    'Leakage in proportion to |s| outside the dead zone; 0: no leakage',
    unit='1/m',
    minimum=0.0,
    read_only=False,
)

DEAD_ZONE = Parameter(
    'dead_zone',
    0.0,
    'Norm |s| below which the adaptation stops; 0: no dead zone',
    unit='m/s',
    minimum=0.0,
    read_only=False,
)

PROJECTION_LOWER = Parameter(
    'projection.lower',
    0.2,
    'Lower bound of theta_hat as a multiple of the nominal model; 0: no projection',
    minimum=0.0,
    maximum=1.0,
    exclusive_maximum=True,
    read_only=False,
)

PROJECTION_UPPER = Parameter(
    'projection.upper',
    5.0,
    'Upper bound of theta_hat as a multiple of the nominal model, with projection',
    minimum=1.0,
    exclusive_minimum=True,
    read_only=False,
)

FREEZE_WHEN_SATURATED = Parameter(
    'freeze_when_saturated',
    True,
    'Stop the adaptation while torque_limit or torque_rate_limit limits the torque',
    read_only=False,
)

PARAMETERS = (
    LEAKAGE, E_MODIFICATION, DEAD_ZONE, PROJECTION_LOWER, PROJECTION_UPPER, FREEZE_WHEN_SATURATED,
)  # fmt: skip
"""Settings that keep the adaptation of any law bounded."""


_CUTS = 200
_HALVINGS = 60

MARGIN = 0.5
"""Projection keeps H(theta_hat) above this part of `projection.lower` times the nominal H."""


@formula
def beyond_dead_zone(distance: float, width: float) -> float:
    """
    Return the fraction of |s| that lies outside the dead zone: max(0, 1 - width / distance).

    The gradient times this fraction is that of the part of s outside the zone. The fraction is
    continuous, zero inside the zone, and 1 without a zone.

    Parameters
    ----------
    distance
        Norm |s| in m/s.
    width
        Parameter `dead_zone` in m/s; 0: no dead zone.

    """
    fraction = 1.0 - width / distance
    return 1.0 if width == 0.0 else (fraction if distance > width else 0.0)


@formula
def pulled_estimate(moved: float, nominal: float, period: float, rate: float) -> float:
    """
    Return an entry of theta after leakage: theta_0 + (theta - theta_0) / (1 + T rate).

    Parameters
    ----------
    moved
        Entry after its step along the gradient, in SI units of the parameter.
    nominal
        Entry theta_0 of the nominal model.
    period
        Control period T in s.
    rate
        Rate of the leakage in 1/s; 0: no leakage.

    """
    pulled = nominal + (moved - nominal) / (1.0 + period * rate)
    return pulled if rate > 0.0 else moved


@formula
def bounds(nominal: float, lower: float, upper: float) -> tuple[float, float]:
    """Return lower and upper bound of an entry: multiples of the nominal one, of either sign."""
    one, other = lower * nominal, upper * nominal
    return (one, other) if nominal > 0.0 else (other, one)


@formula
def clip_to_box(n: int, nominal: Numbers, lower: float, upper: float, estimate: Array) -> None:
    """
    Clip the entries of theta to multiples of the nominal ones, in place.

    Parameters
    ----------
    n
        Number of entries.
    nominal
        Nominal theta (n).
    lower, upper
        Bounds as multiples of the nominal entry.
    estimate
        Array (n) that is clipped.

    """
    for j in range(n):
        low, high = bounds(nominal[j], lower, upper)
        value = estimate[j]
        estimate[j] = low if value < low else (high if value > high else value)


@formula
def move_into_half_space(
    n: int,
    normal: Array,
    bound: float,
    gamma: Numbers,
    nominal: Numbers,
    lower: float,
    upper: float,
    estimate: Array,
) -> None:
    """
    Move theta within its box to the nearest point with normal' theta >= bound, in place.

    The metric is sqrt(d' Gamma d), in which the Lyapunov function of (19) measures the estimation
    error. The distance to any point of both sets therefore does not increase. Entries that reach a
    bound of the box stay there. The others continue, at most n times.

    Parameters
    ----------
    n
        Number of entries of theta.
    normal
        Normal (n) of the half-space.
    bound
        Smallest value of normal' theta.
    gamma
        Diagonal (n) of Gamma.
    nominal
        Nominal theta (n).
    lower, upper
        Box, as multiples of the nominal entries.
    estimate
        Array (n) in its box, which is moved.

    """
    for _ in range(n):
        short = bound
        slope = 0.0
        for j in range(n):
            short -= normal[j] * estimate[j]
            low, high = bounds(nominal[j], lower, upper)
            if (normal[j] > 0.0 and estimate[j] < high) or (normal[j] < 0.0 and estimate[j] > low):
                slope += normal[j] * normal[j] / gamma[j]
        if not (short > 0.0 and slope > 0.0):
            return
        for j in range(n):
            estimate[j] += short * normal[j] / (gamma[j] * slope)
        clip_to_box(n, nominal, lower, upper, estimate)


@formula
def adapt(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """
    Advance theta_hat by one tick along the gradient of the law or of its compensation.

    The projection is separate (`project`).

    Parameters
    ----------
    settings
        Settings of the law.
    tick
        State and reference.
    memory
        Memory of the law; `estimate` (parameters) is updated.
    raw
        Joint torques that the law requests in N·m.
    torque
        Joint torques that are commanded in N·m.

    """
    along = gradient(settings, memory, tick)
    adapt_along(settings, tick, memory, raw, torque, along)


@formula
def _between(start: float, end: float, part: float) -> float:
    return start + part * (end - start)


@formula
def dissipative_step(
    settings: Settings, tick: Tick, memory: Memory, gradient: Parameters, moved: Parameters
) -> Parameters:
    """
    Return theta after a step that is shortened if it adapts faster than the law reaches.

    The step changes the torque along sigma = v - v_r by the power p, the decrease of g' theta, one
    period later than the reaching force, which dissipates P = -s' (u + d). With the implicit law
    and beta its gain of d, the loop does not oscillate for p <= (1 - beta)^2 P / 4, to which p is
    limited (docs/theory/adaptation.md). In the null space of the task there is no reaching force:
    for a robot with more velocities than axes, P is the energy of sigma over a period, which it is
    on the surface of the implicit law. A point between consistent estimates is consistent.

    Parameters
    ----------
    settings
        Settings of the law.
    tick
        State and reference.
    memory
        Memory of the law, with theta, the reaching force u and the disturbance estimate d.
    gradient
        Gradient g (parameters).
    moved
        theta after the whole step.

    """
    remainder = 1.0 - settings.observer_gain
    if len(tick.velocity) > len(tick.surface):
        sigma = elementwise(minus, tick.velocity, tick.reference_velocity)
        h = mechanism.inertia(tick.model, tick.posture, tick.nominal)
        dissipated = dot(sigma, mechanism.inertia_times(tick.model, h, sigma)) / tick.period
    else:
        force = elementwise(plus, memory.reaching, memory.disturbance)
        dissipated = -dot(tick.surface, force)
    most = max(0.0, 0.25 * remainder * remainder * dissipated)
    power = dot(gradient, elementwise(minus, memory.estimate, moved))
    if power > most:
        return elementwise(_between, memory.estimate, moved, most / power)
    return moved


@formula
def adapt_along(
    settings: Settings,
    tick: Tick,
    memory: Memory,
    raw: Joints,
    torque: Joints,
    gradient: Parameters,
) -> None:
    """
    Advance theta_hat by one tick along a gradient: step, dead zone, leakage and e-modification.

    The projection is separate (`project`).

    Parameters
    ----------
    settings
        Settings of the law.
    tick
        State and reference.
    memory
        Memory of the law; `estimate` (parameters) is updated.
    raw
        Joint torques that the law requests in N·m.
    torque
        Joint torques that are commanded in N·m. If they differ from `raw` and
        `freeze_when_saturated` is set, only the leakage acts.
    gradient
        Gradient g (parameters), such as Y' sigma of (23).

    """
    _adapt_along(shared(settings), tick, shared(memory), raw, torque, gradient)


@part
def _adapt_along(
    settings: Settings,
    tick: Tick,
    memory: Memory,
    raw: Joints,
    torque: Joints,
    gradient: Parameters,
) -> None:
    distance = math.sqrt(dot(tick.surface, tick.surface))
    share = beyond_dead_zone(distance, settings.dead_zone)
    freezes = (settings.freeze_when_saturated != 0) & (torque != raw)
    share = 0.0 if freezes else share
    rate = settings.leakage
    e_modification = settings.e_modification
    rate = rate + e_modification * share * distance if e_modification > 0.0 else rate
    moved = mechanism.theta_step(
        tick.model,
        settings,
        memory.estimate,
        elementwise(times, gradient, share),
        tick.period,
    )
    if mechanism.preserves_consistency(tick.model, settings) and not is_on(settings):
        moved = dissipative_step(settings, tick, memory, gradient, moved)
    following = elementwise(pulled_estimate, moved, tick.nominal, tick.period, rate)
    memory.estimate = following


@formula
def project(settings: Settings, memory: Memory) -> None:
    """Project `memory.estimate` onto physically possible values if `projection.lower` > 0."""
    # Most runs need no projection, and save the call.
    if settings.projection_lower > 0.0:
        _project(shared(settings), shared(memory))


@large_part
def _project(settings: Settings, memory: Memory) -> None:
    model = mechanism.model_of(settings)
    if not mechanism.preserves_consistency(model, settings):
        theta = projected(
            model,
            memory.estimate,
            settings.nominal,
            settings.gamma,
            settings.projection_lower,
            settings.projection_upper,
        )
        memory.estimate = theta


@formula
def _less(theta: float, nominal: float, part: float) -> float:
    """Return an entry of theta minus a part of the nominal one."""
    return theta - part * nominal


@kernel
def projected(
    model: Lengths, theta: Numbers, nominal: Numbers, gamma: Numbers, lower: float, upper: float
) -> Numbers:
    """
    Return theta projected into the box and onto physically possible values.

    Every step is the projection onto a half-space that contains all robots whose bodies are above
    `lower`. The distance to any of them therefore does not increase. In the rare case that many
    steps do not suffice, the distance to the nominal model, which is inside, is halved until they
    do.

    Parameters
    ----------
    model
        Lengths of the mechanism.
    theta
        Parameters (parameters) before the projection.
    nominal
        Nominal theta.
    gamma
        Diagonal of Gamma, which is the metric.
    lower, upper
        Bounds as multiples of the nominal entries.

    """
    n = len(nominal)
    estimate, normal = scratch(n), scratch(n)
    for j in range(n):
        estimate[j] = theta[j]
    clip_to_box(n, nominal, lower, upper, estimate)
    part, place = MARGIN * lower, mark(theta)
    for _ in range(_CUTS):
        free(theta, place)
        above = elementwise(_less, to_vector(estimate, nominal), nominal, part)
        pivot, x = mechanism.weakest_motion(model, above)
        if pivot > 0.0:
            return to_vector(estimate, nominal)
        entries = mechanism.consistency_normal(model, x, nominal)
        bound = 0.0
        for j in range(n):
            normal[j] = entries[j]
            bound += lower * normal[j] * nominal[j]
        move_into_half_space(n, normal, bound, gamma, nominal, lower, upper, estimate)
    for _ in range(_HALVINGS):
        free(theta, place)
        above = elementwise(_less, to_vector(estimate, nominal), nominal, part)
        pivot, x = mechanism.weakest_motion(model, above)
        if pivot > 0.0:
            break
        for j in range(n):
            estimate[j] = nominal[j] + 0.5 * (estimate[j] - nominal[j])
    return to_vector(estimate, nominal)
