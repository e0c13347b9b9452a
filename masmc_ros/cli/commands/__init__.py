# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Commands of `masmc`, one module each, with `add_arguments` and `run`."""
