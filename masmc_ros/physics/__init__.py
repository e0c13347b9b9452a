# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A plant whose wheels are in contact with the ground, moved by MuJoCo."""
