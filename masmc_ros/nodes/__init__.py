# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The ROS 2 nodes: plant, trajectory, controller and recorder, each thin around `loop/`."""
