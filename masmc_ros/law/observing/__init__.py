# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Laws that find out what disturbs the robot, and cancel it."""
