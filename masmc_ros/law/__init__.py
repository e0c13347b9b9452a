# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The control laws: the sliding mode laws (13)-(23), sampled, one file each.

Nothing here knows how many axes or parameters the robot has: formulas speak of one axis or
one parameter, or take tuples of any length. The contract is in `law.py`; the parts that laws
are made of are in `parts/`, the reaching terms in `reaching/`.
"""
