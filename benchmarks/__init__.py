# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Measurements of speed, as ratios within one run; `python -m benchmarks` prints them all."""
