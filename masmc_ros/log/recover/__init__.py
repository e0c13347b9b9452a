# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Completion of logs that were truncated or damaged."""
