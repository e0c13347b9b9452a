# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""State machine of the controller, without ROS: events in, actions out."""
