# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parts of every node and process: parameters, diagnostics, start and end."""
