# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What is kept: runs in MCAP files; needs no ROS."""
