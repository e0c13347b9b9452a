# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Messages of the suite as raw CDR, and their topics, without ROS.

The messages have fixed layouts and are filled in place instead of serialised: numbers are float64
views into the bytes. `load` reads a received message and returns False for another layout. Such
messages are deserialised by rclpy for `load_message` or `from_message`, which read joints by name
and accept any labels.
"""
