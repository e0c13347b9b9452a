# SPDX-License-Identifier: Apache-2.0
"""All nodes of a run in one process."""
