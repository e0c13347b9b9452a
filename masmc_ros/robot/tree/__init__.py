# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A tree of joints on a fixed, driving or sliding base: any robot of a URDF."""
