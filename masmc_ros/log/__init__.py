# SPDX-License-Identifier: Apache-2.0
"""What travels and what is kept: CDR messages, and runs in MCAP files; needs no ROS."""
