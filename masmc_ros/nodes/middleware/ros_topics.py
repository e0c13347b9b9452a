# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Topics: quality of service, latched topics, past messages, and classes of message types.

Topics are always reliable, deep for publishers and recorder, shallow for control. States, commands
and the reference are transient-local. A node that joins late or restarts therefore continues at
the current tick. A subscription requests past messages only if it needs them. Messages that are
valid until the next one are `Latched`, telemetry is volatile.

ROS 2 needs the type support of a message package to create a publisher or a subscription, even
for raw bytes (ros2/rosidl_typesupport issue 18). Raw bytes need only the name and the hash of
the type. The classes of `raw_class` have a type support of these two, without code. They can be
removed when rclpy creates raw publishers and subscriptions from the name of a type.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import ctypes
from functools import cache
import importlib
import re
import time
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.messages.cdr_layout import definition
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.type_support import check_for_type_support
from std_msgs.msg import Empty

DEEP = 1000
"""Depth in messages of publishers and of the recorder's subscriptions."""


def publisher_qos(depth: int = DEEP, *, past: bool = True) -> QoSProfile:
    """Return the profile of publishers: reliable; with `past`, transient-local."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if past else DurabilityPolicy.VOLATILE,
    )


def subscription_qos(
    *, depth: int = 1, past: bool = False, best_effort: bool = False
) -> QoSProfile:
    """
    Return the profile of subscriptions: reliable; with `past`, transient-local.

    `best_effort` also matches publishers that are not reliable.
    """
    reliability = ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
    return QoSProfile(
        depth=depth,
        reliability=reliability,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if past else DurabilityPolicy.VOLATILE,
    )


_PATIENCE = 4.0
"""Time in s after which a subscription without a confirmation is considered dead.

Fast DDS repeats a lost message with its heartbeat, up to 3 s later.
"""

_NO_WAIT = Duration()


class Latched:
    """
    A publisher of depth 1 that loses no message to its current subscriptions.

    A late-joining subscription gets the last message only, all others every message. A
    transient-local publisher has one history for two purposes: past messages for late-joining
    subscriptions, and repetition of lost messages. A publisher of depth 1 drops a message that
    another one replaces, even if a subscription has not received it (ros2/rmw_fastrtps issue 338,
    "Reliable publisher/subscriber-connection drops messages in high frequency scenarios"). So this
    class sends the next message when all subscriptions have confirmed the last one. It can be
    removed when ROS 2 has a separate depth for past messages (the DDS policy DURABILITY_SERVICE).
    """

    def __init__(self, publisher: Publisher) -> None:
        """Initialise with a transient-local publisher of depth 1."""
        self._publisher = publisher
        self._waiting: deque[object] = deque()
        self._sent = -_PATIENCE
        self._is_confirmed = True

    @property
    def topic_name(self) -> str:
        """Full name of the topic."""
        return str(self._publisher.topic_name)

    def publish(self, message: object) -> None:
        """Send a message, or keep it until the previous one has arrived."""
        self._waiting.append(message)
        self.send_waiting()

    def send_waiting(self) -> None:
        """
        Send the next waiting messages if the last one has arrived; to be called periodically.

        A subscription without a confirmation delays the others once, not at every message.
        """
        while self._waiting and (self._has_arrived() or self._has_waited_enough()):
            self._publisher.publish(self._waiting.popleft())
            if self._is_confirmed:
                self._sent = time.monotonic()
            self._is_confirmed = False

    def wait_for_all_acked(self, timeout: Duration) -> bool:
        """Deliver all messages within a time; return True if all were confirmed."""
        limit = time.monotonic() + timeout.nanoseconds * 1e-9
        while True:
            left = max(0.0, limit - time.monotonic())
            self._is_confirmed = self._publisher.wait_for_all_acked(Duration(seconds=left))
            if not self._waiting:
                return self._is_confirmed
            self._publisher.publish(self._waiting.popleft())

    def _has_arrived(self) -> bool:
        self._is_confirmed = self._is_confirmed or self._publisher.wait_for_all_acked(_NO_WAIT)
        return self._is_confirmed

    def _has_waited_enough(self) -> bool:
        return time.monotonic() - self._sent > _PATIENCE


def subscribe(
    node: Node,
    message_type: type,
    topic: str,
    callback: Callable[..., None],
    depth: int = 1,
    on_matched: Callable[[], object] | None = None,
) -> None:
    """
    Subscribe raw to the new messages of all publishers of a topic.

    A reliable subscription does not match a best-effort publisher, such as a driver with the
    profile of sensor data. A best-effort one matches all publishers, but loses messages.
    When a best-effort publisher appears, a best-effort subscription replaces the reliable one.
    The parameters are those of `subscribe_with_past`.
    """
    subscriptions: list[object] = []

    def serve(*, best_effort: bool) -> None:
        position = len(subscriptions)

        def take(raw: bytes) -> None:
            # The best-effort subscription receives the messages of all publishers.
            if position == len(subscriptions) - 1:
                callback(raw)

        qos = subscription_qos(depth=depth, best_effort=best_effort)
        events = None if best_effort else _events(serve_best_effort, on_matched)
        subscriptions.append(
            node.create_subscription(
                message_type, topic, take, qos, raw=True, event_callbacks=events
            )
        )

    def serve_best_effort(_: object) -> None:
        if len(subscriptions) == 1:
            serve(best_effort=True)

    serve(best_effort=False)


def subscribe_with_past(
    node: Node,
    message_type: type,
    topic: str,
    callback: Callable[..., None],
    depth: int = 1,
    on_matched: Callable[[], object] | None = None,
) -> None:
    """
    Subscribe raw to a topic, with the past messages of its transient-local publishers.

    DDS does not match a transient-local subscription with a volatile publisher, not even for new
    messages (discussed in ros2/rclcpp pull request 2499). `DurabilityPolicy.BEST_AVAILABLE` of
    rclpy looks at the publishers once, when the subscription is created. This function can be
    removed when one subscription gets past messages from the publishers that have them, and new
    ones from all.

    When a volatile publisher appears, a second subscription, that of `subscribe`, serves it. A
    message that arrives at both is passed on once.

    Parameters
    ----------
    node
        Node that subscribes.
    message_type
        Class of the messages.
    topic
        Name of the topic.
    callback
        Function that is called with the bytes of each message.
    depth
        Number of messages that wait for the callback; newer ones replace the oldest.
    on_matched
        Function that is called when a publisher appears or disappears.

    """
    has_second = False
    duplicates = _DuplicateFilter(callback, 2 * DEEP)

    def on_past(raw: bytes) -> None:
        if has_second:
            duplicates.process(raw, duplicates.by_past, duplicates.by_volatile)
        else:
            callback(raw)

    def on_volatile(raw: bytes) -> None:
        duplicates.process(raw, duplicates.by_volatile, duplicates.by_past)

    def serve_volatile(_: object) -> None:
        nonlocal has_second
        if not has_second:
            has_second = True
            subscribe(node, message_type, topic, on_volatile, depth, on_matched)

    node.create_subscription(
        message_type,
        topic,
        on_past,
        subscription_qos(depth=depth, past=True),
        raw=True,
        event_callbacks=_events(serve_volatile, on_matched),
    )


def _events(
    incompatible_qos: Callable[[object], None], on_matched: Callable[[], object] | None
) -> SubscriptionEventCallbacks:
    def on_match(_: object) -> None:
        if on_matched is not None:
            on_matched()

    return SubscriptionEventCallbacks(
        incompatible_qos=incompatible_qos,
        matched=None if on_matched is None else on_match,
        use_default_callbacks=False,
    )


class _DuplicateFilter:
    """
    Filter that passes on each message of two subscriptions to one topic once.

    Messages of transient-local publishers arrive at both subscriptions, in any order. Those of
    volatile publishers arrive at the volatile one only. A copy is recognised by the hash of its
    bytes, which takes little memory for messages of any size. Of several equal messages, as many
    are passed on as one subscription has received at most.
    """

    def __init__(self, callback: Callable[..., None], capacity: int) -> None:
        self._callback = callback
        self._capacity = capacity
        self.by_past: dict[int, int] = {}
        """Numbers of messages without a copy so far, by hash, of the transient-local one."""
        self.by_volatile: dict[int, int] = {}

    def process(self, raw: bytes, own: dict[int, int], other: dict[int, int]) -> None:
        """Pass a message on unless it is the copy of one from the other subscription."""
        key = hash(raw)
        count = other.pop(key, 0)
        if count:
            if count > 1:
                other[key] = count - 1
            return
        own[key] = own.get(key, 0) + 1
        if len(own) > self._capacity:
            del own[next(iter(own))]
        self._callback(raw)


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
