# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Implicit reaching law: optimality conditions, solution, disturbance estimate."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

from helpers.robots import Array, assert_agree, between, PROPERTY
from helpers.scenario import law_records, Scenario
from hypothesis import example, given
from hypothesis import strategies as st
from masmc_ros.jit.record import fill
from masmc_ros.law.reaching.implicit import disturbance_estimate, implicit_reaching, solution
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import control_tick
from masmc_ros.loop.signals import inputs
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest

MOST_AXES = 6


@dataclass(frozen=True)
class Problem:
    """(H_x + T K_s1) s+ + T K_s2 zeta = H_x s with zeta in Sgn(s+)."""

    inertia: Array
    period: float
    k_s1: Array
    k_s2: Array
    s: Array

    @property
    def matrix(self) -> Array:
        """H_x + T K_s1."""
        return self.inertia + self.period * np.diag(self.k_s1)

    @property
    def box(self) -> Array:
        """T K_s2."""
        return self.period * self.k_s2

    def solve(self) -> tuple[Array, Array]:
        """Return s+ and zeta of the kernel."""
        n = len(self.s)
        # Earlier contents of workspace and results must have no effect.
        next_s, zeta, work = np.full(n, 7.0), np.full(n, 7.0), np.full((n, n + 1), 7.0)
        implicit_reaching(
            n, self.inertia, self.period, self.k_s1, self.k_s2, self.s, next_s, zeta, work
        )
        short = solution(
            tuple(tuple(column) for column in self.inertia.T.tolist()),
            self.period,
            *(tuple(vector.tolist()) for vector in (self.k_s1, self.k_s2, self.s)),
        )
        # The solver of the ticks skips unused results; its solution is bitwise identical.
        np.testing.assert_array_equal(short, (next_s, zeta))
        return next_s, zeta


def estimated(inertia: Array, s: Array, predicted: Array, gain: float, previous: Array) -> Array:
    """Return the next disturbance estimate."""
    columns = tuple(tuple(column) for column in inertia.T.tolist())
    current_s, predicted_s = tuple(s.tolist()), tuple(predicted.tolist())
    return np.array(
        disturbance_estimate(columns, current_s, predicted_s, gain, tuple(previous.tolist()))
    )


def random_inertia(rng: np.random.Generator, n: int, decades: float) -> Array:
    """Return a symmetric positive definite matrix; eigenvalues span `decades` around 1."""
    axes = np.linalg.qr(rng.normal(size=(n, n)))[0]
    eigenvalues = 10.0 ** rng.uniform(-decades / 2, decades / 2, n)
    matrix = (axes * eigenvalues) @ axes.T
    return 0.5 * (matrix + matrix.T)


@st.composite
def problems(draw: st.DrawFn, most_decades: float = 10.0) -> Problem:
    """Draw a problem; every combination of sliding and moving axes occurs."""
    n = draw(st.integers(1, MOST_AXES))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    inertia = random_inertia(rng, n, draw(between(0.0, most_decades)))
    period = draw(st.sampled_from((1e-4, 1e-3, 1e-2, 0.1)))
    s = rng.normal(size=n) * draw(st.sampled_from((1e-6, 1e-2, 1.0, 30.0)))
    k_s1 = 10.0 ** rng.uniform(-2.0, 3.0, n)
    # About the size that stops an axis within the period, from a tenth to ten times of it.
    k_s2 = np.abs(inertia @ s) / period * 10.0 ** rng.uniform(-1.0, 1.0, n)
    for vector in (s, k_s1, k_s2):
        vector[[draw(st.integers(0, 5)) == 0 for _ in range(n)]] = 0.0
    return Problem(inertia, period, k_s1, k_s2, s)


def conditions(problem: Problem, following: Array, zeta: Array) -> Array:
    """Return the residual of every axis, relative to the sum of its terms."""
    residual = problem.matrix @ following + problem.box * zeta - problem.inertia @ problem.s
    size = (
        np.abs(problem.matrix) @ np.abs(following)
        + np.abs(problem.inertia) @ np.abs(problem.s)
        + problem.box
    )
    return np.abs(residual) / np.where(size > 0.0, size, 1.0)


EXACTLY_REACHED = Problem(
    np.eye(2), 0.5, np.array([0.0, 0.0]), np.array([2.0, 2.0]), np.array([1.0, -1.0])
)
COUPLED_TIE = Problem(
    np.array([[2.0, 1.0], [1.0, 2.0]]), 1.0, np.zeros(2), np.array([3.0, 3.0]), np.ones(2)
)
OPPOSED = Problem(
    np.array([[1.0, 0.999999], [0.999999, 1.0]]),
    1.0,
    np.zeros(2),
    np.array([1e-6, 1e-6]),
    np.array([1.0, -1.0]),
)


@pytest.mark.slow
@PROPERTY
@given(problems())
@example(EXACTLY_REACHED)
@example(COUPLED_TIE)
@example(OPPOSED)
def test_implicit_solution_fulfils_optimality_conditions(problem: Problem) -> None:
    following, zeta = problem.solve()
    assert (conditions(problem, following, zeta) <= 1e-11).all()
    boxed = problem.k_s2 > 0.0
    assert (np.abs(zeta) <= 1.0).all()
    assert (zeta[boxed & (following > 0.0)] == 1.0).all()
    assert (zeta[boxed & (following < 0.0)] == -1.0).all()
    assert (zeta[~boxed] == 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize('decades', [0, 6, 12])
def test_implicit_ill_conditioned_problems_are_solved(decades: int) -> None:
    """A sweeping method fails for some of these ill-conditioned problems."""
    rng = np.random.default_rng(decades)
    for _ in range(2000):
        n = int(rng.integers(1, MOST_AXES + 2))
        inertia = random_inertia(rng, n, decades)
        s = rng.normal(size=n) * 10.0 ** rng.uniform(-4.0, 1.0)
        k_s2 = np.abs(inertia @ s) * 1e3 * 10.0 ** rng.uniform(-2.0, 1.0, n)
        k_s1 = 10.0 ** rng.uniform(-2.0, 3.0, n) * rng.integers(0, 2)
        problem = Problem(inertia, 1e-3, k_s1, k_s2, s)
        following, zeta = problem.solve()
        assert (conditions(problem, following, zeta) <= 1e-11).all()
        assert (np.abs(zeta) <= 1.0).all()
        assert (zeta[following != 0.0] == np.sign(following[following != 0.0])).all()


def enumerated(problem: Problem) -> Array:
    """Return s+ by enumeration of all 3^n sides: the one with the smallest violation."""
    n, matrix, box = len(problem.s), problem.matrix, problem.box
    right = problem.inertia @ problem.s
    best, smallest = np.zeros(n), np.inf
    for sides in product((-1.0, 0.0, 1.0), repeat=n):
        side = np.array(sides)
        moving = (side != 0.0) | (box == 0.0)
        next_s = np.zeros(n)
        if moving.any():
            known = right[moving] - box[moving] * side[moving]
            next_s[moving] = np.linalg.solve(matrix[np.ix_(moving, moving)], known)
        residual = np.abs(right - matrix @ next_s)
        beyond_box = np.where(moving, 0.0, residual - box) / np.abs(right).max()
        wrong_side = np.where(box > 0.0, -side * next_s, 0.0) / np.abs(problem.s).max()
        violated = max(beyond_box.max(), wrong_side.max(), 0.0)
        if violated < smallest:
            best, smallest = next_s, violated
    return best


@PROPERTY
@given(problems(most_decades=4.0).filter(lambda p: np.abs(p.s).max() > 0.0))
@example(EXACTLY_REACHED)
@example(COUPLED_TIE)
@pytest.mark.slow
def test_implicit_solution_equals_enumeration(problem: Problem) -> None:
    following, _ = problem.solve()
    assert_agree(following, enumerated(problem), 1e-9, scale=np.abs(problem.s).max())


@PROPERTY
@given(problems())
def test_implicit_solution_is_exactly_odd(problem: Problem) -> None:
    mirrored = Problem(problem.inertia, problem.period, problem.k_s1, problem.k_s2, -problem.s)
    for one, other in zip(problem.solve(), mirrored.solve(), strict=True):
        assert (one == -other).all()


@PROPERTY
@given(problems())
def test_implicit_on_surface_solution_is_zero(problem: Problem) -> None:
    still = Problem(
        problem.inertia, problem.period, problem.k_s1, problem.k_s2, np.zeros_like(problem.s)
    )
    following, zeta = still.solve()
    assert not following.any()
    assert not zeta.any()


@PROPERTY
@given(problems(most_decades=6.0))
def test_implicit_zero_switching_gain_is_implicit_euler(problem: Problem) -> None:
    linear = Problem(
        problem.inertia, problem.period, problem.k_s1, np.zeros_like(problem.s), problem.s
    )
    following, zeta = linear.solve()
    expected = np.linalg.solve(linear.matrix, linear.inertia @ linear.s)
    assert_agree(following, expected, 1e-8, scale=np.abs(problem.s).max() + 1e-9)
    assert not zeta.any()


@PROPERTY
@given(st.integers(0, 2**32 - 1), st.integers(1, MOST_AXES))
def test_implicit_reaches_surface_without_chattering(seed: int, n: int) -> None:
    """With the true model s = 0 is reached in finite time and kept exactly."""
    rng = np.random.default_rng(seed)
    inertia, s = random_inertia(rng, n, 2.0), rng.normal(size=n)
    gains, period = np.full(n, 10.0), 0.01
    energy = float(s @ inertia @ s)
    for _ in range(400):
        s, _ = Problem(inertia, period, gains, gains, s).solve()
        left = float(s @ inertia @ s)
        assert left < energy or left == 0.0
        energy = left
    assert not s.any()


def test_implicit_nan_in_surface_reaches_solution() -> None:
    s = np.array([0.1, np.nan, 0.2, 0.3])
    following, zeta = Problem(np.eye(4), 1e-3, np.full(4, 100.0), np.full(4, 100.0), s).solve()
    assert np.isnan(following).any() or np.isnan(zeta).any()


@pytest.mark.parametrize('bend', [0.0, 1e-300, 1e-12, 1e-6, -0.01, np.pi])
@pytest.mark.parametrize('k_s1', [0.0, 100.0])
@pytest.mark.parametrize('k_s2', [0.0, 100.0])
def test_implicit_singular_arm_torque_is_finite(bend: float, k_s1: float, k_s2: float) -> None:
    gains = {'k_s1': np.full(4, k_s1), 'k_s2': np.full(4, k_s2), 'model_scale': 1.0}
    settings, memory = law_records(Scenario('smc', 'implicit', 0.5, **gains))
    memory['predicted'] = 0.0
    signals = records.signals(TWO_LINK)
    fill(signals, 'torque', np.full(4, np.nan))
    fill(signals, 'position', [0.0, 0.0, 0.4, 0.0, 0.0, 0.7, bend])
    fill(signals, 'velocity', [0.1, 0.0, 0.2, 1.0, 2.0, 0.5, -0.4])
    fill(signals, 'reference', [0.8, 0.6, 0.1, 0.0, 0.2, 0.1, 0.2, 0.0, 0.0, 0.1, 0.0, 0.0])
    control_tick(settings, memory, signals, *inputs(signals))
    assert signals['singular'].all()
    assert np.isfinite(signals['torque']).all()
    assert np.isfinite(memory['predicted']).all()


@PROPERTY
@given(st.integers(0, 2**32 - 1), st.integers(1, MOST_AXES), between(0.01, 1.0))
def test_disturbance_estimate_constant_push_converges(seed: int, n: int, gain: float) -> None:
    """The remainder of a constant disturbance shrinks by 1 - beta at every tick."""
    rng = np.random.default_rng(seed)
    inertia, disturbance = random_inertia(rng, n, 3.0), rng.normal(size=n) * 20.0
    period, gains = 1e-3, np.full(n, 100.0)
    s, estimate, predicted = rng.normal(size=n), np.zeros(n), np.full(n, np.nan)
    for k in range(40):
        estimate = estimated(inertia, s, predicted, gain / period, estimate)
        remainder, size = disturbance * (1.0 - gain) ** k, np.abs(disturbance).max()
        assert_agree(disturbance - estimate, remainder, 1e-9, scale=size)
        predicted, zeta = Problem(inertia, period, gains, gains, s).solve()
        u = -(gains * predicted + gains * zeta) - estimate
        s = s + period * np.linalg.solve(inertia, u + disturbance)


@pytest.mark.parametrize(('gain', 'predicted'), [(0.0, 0.3), (500.0, np.nan)])
def test_disturbance_estimate_off_or_first_tick_is_kept(gain: float, predicted: float) -> None:
    estimate = np.array([1.0, 2.0, 3.0, 4.0])
    estimate = estimated(np.eye(4), np.ones(4), np.full(4, predicted), gain, estimate)
    assert estimate.tolist() == [1.0, 2.0, 3.0, 4.0]
