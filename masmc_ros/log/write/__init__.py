# SPDX-License-Identifier: Apache-2.0
"""Writing runs into MCAP files, as they come or all at once."""
