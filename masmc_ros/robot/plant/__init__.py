# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The plant: how a mechanism really moves, what disturbs it, and how its state is measured."""
