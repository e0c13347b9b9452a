# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Numerical foundations: compiled formulas, portable functions, tuples and records."""
