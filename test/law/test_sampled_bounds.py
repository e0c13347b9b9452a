# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Numbers of the pages in docs/reference/laws/ about stable sampled loops, and runs at their bounds.

test_claims.py examines the bounds themselves; loops and bounds are those of tools/claims.py.
"""

from __future__ import annotations

from pathlib import Path
import re

from claims import (
    estimator,
    momentum_observer,
    momentum_observer_limit,
    radius,
    task_feedback,
    time_delay_range,
)
from helpers.robots import AXES, BASE_PARAMETERS, between, DEFAULT, Machine
from helpers.scenario import law_records, Scenario
from hypothesis import assume, given
from masmc_ros import simulate
from masmc_ros.errors import InputError
from masmc_ros.jit.record import fill
from masmc_ros.loop import records
from masmc_ros.loop.dense import tick_input
from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
PAPER = str(ROOT / 'config' / 'paper.yaml')
DEFAULT_GAINS = (900.0, 60.0)
DEFAULT_RATE = 200.0


def of_numbers(*numbers: float) -> tuple[Array, ...]:
    """Return the arguments of the loops for one draw."""
    return tuple(np.array([number]) for number in numbers)


periods = between(2e-4, 0.03)
dampings = between(1.0, 150.0)


@given(periods, dampings, between(0.01, 3.0))
def test_task_feedback_equals_continuous_loop_of_page(
    period: float, k_d: float, part: float
) -> None:
    """The bilinear variable maps the poles to those of the loop with other inertia and damping."""
    k_p = part * k_d / period
    inertia = 1.0 - 0.5 * k_d * period
    assume(abs(inertia) > 0.05)
    poles = np.roots([inertia, k_d - 0.5 * k_p * period, k_p])
    sampled = (1.0 + 0.5 * period * poles) / (1.0 - 0.5 * period * poles)
    expected = np.poly(sampled).real
    (matrix,) = task_feedback(*of_numbers(k_p, k_d, period))
    assert np.poly(matrix) == pytest.approx(expected, rel=1e-8, abs=1e-8)


def test_task_feedback_damping_of_defaults_rises_with_period() -> None:
    page = (ROOT / 'docs/reference/laws/nonlinear_feedback.md').read_text(encoding='utf-8')
    stated = re.search(r'with the period: ([\d.]+) at 1 ms, ([\d.]+) at 10 ms', page)
    assert stated is not None
    k_p, k_d = DEFAULT_GAINS
    ratios = [
        (k_d - 0.5 * k_p * t) / (2.0 * np.sqrt(k_p * (1.0 - 0.5 * k_d * t))) for t in (1e-3, 1e-2)
    ]
    assert [f'{ratios[0]:.3f}', f'{ratios[1]:.2f}'] == list(stated.groups())
    # A delay of T/2, as this page said before, would reduce it.
    assert ratios[1] > ratios[0] > 1.0


def delay_range(period: float) -> list[float]:
    """Return the stable shares of `time_delay` with the default gains."""
    return [float(*bound) for bound in time_delay_range(*of_numbers(*DEFAULT_GAINS, period))]


def observer_limit(period: float) -> float:
    """Return the largest stable share of `momentum_observer` with the default gains."""
    return float(*momentum_observer_limit(*of_numbers(DEFAULT_GAINS[1], period, DEFAULT_RATE)))


def stable_shares(period: float) -> tuple[float, float]:
    """Return the range of shares with a stable observer and the default gains."""
    shares = np.geomspace(1e-3, 20.0, 20_000)
    gains = of_numbers(*DEFAULT_GAINS, period)
    is_stable = radius(momentum_observer(*gains, shares, np.array([DEFAULT_RATE]))) < 1.0
    first, last = np.flatnonzero(is_stable)[[0, -1]]
    assert is_stable[first:last + 1].all()
    return float(shares[first]), float(shares[last])


def stated(law: str, pattern: str) -> list[float]:
    """Return the numbers of a sentence of a law's page."""
    page = ROOT / 'docs' / 'reference' / 'laws' / f'{law}.md'
    found = re.search(pattern, ' '.join(page.read_text(encoding='utf-8').split()))
    assert found is not None, f'{law}: {pattern}'
    return [float(number) for number in found.groups()]


def test_ranges_of_pages_are_those_of_the_defaults() -> None:
    numbers = stated(
        'time_delay', r'([\d.]+) to ([\d.]+) at 1 ms, ([\d.]+) to ([\d.]+) at 10 ms'
    )
    expected = [bound for period in (1e-3, 1e-2) for bound in delay_range(period)]
    assert numbers == pytest.approx(expected, rel=0.02)
    numbers = stated(
        'momentum_observer',
        r'from ([\d.]+) to ([\d.]+) at 1 ms, and from ([\d.]+) to ([\d.]+) at 10 ms',
    )
    expected = [bound for period in (1e-3, 1e-2) for bound in stable_shares(period)]
    assert numbers == pytest.approx(expected, rel=0.005)
    for period in (1e-3, 1e-2):
        assert stable_shares(period)[1] == pytest.approx(observer_limit(period), 1e-3)


def estimator_poles(g: float, h: float, kappa: float) -> Array:
    return np.sort_complex(np.linalg.eigvals(estimator(*of_numbers(g, h, kappa))[0]))


def test_estimator_poles_are_those_of_the_page() -> None:
    page = (ROOT / 'docs/theory/estimator.md').read_text(encoding='utf-8')
    stated = re.search(r'They are ([\d.]+), ([\d.]+) and ([\d.]+) at 1000 rad/s and 1 ms', page)
    assert stated is not None
    z = 0.5
    g, h = 1.0 - z * z, (1.0 - z) ** 2
    poles = estimator_poles(g, h, 0.1 * h * h / g)
    assert poles == pytest.approx([float(pole) for pole in stated.groups()], abs=5e-3)
    critical = estimator_poles(1.0 - z**3, 1.5 * (1.0 - z * z) * (1.0 - z), (1.0 - z) ** 3)
    assert critical == pytest.approx([z] * 3, abs=1e-4)  # a triple root is ill-conditioned


def test_inertia_along_path_is_that_of_the_pages() -> None:
    """Gains per period of the laws with a layer, from the matrices of the true robot."""
    settings, _ = law_records(Scenario('smc', 'implicit', robot=Machine(DEFAULT), model_scale=1.0))
    signals = records.signals(TWO_LINK)
    gains, nothing = {'sigma': np.full(AXES, 2.0)}, np.zeros(BASE_PARAMETERS)
    task, joints, couplings = [], [], []
    for position in simulate('paper').position[::100]:
        fill(signals, 'position', position)
        tick = tick_input(settings, signals, gains, nothing, np.zeros(AXES))
        groups = tick.inertia.copy()
        groups[:2, 2:] = groups[2:, :2] = 0.0
        task.append(np.linalg.eigvalsh(0.5 * (tick.task_inertia + tick.task_inertia.T))[0])
        joints.append(np.linalg.eigvalsh(tick.inertia)[0])
        couplings.append(np.linalg.eigvals(np.linalg.solve(tick.inertia, groups)).real)
    slope = 2.0 * min(task) / 1e-3
    for law in ('adaptive_gain', 'fuzzy_gain', 'rbf_sliding', 'variable_structure'):
        assert stated(law, r'(\d+) N·s/m for the default') == [round(slope, -1)]
    assert stated('variable_structure', r'\$g\$ < (\d+) N') == [round(round(slope, -1) * 0.2)]
    assert stated('fuzzy_model', r'(\d+) N·m·s for') == [round(2.0 * min(joints) / 1e-3)]
    lowest, highest = np.min(couplings), np.max(couplings)
    assert stated('decentralised_sliding', r'from ([\d.]+) to ([\d.]+) along') == pytest.approx(
        [lowest, highest], rel=0.01
    )
    (reached,) = stated('decentralised_sliding', r'It is ([\d.]+) with the defaults')
    assert reached == pytest.approx(1e-3 * (20.0 + 40.0 / 0.2) * highest, abs=0.005)


def is_smooth(law: str, period: float, share: float, *settings: str) -> bool:
    """Return True if a run with this share of the true masses ends without chattering."""
    scenario = load_scenario(PAPER, [
        f'controller.law={law}', f'control_period={period}', f'controller.model_scale={share}',
        'duration=20.0', *settings,
    ])
    try:
        torque = np.concatenate([block.torque for block in Simulation(scenario).run()])
    except InputError:
        return False  # it diverged
    late = torque[len(torque) // 2:]
    variation = np.abs(np.diff(late, axis=0)).sum() / (len(late) * period)
    return bool(variation < 100.0)


@pytest.mark.slow
@pytest.mark.parametrize('period', [1e-3, 1e-2])
def test_time_delay_runs_are_smooth_inside_range_only(period: float) -> None:
    lower, upper = delay_range(period)
    assert is_smooth('time_delay', period, 0.95 * upper)
    assert not is_smooth('time_delay', period, 1.05 * upper)
    assert is_smooth('time_delay', period, 1.5 * lower)
    assert not is_smooth('time_delay', period, 0.5 * lower)


@pytest.mark.slow
@pytest.mark.parametrize('period', [1e-3, 1e-2])
def test_momentum_observer_runs_are_smooth_below_limit_only(period: float) -> None:
    limit = observer_limit(period)
    assert is_smooth('momentum_observer', period, 0.95 * limit)
    assert not is_smooth('momentum_observer', period, 1.05 * limit)
