# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Variable structure control: switched feedback with gains proportional to the errors.

    tau = Y theta_hat + J' u,    u_i = -(alpha_i |e_i| + beta_i |edot_i| + k_i) sat(s_i / delta)

K.-K. D. Young, "Controller design for a manipulator using theory of variable structure systems",
IEEE Transactions on Systems, Man, and Cybernetics 8, 1978; reference [9] of the paper. Model
errors grow with the task errors, and so does the switched term; k is for the disturbance.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import gain, Memory
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.model import model_torque
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.reaching.reaching import BOUNDARY_LAYER
from masmc_ros.law.reaching.saturation import saturation
from masmc_ros.law.tick import Tick


class Settings(fields.Settings, group='variable_structure'):
    """Settings of the law."""

    variable_structure_alpha: Axes = gain(200.0, 'Gain alpha by |e|', 'N/m')
    variable_structure_beta: Axes = gain(100.0, 'Gain beta by |edot|', 'N·s/m')
    variable_structure_k: Axes = gain(120.0, 'Constant gain k', 'N')


@formula
def _switched(
    s: float, error: float, rate: float, alpha: float, beta: float, k: float, delta: float
) -> float:
    """Return u of one axis in N."""
    return -(alpha * abs(error) + beta * abs(rate) + k) * saturation(s, delta)


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    u = elementwise(
        _switched,
        tick.surface,
        tick.error,
        tick.error_rate,
        settings.variable_structure_alpha,
        settings.variable_structure_beta,
        settings.variable_structure_k,
        settings.boundary_layer,
    )
    return model_torque(tick, memory.estimate, u)


VARIABLE_STRUCTURE = Law(
    'variable_structure',
    torque,
    (*Settings, BOUNDARY_LAYER, SIGMA),
    post_update=project,
    summary='switched feedback whose gains are in proportion to the errors',
    source='[9] of the paper; Young 1978',
    uses_switching=False,
)
