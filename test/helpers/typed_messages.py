# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages from YAML, as `ros2 topic pub` creates them, without ros2cli."""

from __future__ import annotations

import re
from typing import Any

from masmc_ros.nodes.middleware.ros_topics import message_class
import yaml


def typed_message(type_name: str, text: str) -> Any:
    """Return a message of a type such as `std_msgs/msg/String` with the fields of a YAML text."""
    message = message_class(type_name)()
    _set_fields(message, yaml.safe_load(text) or {})
    return message


def _set_fields(message: Any, values: dict[str, Any]) -> None:
    kinds = message.get_fields_and_field_types()
    for name, value in values.items():
        assert name in kinds, f'{type(message).__name__} has no field {name}'
        entry = re.fullmatch(r'sequence<(\w+)/(\w+)>', kinds[name])
        if entry is not None:
            parts = [message_class(f'{entry[1]}/msg/{entry[2]}')() for _ in value]
            for part, fields in zip(parts, value, strict=True):
                _set_fields(part, fields)
            setattr(message, name, parts)
        elif isinstance(value, dict):
            _set_fields(getattr(message, name), value)
        else:
            setattr(message, name, value)
