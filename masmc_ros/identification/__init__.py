# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Identification of a robot from a logged run, and motions that excite its parameters."""
