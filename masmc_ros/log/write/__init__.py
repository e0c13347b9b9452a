# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Writing runs into MCAP files, as they come or all at once."""
