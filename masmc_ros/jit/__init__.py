# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Extensions of Numba: compiled formulas and kernels, and the vectors and records they work on."""
