# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Laws that estimate the disturbance of the robot and cancel it."""
