# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reference trajectories in task space, and windows of them in the controller."""
