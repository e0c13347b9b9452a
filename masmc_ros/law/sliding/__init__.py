# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Sliding modes: surfaces, and gains that reach them."""
