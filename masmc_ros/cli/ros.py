# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
