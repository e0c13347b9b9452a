# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""All nodes of a run in one process."""
