# SPDX-License-Identifier: Apache-2.0
"""Reading runs from MCAP files."""
