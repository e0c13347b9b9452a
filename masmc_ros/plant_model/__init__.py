# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Model of the plant: motion of a mechanism, disturbances, drives and measured state."""
