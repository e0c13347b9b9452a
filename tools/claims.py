# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

r"""
Claims of the documentation that a computer can examine: sentence, range, bound and check.

`tools/tables.py` writes the sentences into docs/reference/laws/ and docs/theory/, and all claims
into the page docs/reference/laws/claims.md. `test/law/test_claims.py` draws values from the range
of each claim: with the limited quantity at most 0.98 of its bound the property must hold, and a
counterexample must exist at 1.02 and already at 1.0001.

A sampled loop is one axis at rest with the state (position x, velocity v) at the ticks and an
acceleration that is held: x+ = x + T v + T² a / 2, v+ = v + T a. Its matrix is written from the
equations of the law, the bound is derived independently. Arrays have the draws as first axis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Values = Mapping[str, Array]
Property = Callable[[Values, Array], Flags]
"""Function of drawn values (n) and the limited quantity relative to its bound (n): holds (n)."""

EIGENVALUES, MATRICES, SIMULATION = 'eigenvalues', 'random matrices', 'simulation'
"""Methods: of a loop with frozen coefficients, an identity, and the sampled non-linear loop."""

INSIDE, OUTSIDE = 0.98, 1.02
"""Relative quantities up to which the property must hold, and where a counterexample exists."""

SHARP = 1.0001
"""Relative quantity at which the search finds the first counterexample of each claim."""


@dataclass(frozen=True)
class Claim:
    """
    Statement of a page that a computer examines.

    Attributes
    ----------
    page
        Page with the sentence: name of a law, or of a page of docs/theory/.
    sentence
        Statement in Markdown.
    method
        One of the methods above.
    ranges
        Lower and upper limit of the drawn values by name, uniform in their logarithms, SI units.
    holds
        True if the property holds.
    draws
        Number of draws of the search for a counterexample.

    """

    page: str
    sentence: str
    method: str
    ranges: Mapping[str, tuple[float, float]]
    holds: Property
    draws: int = 4000

    def draw(self, count: int, seed: int) -> dict[str, Array]:
        """Return drawn values (count) by name, and `seed` (count) of further random numbers."""
        rng = np.random.default_rng(seed)
        values = {
            name: np.exp(rng.uniform(np.log(low), np.log(high), count))
            for name, (low, high) in self.ranges.items()
        }
        return {**values, 'seed': np.full(count, float(seed))}

    @property
    def range_text(self) -> str:
        """Return the range of validity."""
        return ', '.join(
            f'{name} {low:g}' if low == high else f'{name} {low:g} to {high:g}'
            for name, (low, high) in self.ranges.items()
        )


def radius(matrices: Array) -> Array:
    """Return the spectral radii (n) of matrices (n, m, m)."""
    radii: Array = np.abs(np.linalg.eigvals(matrices)).max(axis=1)
    return radii


def _stacked(*rows: tuple[Array | float, ...]) -> Array:
    """Return matrices (n, m, m) of rows whose entries are numbers or (n)."""
    entries = np.broadcast_arrays(*(np.atleast_1d(entry) for row in rows for entry in row))
    return np.stack(entries, axis=1).reshape(-1, len(rows), len(rows))


def held(period: Array, command: tuple[Array | float, ...]) -> Array:
    """
    Return the rows (n, 2, m) of x and v of a loop.

    Parameters
    ----------
    period
        Control period (n) in s.
    command
        Entries (n) of the acceleration as a function of the state (x, v, ...).

    """
    a = np.stack(np.broadcast_arrays(period, *command)[1:], axis=1)
    rows = np.zeros((len(a), 2, a.shape[1]))
    rows[:, 0, 0], rows[:, 0, 1], rows[:, 1, 1] = 1.0, period, 1.0
    rows[:, 0] += 0.5 * (period * period)[:, None] * a
    rows[:, 1] += period[:, None] * a
    return rows


def task_feedback(k_p: Array, k_d: Array, period: Array) -> Array:
    """Return the matrices of `nonlinear_feedback`: a = -K_d v - K_p x."""
    return held(period, (-k_p, -k_d))


def rate_feedback(k_p: Array, k_d: Array, period: Array) -> Array:
    """Return the matrices of `computed_torque` in (w, z): a = -K_d z - K_p w, w+ = w + T z."""
    return _stacked((1.0, period), (-period * k_p, 1.0 - period * k_d))


def time_delay(k_p: Array, k_d: Array, period: Array, share: Array) -> Array:
    """Return the matrices of `time_delay` in (x, v, a of the last period)."""
    command = -share * k_p, -share * k_d, 1.0 - share
    last = np.stack(np.broadcast_arrays(*command), axis=1)[:, None]
    return np.concatenate([held(period, command), last], axis=1)


def momentum_observer(k_p: Array, k_d: Array, period: Array, share: Array, rate: Array) -> Array:
    """Return the matrices of `momentum_observer` in (x, v, a of the last period, d)."""
    k_p, k_d, period, share, rate = np.broadcast_arrays(k_p, k_d, period, share, rate)
    gain = period * rate / (1.0 + period * rate)
    zero = np.zeros_like(gain)
    # The torque of the last period is its acceleration, as the true inertia is one.
    estimate = zero, zero, gain * (share - 1.0), 1.0 - gain
    command = -share * k_p, -share * k_d, -estimate[2], -estimate[3]
    memory = np.stack([np.stack(command, axis=1), np.stack(estimate, axis=1)], axis=1)
    return np.concatenate([held(period, command), memory], axis=1)


def time_delay_range(k_p: Array, k_d: Array, period: Array) -> tuple[Array, Array]:
    """Return the smallest and the largest stable share of the true inertia."""
    lower = k_p * period / (k_d + 0.5 * k_p * period)
    return lower, 4.0 / (2.0 + k_d * period)


def momentum_observer_limit(k_d: Array, period: Array, rate: Array) -> Array:
    """Return the largest stable share of the true inertia."""
    gain = period * rate / (1.0 + period * rate)
    limit: Array = 4.0 / (2.0 * gain + (2.0 - gain) * k_d * period)
    return limit


def _inertias(values: Values, size: int = 4) -> Array:
    """Return symmetric positive definite matrices (n, size, size), the same for each seed."""
    rng = np.random.default_rng(int(values['seed'][0]))
    factor = rng.standard_normal((len(values['seed']), size, size))
    return factor @ factor.transpose(0, 2, 1) + 0.1 * np.eye(size)


def _task_gains(values: Values, factor: Array) -> Flags:
    """K_d T < 2, with K_p T below 2 K_d."""
    t, k_d = values['T'], factor * 2.0 / values['T']
    k_p = values['K_p T / 2 K_d'] * 2.0 * k_d / t
    return radius(task_feedback(k_p, k_d, t)) < 1.0


def _task_stiffness(values: Values, factor: Array) -> Flags:
    t, k_d = values['T'], values['K_d T'] / values['T']
    return radius(task_feedback(factor * 2.0 * k_d / t, k_d, t)) < 1.0


def _task_integral(values: Values, factor: Array) -> Flags:
    k_p, k_d = values['K_p'], values['K_d']
    companion = _stacked((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (-factor * k_p * k_d, -k_p, -k_d))
    return np.linalg.eigvals(companion).real.max(axis=1) < 0.0


def _rate_stiffness(values: Values, factor: Array) -> Flags:
    t, k_d = values['T'], values['K_d T'] / values['T']
    return radius(rate_feedback(factor * k_d / t, k_d, t)) < 1.0


def _rate_damping(values: Values, factor: Array) -> Flags:
    t = values['T']
    k_p = values['K_p T²'] / t**2
    k_d = factor * (2.0 + 0.5 * k_p * t * t) / t
    return radius(rate_feedback(k_p, k_d, t)) < 1.0


def _delay_share(values: Values, factor: Array, *, is_upper: bool) -> Flags:
    t, k_d = values['T'], values['K_d']
    k_p = values['K_p T / K_d'] * k_d / t
    lower, upper = time_delay_range(k_p, k_d, t)
    share = factor * upper if is_upper else lower / factor
    # Inside one bound only: far from it the other one may be passed.
    is_between = (share > lower * OUTSIDE) | ~np.bool_(is_upper)
    is_between &= (share < upper * INSIDE) | np.bool_(is_upper)
    return (radius(time_delay(k_p, k_d, t, share)) < 1.0) | ~is_between


def _observer_share(values: Values, factor: Array) -> Flags:
    t, k_d, rate = values['T'], values['K_d'], values['K_o']
    share = factor * momentum_observer_limit(k_d, t, rate)
    k_p = values['K_p / K_d²'] * k_d**2
    # Near the limit only: there is a lower bound as well.
    is_near = factor > 0.9
    return (radius(momentum_observer(k_p, k_d, t, share, rate)) < 1.0) | ~is_near


def _layer(values: Values, factor: Array) -> Flags:
    """T G < 2 lambda_min(H): s+ = (I - T H^-1 G) s for a slope G of the reaching law."""
    h = _inertias(values)
    slope = factor * 2.0 * np.linalg.eigvalsh(h)[:, 0] / values['T']
    step = (values['T'] * slope)[:, None, None] * np.linalg.inv(h)
    return radius(np.eye(4) - step) < 1.0


def _wrong_inertia(values: Values, factor: Array) -> Flags:
    """T G lambda_max(H^-1 D) < 2: accelerations -G s by the inertia D of the model."""
    h = _inertias(values)
    d = _inertias({'seed': values['seed'] + 1.0})
    ratio = np.linalg.solve(h, d)
    slope = factor * 2.0 / np.linalg.eigvals(ratio).real.max(axis=1)
    return radius(np.eye(4) - slope[:, None, None] * ratio) < 1.0


def _implicit_model(values: Values, factor: Array) -> Flags:
    """On the surface, in (s, T d_hat): s+ = (1 - a - b a) s - d, d+ = d + b a s."""
    beta = values['β']
    a = factor * 4.0 / (2.0 + beta)
    return radius(_stacked((1.0 - a - beta * a, -1.0), (beta * a, 1.0))) < 1.0


def _adaptation(values: Values, factor: Array) -> Flags:
    """In (s, θ̂ - θ) with the regressor y: y² T / Γ is the factor of the gain K."""
    t, k = values['T'], values['K T'] / values['T']
    y = np.sqrt(factor * k / t)
    return radius(_stacked((1.0 - t * k, t * y), (-t * y, 1.0))) < 1.0


def _super_twisting_model(values: Values, factor: Array) -> Flags:
    """On the surface, in (s, T w): ν = w - 2 s / T, w+ = w - s / T."""
    g = factor * 4.0 / 3.0
    return radius(_stacked((1.0 - 2.0 * g, g), (-1.0, 1.0))) < 1.0


def _first_axes(values: Values, factor: Array) -> Flags:
    """J_1 H^-1 (J_1' Λ_1 b_1 + N_1' J_2' F_2) = b_1; the factor scales one mass of the model."""
    true, model = _inertias(values), _inertias(values)
    model[:, 0, 0] *= np.where(factor > 1.0, factor, 1.0)
    rng = np.random.default_rng(int(values['seed'][0]) + 1)
    j, force, b = (
        rng.standard_normal((len(factor), *shape)) for shape in ((4, 4), (2, 1), (2, 1))
    )
    j1, j2 = j[:, :2], j[:, 2:]
    j1t, j2t = j1.transpose(0, 2, 1), j2.transpose(0, 2, 1)
    weight = np.linalg.inv(j1 @ np.linalg.solve(model, j1t))
    projector = np.eye(4) - np.linalg.solve(model, j1t) @ weight @ j1
    torque = j1t @ weight @ b + projector.transpose(0, 2, 1) @ j2t @ force
    # The condition of random matrices differs by many orders of magnitude.
    scale = np.abs(j1t @ weight @ b).sum(axis=(1, 2)) + np.abs(torque).sum(axis=(1, 2))
    scale *= np.abs(j1 @ np.linalg.inv(true)).sum(axis=(1, 2))
    error = np.abs(j1 @ np.linalg.solve(true, torque) - b).max(axis=(1, 2))
    close: Flags = error <= 1e-9 * np.maximum(scale, 1.0)
    return close


def _network_weight(values: Values, factor: Array) -> Flags:
    """|W| <= 1/ν for random and for constant s; the quantity is |W| ν when the bound is `1/f`."""
    rng = np.random.default_rng(int(values['seed'][0]))
    weight = np.zeros(len(factor))
    largest = np.zeros(len(factor))
    step = values['T ‖s‖ / Γ']
    for tick in range(400):
        part = rng.uniform(-1.0, 1.0, len(factor)) if tick < 200 else 1.0
        weight = (weight + step * part) / (1.0 + values['ν'] * step)
        largest = np.maximum(largest, np.abs(weight))
    within: Flags = largest * values['ν'] * factor <= 1.0
    return within


def _barrier(values: Values, factor: Array) -> Flags:
    """|s| < ε for a disturbance of the constant, largest magnitude."""
    t, rho, eps = values['T'], values['ρ'], values['ε']
    half = 0.5 * t * rho
    disturbance = factor * (np.sqrt(t * rho * eps + half**2) - half)
    s, is_within = np.zeros_like(t), np.ones(len(t), bool)
    for _ in range(2000):
        middle = 0.5 * (s + eps + t * rho)
        s = middle - np.sqrt(middle**2 - eps * s) + disturbance
        is_within &= s < eps
        s = np.minimum(s, eps)
    return is_within


def _terminal_balance(values: Values, factor: Array) -> Flags:
    """At rest k_1 ς + k_2 √ς = δ; the quantity is the disturbance for which ς is too large."""
    k_1, k_2, delta = values['k_1'], values['k_2'], values['δ']
    root = (-k_2 + np.sqrt(k_2**2 + 4.0 * k_1 * delta)) / (2.0 * k_1)
    c_1, c_2, period = values['c_1'], 0.2, 2e-3
    e, v = np.zeros_like(k_1), np.zeros_like(k_1)
    for _ in range(6000):
        s = e + c_1 * np.abs(e) * e + c_2 * np.abs(v)**1.5 * np.sign(v)
        a = -2.0 / (3.0 * c_2) * np.sqrt(np.abs(v)) * np.sign(v) * (1.0 + 2.0 * c_1 * np.abs(e))
        a += delta - k_1 * s - k_2 * np.sqrt(np.abs(s)) * np.sign(s)
        e, v = e + period * v + 0.5 * period**2 * a, v + period * a
    final = np.abs(e) + c_1 * e**2
    within: Flags = final * factor <= root**2
    return within


def _twisting_rate(values: Values, factor: Array) -> Flags:
    """|s| <= L T² from the surface on, for |δ'| <= L = factor * k_2."""
    t, k_2 = values['T'], values['k_2']
    k_1 = values['k_1²/k_2']**0.5 * k_2**0.5
    rng = np.random.default_rng(int(values['seed'][0]))
    bound = factor * k_2
    s, w, delta = (np.zeros_like(t) for _ in range(3))
    is_within = np.ones(len(t), bool)
    for tick in range(400):
        # |s| <= T² k_2 is on the surface; otherwise √z is the root of z + T k_1 √z + T² k_2 = |s|.
        excess = np.maximum(np.abs(s) - t**2 * k_2, 0.0)
        root = 0.5 * (-t * k_1 + np.sqrt((t * k_1)**2 + 4.0 * excess)) * np.sign(s)
        zeta = np.where(excess > 0.0, np.sign(s), s / (t**2 * k_2))
        nu = w - k_1 * root - 2.0 * t * k_2 * zeta
        w = w - t * k_2 * zeta
        change = rng.choice([-1.0, 1.0], len(t)) if tick < 200 else 1.0
        s = s + t * (nu + delta)
        delta = delta + t * bound * change
        is_within &= np.abs(s) <= bound * t**2 * (1.0 + 1e-6)
    return is_within


def _prediction_step(values: Values, factor: Array) -> Flags:
    """Reduction of the error by a step of 2 · factor · slope / curvature along the gradient."""
    metric = _inertias(values, 3)
    rng = np.random.default_rng(int(values['seed'][0]) + 2)
    w, theta = (rng.standard_normal((len(factor), *shape)) for shape in ((3, 7), (7, 1)))
    error = w @ theta
    direction = w.transpose(0, 2, 1) @ np.linalg.solve(metric, error)
    direction /= np.exp(rng.uniform(-3.0, 3.0, (7, 1)))
    change = w @ direction
    slope = (error * np.linalg.solve(metric, change)).sum(axis=(1, 2))
    curvature = (change * np.linalg.solve(metric, change)).sum(axis=(1, 2))
    after = error - (factor * 2.0 * slope / curvature)[:, None, None] * change
    less: Flags = (after * np.linalg.solve(metric, after)).sum(axis=(1, 2)) < (
        error * np.linalg.solve(metric, error)
    ).sum(axis=(1, 2))
    return less


def _recorded_rate(values: Values, factor: Array) -> Flags:
    """Every part of θ̂ - θ decays at least by 1 + T κ λ: the quantity is λ / λ_min(Γ^-1 A)."""
    a, gamma = _inertias(values), _inertias({'seed': values['seed'] + 1.0})
    gain = values['T κ'][:, None, None]
    smallest = np.linalg.eigvals(np.linalg.solve(gamma, a)).real.min(axis=1)
    decay = np.asarray(np.linalg.solve(gamma + gain * a, gamma), np.float64)
    step = radius(decay)
    fast: Flags = step <= (1.0 + 1e-9) / (1.0 + values['T κ'] * factor * smallest)
    return fast


def _late_state(values: Values, factor: Array) -> Flags:
    m = np.floor(values['m']).astype(int)
    size = int(m.max()) + 1
    gain = factor * 2.0 * np.sin(np.pi / (4.0 * m + 2.0))
    matrices = np.zeros((len(m), size, size))
    matrices[:, 0, 0] = 1.0
    matrices[:, np.arange(1, size), np.arange(size - 1)] = 1.0
    matrices[np.arange(len(m)), 0, m] -= gain
    return radius(matrices) < 1.0


def estimator(g: Array, h: Array, kappa: Array) -> Array:
    """Return the matrices of the velocity estimator in (angle, T velocity, T² acceleration)."""
    motion = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    gains = np.stack(np.broadcast_arrays(g, h, kappa), axis=1)
    matrices: Array = motion - gains[:, :, None] * motion[0]
    return matrices


def _estimator_gain(values: Values, factor: Array) -> Flags:
    """κ < 2 g h / (2 - g), which the κ of the estimator is."""
    z = 1.0 / (1.0 + values['ω T'])
    g, h = 1.0 - z * z, (1.0 - z) ** 2
    own = radius(estimator(g, h, 0.1 * h * h / g)) < 1.0
    return own & (radius(estimator(g, h, factor * 2.0 * g * h / (2.0 - g))) < 1.0)


def _axes_adaptation(values: Values, factor: Array) -> Flags:
    """In (s, θ̂ - θ) of three axes and seven parameters with the regressor B and the gain K."""
    t, k = values['T'], values['K T'] / values['T']
    rng = np.random.default_rng(int(values['seed'][0]))
    gamma = np.exp(rng.uniform(-2.0, 2.0, (len(t), 7)))
    b = rng.standard_normal((len(t), 3, 7))
    largest = np.linalg.eigvalsh(b / gamma[:, None] @ b.transpose(0, 2, 1))[:, -1]
    b *= np.sqrt(factor * k / (t * largest))[:, None, None]
    loop = np.zeros((len(t), 10, 10))
    loop[:, range(3), range(3)] = (1.0 - t * k)[:, None]
    loop[:, range(3, 10), range(3, 10)] = 1.0
    loop[:, :3, 3:] = t[:, None, None] * b
    loop[:, 3:, :3] = -t[:, None, None] * (b / gamma[:, None]).transpose(0, 2, 1)
    # Directions without a regressor stay: their eigenvalue is one.
    moduli = np.abs(np.linalg.eigvals(loop))
    stays = np.sort(moduli, axis=1)[:, -5] < 1.0 - 1e-9
    return stays & (moduli.max(axis=1) < 1.0 + 1e-9)


def _half_space(values: Values, factor: Array) -> Flags:
    """|θ̂+ - θ| <= |θ̂ - θ| after 2 · factor projections, for θ on the border."""
    rng = np.random.default_rng(int(values['seed'][0]))
    normal, border, outside = rng.standard_normal((3, len(factor), 7))
    metric = np.exp(rng.uniform(-2.0, 2.0, (len(factor), 7)))
    inward = normal / metric
    length = (normal * (border - outside)).sum(axis=1) / (normal * inward).sum(axis=1)
    after = outside + (2.0 * factor * length)[:, None] * inward
    nearer: Flags = (metric * (after - border) ** 2).sum(axis=1) <= (
        metric * (outside - border) ** 2
    ).sum(axis=1)
    return nearer


def _consistent(values: Values, factor: Array) -> Flags:
    """Q(θ) is positive definite; the quantity is m_min relative to m_max."""
    rng = np.random.default_rng(int(values['seed'][0]))
    a, g = _inertias(values, 2), _inertias({'seed': values['seed'] + 1.0}, 2)
    arm = rng.standard_normal(len(factor))
    p = rng.standard_normal((len(factor), 2, 1))
    column = np.stack([np.ones_like(arm), arm], axis=1)[:, :, None]
    smallest = (p * np.linalg.solve(a, p)).sum(axis=(1, 2))
    largest = 1.0 / (column * np.linalg.solve(g, column)).sum(axis=(1, 2))
    p *= np.sqrt(factor * largest / smallest)[:, None, None]
    corner = column @ p.transpose(0, 2, 1)
    q = np.block([[g, corner], [corner.transpose(0, 2, 1), a]])
    return np.linalg.eigvalsh(q)[:, 0] > 0.0


def _mass_damping(values: Values, factor: Array) -> Flags:
    m, t = values['m'], values['T']
    k_d = factor * 2.0 * m / t
    k_p = values['K_p T / 2 K_d'] * 2.0 * k_d / t
    return radius(task_feedback(k_p / m, k_d / m, t)) < 1.0


def _mass_integral(values: Values, factor: Array) -> Flags:
    m, k_p, k_d = values['m'], values['K_p'], values['K_d']
    k_i = factor * k_p * k_d / m
    companion = _stacked((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (-k_i / m, -k_p / m, -k_d / m))
    return np.linalg.eigvals(companion).real.max(axis=1) < 0.0


_T = {'T': (2e-4, 0.03)}
_PART = {'K_p T / 2 K_d': (0.01, 0.9)}
_MATRICES = {**_T}


def _of_slope(law: str, slope: str, inertia: str = 'H_x') -> Claim:
    """Return the claim about the slope of a reaching law at s = 0."""
    sentence = (
        f'With frozen coefficients the linear part of the law is stable for '
        f'$T({slope}) < 2\\lambda_{{\\min}}({inertia})$; with this slope equal on all axes and '
        f'above it, it is not.'
    )
    return Claim(law, sentence, EIGENVALUES, _MATRICES, _layer)


CLAIMS: tuple[Claim, ...] = (
    _of_slope('smc', r'K_{s1} + K_{s2}/\delta'),
    Claim(
        'smc',
        r'With `implicit` and an estimate ($\beta > 0$) the loop on the surface is stable for a '
        r'nominal model below $4/(2+\beta)$ times the true one, and unstable above.',
        EIGENVALUES,
        {'β': (0.01, 1.0)},
        _implicit_model,
    ),
    Claim(
        'rasmc',
        r'One axis with the regressor $y$, the gain $K$ of $s$ and $KT$ up to 1.9 is stable for '
        r'$T y^2/\Gamma < K$, and unstable above: adaptation is slower than reaching.',
        EIGENVALUES,
        {**_T, 'K T': (0.01, 1.9)},
        _adaptation,
    ),
    Claim(
        'nonlinear_feedback',
        r'With $K_i = 0$ the sampled loop is unstable for $K_d T > 2$, whatever $K_p$ is.',
        EIGENVALUES,
        {**_T, **_PART},
        _task_gains,
    ),
    Claim(
        'nonlinear_feedback',
        r'For $K_d T < 2$ it is stable for $K_p T < 2 K_d$, and unstable above.',
        EIGENVALUES,
        {**_T, 'K_d T': (0.01, 1.96)},
        _task_stiffness,
    ),
    Claim(
        'nonlinear_feedback',
        r'In continuous time the loop with an integral is stable for $K_i < K_p K_d$, and '
        r'unstable above.',
        EIGENVALUES,
        {'K_p': (1.0, 1e4), 'K_d': (1.0, 300.0)},
        _task_integral,
    ),
    Claim(
        'computed_torque',
        r'The sampled loop is stable for $K_p T < K_d$, and unstable above, if $K_d T$ is below '
        r'the bound of the next line.',
        EIGENVALUES,
        {**_T, 'K_d T': (0.01, 1.96)},
        _rate_stiffness,
    ),
    Claim(
        'computed_torque',
        r'It is stable for $K_d T < 2 + \tfrac12 K_p T^2$, and unstable above, if $K_p T < K_d$.',
        EIGENVALUES,
        {**_T, 'K_p T²': (1e-4, 0.015)},
        _rate_damping,
    ),
    Claim(
        'null_space',
        r'With the true model $J_1 \ddot q$ is $b_1$ for any force $F_2$ of the other axes. With '
        r'one entry of $H$ 2 % wrong it is not.',
        MATRICES,
        _MATRICES,
        _first_axes,
        1000,
    ),
    Claim(
        'rbf_sliding',
        r'$\lvert W_{ij}\rvert \le 1/\nu$ at every tick, for any $s$; a smaller bound is '
        r'exceeded.',
        SIMULATION,
        {'ν': (1e-3, 1.0), 'T ‖s‖ / Γ': (100.0, 1e4)},
        _network_weight,
    ),
    _of_slope('rbf_sliding', r'K + k/\delta'),
    Claim(
        'decentralised_sliding',
        r'With frozen coefficients the layer is stable if $T(Q + P/\delta)$ times the largest '
        r'eigenvalue of $H^{-1}D$ is below 2, and unstable above.',
        EIGENVALUES,
        _MATRICES,
        _wrong_inertia,
    ),
    _of_slope('adaptive_gain', r'K + k_{\max}/\delta'),
    _of_slope('fuzzy_gain', r'A + \text{slope of } K'),
    _of_slope('variable_structure', r'g/\delta'),
    _of_slope('fuzzy_model', r'K + \text{slope of } h', 'H'),
    Claim(
        'hybrid_network',
        r'With frozen coefficients the layer is stable if $T(K + k/\delta + \text{slope of } '
        r'W^T\Phi)$ times the largest eigenvalue of $H_{\mathrm{true}}^{-1} H$ is below 2, and '
        r'unstable above.',
        EIGENVALUES,
        _MATRICES,
        _wrong_inertia,
    ),
    Claim(
        'pid',
        r'With $K_i = 0$ an axis of the mass $m$ is stable for $K_d T < 2m$ and $K_p T < 2 K_d$, '
        r'and unstable for $K_d T > 2m$.',
        EIGENVALUES,
        {**_T, 'm': (0.1, 100.0), **_PART},
        _mass_damping,
    ),
    Claim(
        'pid',
        r'At a set-point and in continuous time it is stable for $K_i < K_p K_d/m$, and unstable '
        r'above.',
        EIGENVALUES,
        {'m': (0.1, 100.0), 'K_p': (1.0, 1e4), 'K_d': (1.0, 1e3)},
        _mass_integral,
    ),
    Claim(
        'pd_gravity',
        r'An axis of the mass $m$ is stable for $K_d T < 2m$ and $K_p T < 2 K_d$, and unstable '
        r'for $K_d T > 2m$.',
        EIGENVALUES,
        {**_T, 'm': (0.1, 100.0), **_PART},
        _mass_damping,
    ),
    Claim(
        'super_twisting',
        r'On the surface the loop is stable for a nominal model below 4/3 of the true one, and '
        r'unstable above.',
        EIGENVALUES,
        _MATRICES,
        _super_twisting_model,
    ),
    Claim(
        'super_twisting',
        r'From the surface on $\lvert s\rvert \le L T^2$ for $k_2 > L$, with the true model; for '
        r'a smaller $k_2$ it leaves this bound.',
        SIMULATION,
        {**_T, 'k_2': (1.0, 1e3), 'k_1²/k_2': (0.5, 8.0)},
        _twisting_rate,
        2000,
    ),
    Claim(
        'adaptive_super_twisting',
        r'While $\beta > L$, $\lvert s\rvert \le L T^2$ from the surface on, with the true model; '
        r'for a smaller $\beta$ it leaves this bound.',
        SIMULATION,
        {**_T, 'k_2': (1.0, 1e3), 'k_1²/k_2': (0.5, 8.0)},
        _twisting_rate,
        2000,
    ),
    Claim(
        'barrier',
        r'$s$ stays within the barrier for $T\delta < \sqrt{T\rho\varepsilon + (T\rho/2)^2} - '
        r'T\rho/2$; a larger constant $\delta$ drives it out.',
        SIMULATION,
        {**_T, 'ρ': (0.1, 100.0), 'ε': (0.005, 0.5)},
        _barrier,
        2000,
    ),
    Claim(
        'terminal',
        r'A constant disturbance ends at $k_1\varsigma + k_2\sqrt\varsigma = \delta$ with '
        r'$\varsigma = \lvert e\rvert + c_1 e^2$ and not beyond.',
        SIMULATION,
        {'k_1': (20.0, 100.0), 'k_2': (5.0, 30.0), 'c_1': (0.1, 2.0), 'δ': (1.0, 10.0)},
        _terminal_balance,
        200,
    ),
    Claim(
        'time_delay',
        r'At rest with equal gains on all axes the loop is stable up to $\alpha = 4/(2 + K_d T)$, '
        r'and unstable above, where $\alpha$ is any eigenvalue of $H_{\mathrm{true}}^{-1} H$.',
        EIGENVALUES,
        {**_T, 'K_d': (1.0, 60.0), 'K_p T / K_d': (1e-3, 0.5)},
        lambda values, factor: _delay_share(values, factor, is_upper=True),
    ),
    Claim(
        'time_delay',
        r'It is stable down to $\alpha = K_p T/(K_d + \tfrac12 K_p T)$, and unstable below.',
        EIGENVALUES,
        {**_T, 'K_d': (1.0, 60.0), 'K_p T / K_d': (1e-3, 0.5)},
        lambda values, factor: _delay_share(values, factor, is_upper=False),
    ),
    Claim(
        'momentum_observer',
        r'At rest with equal gains on all axes the loop is stable for $\alpha$ from 0.9 of '
        r'$4/(2 g + (2 - g) K_d T)$ up to this limit, with $g = T K_o/(1 + T K_o)$, and unstable '
        r'above.',
        EIGENVALUES,
        {
            'T': (2e-4, 0.01), 'K_d': (10.0, 100.0), 'K_p / K_d²': (0.01, 0.25),
            'K_o': (10.0, 200.0),
        },
        _observer_share,
    ),
    Claim(
        'composite_adaptation',
        r'A step along $\Gamma^{-1}W^T\epsilon$ below twice the length of its minimum reduces the '
        r'prediction error, and a longer one does not. The step with $\kappa/(1 + T\kappa q)$ '
        r'ends before the minimum for any $\kappa$.',
        MATRICES,
        _MATRICES,
        _prediction_step,
    ),
    Claim(
        'concurrent_learning',
        r'Without new data every part of $\hat\theta - \theta$ decreases per period at least by '
        r'the factor $1 + T\kappa\lambda_{\min}(\Gamma^{-1}A)$, for any $\kappa$; one part not '
        r'faster.',
        EIGENVALUES,
        {'T κ': (1e-4, 1e4)},
        _recorded_rate,
    ),
)
"""Claims of the laws; those of a law are neighbours."""

THEORY: tuple[Claim, ...] = (
    Claim(
        'sampled_laws',
        r'A state that is $m$ periods old, $s_{k+1} = s_k - g\,s_{k-m}$, is stable for '
        r'$g < 2 \sin(\pi/(4m + 2))$, and unstable above.',
        EIGENVALUES,
        {'m': (1.0, 20.0)},
        _late_state,
        1000,
    ),
    Claim(
        'estimator',
        r'With a constant residual acceleration the estimator is stable for $\kappa < 2gh/(2-g)$, '
        r'and unstable above; its $\kappa$ is below for every $\omega T$.',
        EIGENVALUES,
        {'ω T': (0.01, 100.0)},
        _estimator_gain,
    ),
    Claim(
        'adaptation',
        r'With the inertia one and the gain $K$ of all axes, $KT$ up to 1.9 and a frozen '
        r'regressor, $s$ and $\hat\theta$ are stable for '
        r'$T\,\lVert J^{-T}\bar Y\,\Gamma^{-1}\,\bar Y^T J^{-1}\rVert < K$, and unstable above.',
        EIGENVALUES,
        {**_T, 'K T': (0.01, 1.9)},
        _axes_adaptation,
        2000,
    ),
    Claim(
        'adaptation',
        r'$Q(\theta) \succ 0$ for $m_{\min} < m_{\max}$ with $A, G \succ 0$, and not for '
        r'$m_{\min} > m_{\max}$.',
        MATRICES,
        _MATRICES,
        _consistent,
    ),
    Claim(
        'adaptation',
        r'A projection onto a half-space in the metric $\Gamma$, and any step up to twice as far, '
        r'does not increase the distance to a point of it; a longer step does.',
        MATRICES,
        _MATRICES,
        _half_space,
    ),
)
"""Claims of pages of docs/theory/."""

BY_SOURCE: Mapping[str, str] = {
    'smc': 'reaching of $s = 0$ with `sign` in continuous time',
    'rasmc': 'convergence of $s$ to zero with `sign` in continuous time',
    'null_space': 'behaviour of the robot close to a singularity of the other axes',
    'rbf_sliding': 'existence of $W^*$, and the decrease of $V$',
    'decentralised_sliding': 'attraction of $s = 0$ for a constant $M^{-1}c$',
    'adaptive_gain': 'decrease of the Lyapunov function outside the dead zone',
    'fuzzy_gain': 'existence of ideal rules',
    'variable_structure': 'decrease of $\\tfrac12 s^T H_x s$ for positive $g_i$',
    'fuzzy_model': 'existence of ideal rules',
    'hybrid_network': 'decrease of $V_i$ outside the layer',
    'pid': 'convergence of the non-linear robot at a set-point',
    'pd_gravity': 'passivity of the non-linear robot',
    'super_twisting': 'finite time until the surface',
    'adaptive_super_twisting': 'finite time until the zone',
    'barrier': 'the continuous law below $\\varepsilon$',
    'terminal': 'finite time of $s_t$ and $e$ without disturbance',
    'time_delay': 'loops of a moving robot',
    'momentum_observer': 'loops of a moving robot',
    'composite_adaptation': 'convergence of $\\hat\\theta$ with persistent excitation',
    'concurrent_learning': 'decrease of the Lyapunov function of `rasmc`',
}
"""Conditions that no computer examines here, by law."""
