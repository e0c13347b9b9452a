# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Precompilation of kernels in the process that `forked` forks."""

from closed_loop_bits import scenarios
from scenario import tick_by_tick

tick_by_tick(scenarios(3)['everything on'])
