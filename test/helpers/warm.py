# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Imported by the process that `forked` forks, in order that kernels have been called."""

from closed_loop_bits import scenarios
from scenario import tick_by_tick

tick_by_tick(scenarios(3)['everything on'])
