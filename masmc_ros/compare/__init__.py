# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Control laws side by side: contenders, what they are put through, and how they do."""
