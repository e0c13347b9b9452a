# SPDX-License-Identifier: Apache-2.0
"""Reaching terms u(s) of (15), one file each: the paper's sign, and what replaces it."""
