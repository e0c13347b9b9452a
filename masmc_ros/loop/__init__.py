# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Sampled closed loop: control tick, plant tick, and runs that consist of them.

Ticks are k = 0 ... N at t_k = k T. The torque computed from the state at tick k is held until
tick k + 1. The nodes compute single ticks and the simulation whole runs, with the same compiled
code.
"""
