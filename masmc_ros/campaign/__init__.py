# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Campaigns: thousands of runs of a scenario, computed in lanes, and their dataset."""
