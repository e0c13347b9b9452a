# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Plant: motion of a mechanism, disturbances, drives, and measurement of the state."""
