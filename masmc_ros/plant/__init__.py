# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated plant as a state machine, without ROS."""
