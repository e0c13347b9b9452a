# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Message classes by type name, also for types that are not installed, and deserialisation.

ROS 2 needs the type support of a message package to create a publisher or a subscription, even
for raw bytes (ros2/rosidl_typesupport issue 18). Raw bytes need only the name and the hash of
the type. The classes of `raw_class` have a type support of these two, without code. They can be
removed when rclpy creates raw publishers and subscriptions from the name of a type.
"""

from __future__ import annotations

from collections.abc import Callable
import ctypes
from functools import cache
import importlib
import re
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.messages.cdr_layout import definition
from rclpy.serialization import deserialize_message
from rclpy.type_support import check_for_type_support
from std_msgs.msg import Empty

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


_HASH_SIZE = 32
_HASH_PREFIX = 'RIHS01_'

_FASTRTPS = b'rosidl_typesupport_fastrtps_c'
_ENCAPSULATION_SIZE = 4

_Pointer = ctypes.c_void_p
_Find = ctypes.CFUNCTYPE(_Pointer, _Pointer, ctypes.c_char_p)
_Get = ctypes.CFUNCTYPE(_Pointer, _Pointer)
_Size = ctypes.CFUNCTYPE(ctypes.c_uint32, _Pointer)
_MaximalSize = ctypes.CFUNCTYPE(ctypes.c_size_t, _Pointer)


class _TypeSupport(ctypes.Structure):
    """C structure `rosidl_message_type_support_t` of ROS 2 Jazzy."""

    _fields_ = (
        ('identifier', ctypes.c_char_p),
        ('data', _Pointer),
        ('find', _Find),
        ('type_hash', _Get),
        ('description', _Get),
        ('sources', _Get),
    )


class _Callbacks(ctypes.Structure):
    """message_type_support_callbacks_t of rosidl_typesupport_fastrtps."""

    _fields_ = (
        ('namespace', ctypes.c_char_p),
        ('name', ctypes.c_char_p),
        ('serialize', _Pointer),
        ('deserialize', _Pointer),
        ('size', _Size),
        ('maximal_size', _MaximalSize),
        ('keys', _Pointer),
    )


_alive: list[object] = []
"""Structures that the middleware may use until the process ends."""


def raw_class(type_name: str, type_hash: str | None = None) -> type:
    """
    Return a class for raw publishers and subscriptions of a type.

    Parameters
    ----------
    type_name
        Name such as `tf2_msgs/msg/TFMessage`.
    type_hash
        Hash of REP-2011, `RIHS01_...`, that the middleware announces; by default that of the
        type of this name in Jazzy.

    Returns
    -------
        The installed class of that name, otherwise one that supports raw bytes only.

    Raises
    ------
    InputError
        If the type is not installed and the middleware is not Fast DDS, or if Jazzy does not
        have the type and there is no hash.

    """
    try:
        return message_class(type_name)
    except InputError:
        return _raw_class(type_name, type_hash or definition(type_name).type_hash)


@cache
def _raw_class(type_name: str, type_hash: str) -> type:
    from rclpy.utilities import get_rmw_implementation_identifier

    middleware = get_rmw_implementation_identifier()
    if middleware != 'rmw_fastrtps_cpp':
        raise InputError(
            f'message type {type_name} is not installed; {middleware} requires its package'
        )
    package, _, name = type_name.split('/')
    support = _support(package, name, type_hash)
    capsule = _capsule(ctypes.addressof(support))
    # rclpy requires these entries of a message class, but uses only the type support.
    entries = dict.fromkeys(
        (
            '_CREATE_ROS_MESSAGE',
            '_CONVERT_FROM_PY',
            '_CONVERT_TO_PY',
            '_DESTROY_ROS_MESSAGE',
        ),
        capsule,
    )
    metaclass = type(f'Metaclass_{name}', (type,), {'_TYPE_SUPPORT': capsule, **entries})
    return metaclass(name, (), {'__slots__': ()})


def _support(package: str, name: str, type_hash: str) -> _TypeSupport:
    pointer = _pointer_of(Empty)
    other = _TypeSupport.from_address(pointer)

    def find(handle: int | None, identifier: bytes) -> int | None:
        """Return the type support of an identifier; that of Empty for kinds without raw use."""
        if identifier == _FASTRTPS:
            return ctypes.addressof(support)
        address: int | None = other.find(pointer, identifier)
        return address

    def maximal_size(bounds: int) -> int:
        # False: the size has no bound.
        ctypes.c_char.from_address(bounds).value = b'\0'
        return _ENCAPSULATION_SIZE

    digest = bytes(_HASH_SIZE)
    if type_hash.startswith(_HASH_PREFIX):
        digest = bytes.fromhex(type_hash.removeprefix(_HASH_PREFIX))
    hash_structure = (ctypes.c_uint8 * (1 + _HASH_SIZE))(1, *digest)
    callbacks = _Callbacks(
        f'{package}::msg'.encode(),
        name.encode(),
        None,
        None,
        _Size(lambda _: 0),
        _MaximalSize(maximal_size),
        None,
    )
    support = _TypeSupport(
        _FASTRTPS,
        ctypes.addressof(callbacks),
        _Find(find),
        _Get(lambda _: ctypes.addressof(hash_structure)),
        other.description,
        other.sources,
    )
    _alive.extend((hash_structure, callbacks, support))
    return support


def _pointer_of(message_type: Any) -> int:
    check_for_type_support(message_type)
    capsule = message_type.__class__._TYPE_SUPPORT
    get = _api('PyCapsule_GetPointer', _Pointer, ctypes.py_object, ctypes.c_char_p)
    pointer: int = get(capsule, None)
    return pointer


def _capsule(pointer: int) -> object:
    new = _api('PyCapsule_New', ctypes.py_object, _Pointer, ctypes.c_char_p, _Pointer)
    return new(pointer, None, None)


def _api(name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    return ctypes.PYFUNCTYPE(result, *arguments)((name, ctypes.pythonapi))
