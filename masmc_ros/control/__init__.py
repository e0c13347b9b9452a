# SPDX-License-Identifier: Apache-2.0
"""The sliding mode laws (13)-(23), sampled: surface, reaching terms, adaptation.

Nothing here knows how many axes or parameters the robot has: formulas speak of one axis or
one parameter, and what couples the axes (the implicit reaching law) takes their number.
"""
