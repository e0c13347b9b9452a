# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The play node: a running robot on a page, with its gains."""
