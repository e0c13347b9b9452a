# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A custom metric: the energy that the drives take from the battery, for three gains."""

from __future__ import annotations

import masmc_ros as masmc
from masmc_ros.api.simulate import SimulatedRun
import numpy as np


def energy(run: SimulatedRun) -> float:
    """Return the energy in J of drives that do not recuperate: positive powers, summed."""
    joints = run.torque.shape[1]
    power = run.torque * run.velocity[:, -joints:]
    return float(np.trapezoid(np.maximum(power, 0.0).sum(axis=1), run.times))


if __name__ == '__main__':
    for k_s1 in (50.0, 100.0, 200.0):
        computed = masmc.simulate('paper', k_s1=k_s1)
        print(f'k_s1 = {k_s1:5.1f}: {energy(computed):.3f} J')
