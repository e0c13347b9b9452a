# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What every node and its process are made of."""
