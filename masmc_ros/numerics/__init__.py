# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Functions of numbers that are bitwise identical on every machine."""
