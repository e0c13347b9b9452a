# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
What travels: the messages of the suite as raw CDR, and the topics that carry them; no ROS.

Fixed layouts that are filled, not serialised. Each class keeps its bytes where the numbers are
float64 views into them; `load` takes over a received message, or tells by False that it is of
another layout. For those, a full deserialiser makes a message that `load_message` or
`from_message` reads: joints by name, labels as they come.
"""
