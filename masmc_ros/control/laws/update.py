# SPDX-License-Identifier: Apache-2.0
"""The built-in laws as compiled code selects them."""

from __future__ import annotations

from masmc_ros.compiled import formula
from masmc_ros.control.laws import rasmc, smc

BUILT_IN = ('smc', 'rasmc')
"""Names of the built-in laws; compiled code knows them by their position here."""

SMC, RASMC = range(len(BUILT_IN))


@formula
def updated_estimate(
    law: int,
    estimate: float,
    nominal: float,
    gradient: float,
    gamma: float,
    period: float,
    rate: float,
) -> float:
    """Return the next estimate of one parameter under the law at this position."""
    if law == RASMC:
        return rasmc.update(estimate, nominal, gradient, gamma, period, rate)
    return smc.update(estimate, nominal, gradient, gamma, period, rate)
