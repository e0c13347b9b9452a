# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

from masmc_ros.api.campaigns import compare_laws as compare_laws
from masmc_ros.api.campaigns import monte_carlo as monte_carlo
from masmc_ros.api.campaigns import sweep as sweep
from masmc_ros.api.scenario import laws as laws
from masmc_ros.api.scenario import load as load
from masmc_ros.api.scenario import load_robot as load_robot
from masmc_ros.api.scenario import read as read
from masmc_ros.api.simulate import simulate as simulate
from masmc_ros.api.tuning import tune as tune

__version__: str
