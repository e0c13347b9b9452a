# SPDX-License-Identifier: Apache-2.0
"""How numbers are computed: compiled formulas, portable functions, tuples and records."""
