# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parts of laws: surface, adaptation, limits, and the velocity estimator."""
