# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Laws of feedback alone: the model as it is, errors, and their integrals."""
