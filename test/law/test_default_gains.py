# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Default gains of axes in m and in rad."""

from __future__ import annotations

from pathlib import Path

from helpers.small_tree import hand_at_start, write_scenario
from masmc_ros.law import registry
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from masmc_ros.scenario.scenario import load_scenario


def test_default_gain_in_newtons_is_a_tenth_for_axes_in_rad(tmp_path: Path) -> None:
    """A gain per mass is equal for both; the inertia scales it."""
    file = write_scenario(tmp_path, hand_at_start(), 1.0)
    mechanism = mechanism_from(load_scenario(str(file))['plant'])
    assert [axis.unit for axis in mechanism.axes] == ['m'] * 3 + ['rad'] * 3
    default = {p.name: p.default for p in registry.parameters(mechanism)}
    for name in ('k_s1', 'k_s2', 'pid.k_p', 'pid.k_d', 'pid.k_i', 'rbf_sliding.k'):
        assert default[name][3:] == tuple(0.1 * gain for gain in default[name][:3])
        assert default[name][0] > 0.0
    for name in ('sigma', 'nonlinear_feedback.k_p', 'time_delay.k_d', 'super_twisting.k_1'):
        assert len(set(default[name])) == 1


def test_default_gains_of_inverse_models_are_equal() -> None:
    """The comparison of laws is not one of gains: natural frequency and damping are equal."""
    default = {p.name: p.default for p in registry.parameters(TWO_LINK)}
    # The inner loop of computed_torque has these gains in the joints.
    laws = (
        'nonlinear_feedback', 'computed_torque', 'null_space', 'momentum_observer', 'time_delay'
    )
    gains = {(default[f'{law}.k_p'], default[f'{law}.k_d']) for law in laws}
    ((k_p, k_d),) = gains
    assert k_p == (900.0,) * 4
    assert all(d * d == 4.0 * p for p, d in zip(k_p, k_d, strict=True))
