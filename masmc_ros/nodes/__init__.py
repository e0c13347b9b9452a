# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""ROS 2 nodes: plant, trajectory, controller, recorder and page."""
