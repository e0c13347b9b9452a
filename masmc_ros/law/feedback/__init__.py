# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Feedback laws with a constant model: errors, and their integrals."""
