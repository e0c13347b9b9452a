# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Message classes by type name, and deserialisation of received messages."""

from __future__ import annotations

import importlib
import re
from typing import Any

from masmc_ros.errors import InputError
from rclpy.serialization import deserialize_message

_TYPE_NAME = re.compile(r'[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*', re.ASCII)


def message_class(type_name: str) -> type:
    """
    Return the class of a message type such as `std_msgs/msg/String`.

    Raises InputError if the type is not installed.
    """
    if _TYPE_NAME.fullmatch(type_name) is None:
        raise InputError(f"'{type_name}' is not a message type; expected PACKAGE/msg/NAME")
    package, _, name = type_name.split('/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError):
        raise InputError(f'message type {type_name} is not installed') from None


def deserialized(raw: bytes, message_type: type) -> Any:
    """
    Return the message of received bytes.

    Raises InputError if they are not a message of this type.
    """
    try:
        return deserialize_message(raw, message_type)
    except Exception as error:
        raise InputError(f'{len(raw)} bytes that are no {message_type.__name__}') from error
