# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

from masmc_ros.api.campaigns import monte_carlo as monte_carlo
from masmc_ros.api.campaigns import sweep as sweep
from masmc_ros.api.simulate import simulate as simulate

__version__: str
