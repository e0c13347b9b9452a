# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Benchmarks of speed, as ratios within one run; `python -m benchmarks` prints all of them."""
