# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robots: the contract of a mechanism, its instances, and the simulated plant of any."""
