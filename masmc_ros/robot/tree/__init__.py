# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trees of joints on a fixed, differential or omnidirectional base, from a URDF."""
