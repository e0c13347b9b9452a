# SPDX-License-Identifier: Apache-2.0
"""The controller as a node."""
