# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Task of a tree: outputs of its frames and joints, and its null space."""
