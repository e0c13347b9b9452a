# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reaching terms u(s) of (15), one file each: the sign of the paper, and alternatives."""
