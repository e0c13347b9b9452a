# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The implicit reaching law: its optimality conditions, its solution, its disturbance estimate."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

from hypothesis import example, given
from hypothesis import strategies as st
from masmc_ros.law.reaching.implicit import disturbance_estimate, implicit_reaching, solution
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import control_tick
from masmc_ros.loop.signals import inputs
from masmc_ros.numerics.record import fill
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest
from robots import Array, assert_agree, between, PROPERTY
from scenario import law_records, Scenario

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
        # What a workspace or a result held before must not matter.
        following, zeta, work = np.full(n, 7.0), np.full(n, 7.0), np.full((n, n + 1), 7.0)
        implicit_reaching(
            n, self.inertia, self.period, self.k_s1, self.k_s2, self.s, following, zeta, work
        )
        short = solution(
            tuple(tuple(column) for column in self.inertia.T.tolist()),
            self.period,
            *(tuple(each.tolist()) for each in (self.k_s1, self.k_s2, self.s)),
        )
        # The way that ticks take, which spares what is not needed, ends in the same bits.
        np.testing.assert_array_equal(short, (following, zeta))
        return following, zeta


def estimated(inertia: Array, s: Array, predicted: Array, gain: float, found: Array) -> Array:
    """Return the next disturbance estimate."""
    columns = tuple(tuple(column) for column in inertia.T.tolist())
    s_now, s_told = tuple(s.tolist()), tuple(predicted.tolist())
    return np.array(
        disturbance_estimate(columns, s_now, s_told, gain, tuple(found.tolist()))
    )


def random_inertia(rng: np.random.Generator, n: int, decades: float) -> Array:
    """Symmetric positive definite, eigenvalues spread over as many decades around 1."""
    axes = np.linalg.qr(rng.normal(size=(n, n)))[0]
    eigenvalues = 10.0 ** rng.uniform(-decades / 2, decades / 2, n)
    matrix = (axes * eigenvalues) @ axes.T
    return 0.5 * (matrix + matrix.T)


@st.composite
def problems(draw: st.DrawFn, most_decades: float = 10.0) -> Problem:
    """Draw a problem in which every combination of sliding and moving axes comes up."""
    n = draw(st.integers(1, MOST_AXES))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    inertia = random_inertia(rng, n, draw(between(0.0, most_decades)))
    period = draw(st.sampled_from((1e-4, 1e-3, 1e-2, 0.1)))
    s = rng.normal(size=n) * draw(st.sampled_from((1e-6, 1e-2, 1.0, 30.0)))
    k_s1 = 10.0 ** rng.uniform(-2.0, 3.0, n)
    # Of the size that just stops an axis within the period, ten times less or more.
    k_s2 = np.abs(inertia @ s) / period * 10.0 ** rng.uniform(-1.0, 1.0, n)
    for vector in (s, k_s1, k_s2):
        vector[[draw(st.integers(0, 5)) == 0 for _ in range(n)]] = 0.0
    return Problem(inertia, period, k_s1, k_s2, s)


def conditions(problem: Problem, following: Array, zeta: Array) -> Array:
    """Residual of each axis, relative to the terms that it is the sum of."""
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


@PROPERTY
@given(problems())
@example(EXACTLY_REACHED)
@example(COUPLED_TIE)
@example(OPPOSED)
def test_the_solution_fulfils_its_conditions(problem: Problem) -> None:
    following, zeta = problem.solve()
    assert (conditions(problem, following, zeta) <= 1e-11).all()
    boxed = problem.k_s2 > 0.0
    assert (np.abs(zeta) <= 1.0).all()
    assert (zeta[boxed & (following > 0.0)] == 1.0).all()
    assert (zeta[boxed & (following < 0.0)] == -1.0).all()
    assert (zeta[~boxed] == 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize('decades', [0, 6, 12])
def test_hard_problems_in_bulk(decades: int) -> None:
    """Many ill-conditioned problems, of which a sweeping method fails some."""
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
    """Return s+ by trying all 3^n sides: the one whose conditions are violated least."""
    n, matrix, box = len(problem.s), problem.matrix, problem.box
    right = problem.inertia @ problem.s
    best, least = np.zeros(n), np.inf
    for sides in product((-1.0, 0.0, 1.0), repeat=n):
        side = np.array(sides)
        beside = (side != 0.0) | (box == 0.0)
        following = np.zeros(n)
        if beside.any():
            known = right[beside] - box[beside] * side[beside]
            following[beside] = np.linalg.solve(matrix[np.ix_(beside, beside)], known)
        rest = np.abs(right - matrix @ following)
        over = np.where(beside, 0.0, rest - box) / np.abs(right).max()
        wrong = np.where(box > 0.0, -side * following, 0.0) / np.abs(problem.s).max()
        violated = max(over.max(), wrong.max(), 0.0)
        if violated < least:
            best, least = following, violated
    return best


@PROPERTY
@given(problems(most_decades=4.0).filter(lambda p: np.abs(p.s).max() > 0.0))
@example(EXACTLY_REACHED)
@example(COUPLED_TIE)
def test_the_solution_is_the_one_of_all_sides(problem: Problem) -> None:
    following, _ = problem.solve()
    assert_agree(following, enumerated(problem), 1e-9, scale=np.abs(problem.s).max())


@PROPERTY
@given(problems())
def test_the_law_is_odd_to_the_bit(problem: Problem) -> None:
    mirrored = Problem(problem.inertia, problem.period, problem.k_s1, problem.k_s2, -problem.s)
    for one, other in zip(problem.solve(), mirrored.solve(), strict=True):
        assert (one == -other).all()


@PROPERTY
@given(problems())
def test_on_the_surface_it_stays_there(problem: Problem) -> None:
    still = Problem(
        problem.inertia, problem.period, problem.k_s1, problem.k_s2, np.zeros_like(problem.s)
    )
    following, zeta = still.solve()
    assert not following.any()
    assert not zeta.any()


@PROPERTY
@given(problems(most_decades=6.0))
def test_without_switching_gain_it_is_implicit_euler(problem: Problem) -> None:
    linear = Problem(
        problem.inertia, problem.period, problem.k_s1, np.zeros_like(problem.s), problem.s
    )
    following, zeta = linear.solve()
    expected = np.linalg.solve(linear.matrix, linear.inertia @ linear.s)
    assert_agree(following, expected, 1e-8, scale=np.abs(problem.s).max() + 1e-9)
    assert not zeta.any()


@PROPERTY
@given(st.integers(0, 2**32 - 1), st.integers(1, MOST_AXES))
def test_it_reaches_the_surface_and_does_not_chatter(seed: int, n: int) -> None:
    """With the exact model, s = 0 is reached in finite time and kept to the last bit."""
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


def test_not_a_number_is_not_hidden() -> None:
    s = np.array([0.1, np.nan, 0.2, 0.3])
    following, zeta = Problem(np.eye(4), 1e-3, np.full(4, 100.0), np.full(4, 100.0), s).solve()
    assert np.isnan(following).any() or np.isnan(zeta).any()


@pytest.mark.parametrize('bend', [0.0, 1e-300, 1e-12, 1e-6, -0.01, np.pi])
@pytest.mark.parametrize('k_s1', [0.0, 100.0])
@pytest.mark.parametrize('k_s2', [0.0, 100.0])
def test_the_torque_is_finite_at_a_singular_arm(bend: float, k_s1: float, k_s2: float) -> None:
    gains = {'k_s1': np.full(4, k_s1), 'k_s2': np.full(4, k_s2), 'model_scale': 1.0}
    settings, memory = law_records(Scenario('smc', 'implicit', 0.5, **gains))
    memory['predicted'] = 0.0
    now = records.signals(TWO_LINK)
    fill(now, 'torque', np.full(4, np.nan))
    fill(now, 'position', [0.0, 0.0, 0.4, 0.0, 0.0, 0.7, bend])
    fill(now, 'velocity', [0.1, 0.0, 0.2, 1.0, 2.0, 0.5, -0.4])
    fill(now, 'reference', [0.8, 0.6, 0.1, 0.0, 0.2, 0.1, 0.2, 0.0, 0.0, 0.1, 0.0, 0.0])
    control_tick(settings, memory, now, *inputs(now))
    assert now['singular'].all()
    assert np.isfinite(now['torque']).all()
    assert np.isfinite(memory['predicted']).all()


@PROPERTY
@given(st.integers(0, 2**32 - 1), st.integers(1, MOST_AXES), between(0.01, 1.0))
def test_a_constant_disturbance_is_rejected(seed: int, n: int, gain: float) -> None:
    """What is left of a constant disturbance shrinks by 1 - beta at every tick."""
    rng = np.random.default_rng(seed)
    inertia, push = random_inertia(rng, n, 3.0), rng.normal(size=n) * 20.0
    period, gains = 1e-3, np.full(n, 100.0)
    s, found, predicted = rng.normal(size=n), np.zeros(n), np.full(n, np.nan)
    for k in range(40):
        found = estimated(inertia, s, predicted, gain / period, found)
        assert_agree(push - found, push * (1.0 - gain) ** k, 1e-9, scale=np.abs(push).max())
        predicted, zeta = Problem(inertia, period, gains, gains, s).solve()
        u = -(gains * predicted + gains * zeta) - found
        s = s + period * np.linalg.solve(inertia, u + push)


@pytest.mark.parametrize(('gain', 'predicted'), [(0.0, 0.3), (500.0, np.nan)])
def test_the_estimate_rests_when_off_and_at_the_first_tick(gain: float, predicted: float) -> None:
    found = np.array([1.0, 2.0, 3.0, 4.0])
    found = estimated(np.eye(4), np.ones(4), np.full(4, predicted), gain, found)
    assert found.tolist() == [1.0, 2.0, 3.0, 4.0]
