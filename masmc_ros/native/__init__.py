# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Control laws as libraries for programs without Python."""
