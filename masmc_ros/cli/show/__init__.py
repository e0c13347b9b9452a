# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Commands that show what there is: laws, a robot, a logged run in Foxglove."""
