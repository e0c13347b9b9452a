# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robust adaptive sliding mode control of mobile manipulators for ROS 2."""

__version__ = '0.1.0'
