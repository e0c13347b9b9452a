# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Commands that need ROS 2 say so where it is not installed."""

from __future__ import annotations

import importlib

from masmc_ros.errors import UserError


def require_rclpy() -> None:
    """Raise UserError with what to do where rclpy cannot be imported."""
    try:
        importlib.import_module('rclpy')
    except ImportError as error:
        raise UserError(
            f'rclpy cannot be imported ({error}); source a ROS 2 Jazzy installation, '
            "or install its wheels in a checkout with pip install '.[ros]' (Linux x86_64)"
        ) from error
