# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robots: interface of a mechanism and built-in mechanisms."""
