# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of all nodes: what each declares, and files that give them values; no ROS."""
