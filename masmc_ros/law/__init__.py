# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Control laws, one file each: the sliding mode laws (13)-(23) in discrete time, and others.

No formula depends on the number of axes or parameters of the robot: it computes one axis or one
parameter, or accepts tuples of any length. `law.py` is the interface, `parts/` has common parts of
laws, and `reaching/` the reaching terms.
"""
