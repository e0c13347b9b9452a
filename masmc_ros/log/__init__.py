# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Logs of runs in MCAP files, without ROS."""
