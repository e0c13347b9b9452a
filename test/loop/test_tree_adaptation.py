# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptation of the bodies and of the friction of trees."""

from __future__ import annotations

from pathlib import Path

from helpers.small_tree import hand_at_start, write_scenario
from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

_LINK = """<link name="l{0}"><inertial><origin xyz="{1}" rpy="{2}"/><mass value="{3}"/>
<inertia ixx="{4}" ixy="0" ixz="0" iyy="{5}" iyz="0" izz="{6}"/></inertial></link>"""
_JOINT = """<joint name="j{0}" type="revolute"><parent link="l{1}"/><child link="l{0}"/>
<origin xyz="{2}" rpy="{3}"/><axis xyz="{4}"/>
<limit lower="-9" upper="9" effort="1000" velocity="100"/></joint>"""
_SCENARIO = """/**:
  ros__parameters:
    robot: {{urdf: {urdf}, joints: {joints}, task: joints}}
    control_period: 0.01
    duration: 3.0
/**/controller:
  ros__parameters: {{switching: implicit, gamma: {gamma}, model_scale: {scale}}}
/**/trajectory:
  ros__parameters:
    line_sine: {{offset: {zeros}, amplitude: {sine}, frequency: {rate}, phase: {zeros}}}
"""

FRICTION = (
    'robot.friction=parameters',
    'robot.viscous_friction=[0.1, 0.1, 2.0, 40.0, 1.0, 0.6, 0.3]',
    'robot.coulomb_friction=[0.1, 0.1, 2.0, 20.0, 1.0, 0.5, 0.2]',
    'controller.switching=implicit',
    'controller.observer_gain=0',
)
"""Twice the friction that the controller assumes."""


@pytest.mark.slow
def test_tree_friction_rasmc_adapts_to_friction(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, hand_at_start(), 12.0)
    reached = {}
    for law in ('smc', 'rasmc'):
        simulation = Simulation(load_scenario(str(path), (*FRICTION, f'controller.law={law}')))
        parts = list(simulation.run())
        error = np.concatenate([part.error for part in parts])[6000:, :3]
        reached[law] = np.sqrt((error**2).sum(axis=1).mean())
        estimate = np.concatenate([part.estimate for part in parts])[:, -14:]
        assert (estimate >= 0.0).all()
        assert (estimate[-1] == estimate[0]).all() == (law == 'smc')
    assert reached['rasmc'] < 0.7 * reached['smc']


def _tree(draw: np.random.Generator, joints: int) -> str:
    """Return the URDF of a random tree with bodies of 0.5 to 2 kg."""

    def text(values: np.ndarray) -> str:
        return ' '.join(f'{value:.4f}' for value in values)

    parts = []
    for i in range(joints + 1):
        mass = draw.uniform(0.5, 2.0)
        x, y, z = mass * draw.uniform(0.03, 0.15, 3) ** 2
        centre, turned = draw.uniform(-0.15, 0.15, 3), draw.uniform(-3.0, 3.0, 3)
        parts.append(_LINK.format(i, text(centre), text(turned), mass, y + z, x + z, x + y))
        if i:
            parent, origin = draw.integers(max(0, i - 3), i), draw.uniform(-0.3, 0.3, 3)
            turned, axis = draw.uniform(-3.0, 3.0, 3), draw.normal(size=3)
            parts.append(_JOINT.format(i, parent, text(origin), text(turned), text(axis)))
    return f'<robot name="tree">{"".join(parts)}</robot>'


def _run(path: Path, law: str) -> tuple[float, float]:
    """Return RMS error and torque variation over the last two of three seconds."""
    simulation = Simulation(load_scenario(str(path), (f'controller.law={law}',)))
    parts = list(simulation.run())
    error = np.concatenate([part.error for part in parts])[100:]
    torque = np.concatenate([part.signals['torque'] for part in parts])[100:]
    return float(np.sqrt(np.mean(error**2))), float(np.abs(np.diff(torque, axis=0)).sum())


@pytest.mark.slow
@given(
    st.integers(0, 2**32 - 1), st.integers(2, 24), st.floats(-5.0, 1.0), st.floats(0.5, 1.0)
)
@settings(max_examples=25, deadline=None)
def test_tree_rasmc_any_gamma_does_not_chatter(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    joints: int,
    exponent: float,
    scale: float,
) -> None:
    """The step of the adaptation is bounded; without the bound many of these runs diverge."""
    folder, draw = tmp_path_factory.mktemp('tree'), np.random.default_rng(seed)
    (folder / 'tree.urdf').write_text(_tree(draw, joints), encoding='utf-8')
    text = _SCENARIO.format(
        urdf='tree.urdf',
        joints=[f'j{i}' for i in range(1, joints + 1)],
        gamma=10.0**exponent,
        scale=scale,
        zeros=[0.0] * joints,
        sine=draw.uniform(0.05, 0.3, joints).tolist(),
        rate=draw.uniform(1.0, 3.0, joints).tolist(),
    )
    path = folder / 'tree.yaml'
    path.write_text(text, encoding='utf-8')
    error, variation = _run(path, 'rasmc')
    constant_error, constant_variation = _run(path, 'smc')
    assert error < 4.0 * constant_error
    assert variation < 8.0 * constant_variation
