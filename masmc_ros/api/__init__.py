# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Python interface: single runs and campaigns in scripts and notebooks."""
