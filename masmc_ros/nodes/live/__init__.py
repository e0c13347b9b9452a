# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The live node: a running robot in Foxglove."""
