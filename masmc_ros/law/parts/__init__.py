# SPDX-License-Identifier: Apache-2.0
"""What laws are made of: surface, adaptation, limits, and the estimate of velocities."""
