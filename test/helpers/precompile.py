# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Precompilation of kernels in the process that `command_process` forks."""

from helpers.closed_loop_bits import scenarios
from helpers.scenario import tick_by_tick

tick_by_tick(scenarios(3)['everything on'])
