# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The sampled closed loop: control tick, plant tick and the run made of them.

Ticks k = 0 ... N, t_k = k T. At tick k the state is taken as exact, the torque is held until
tick k + 1. The same compiled code serves the nodes, one tick at a time, and the simulation
of a whole run.
"""
