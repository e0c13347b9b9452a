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

"""
Messages from node to node within a process, as bytes, past the middleware.

Who publishes hands them to the others' inboxes, and the process's loop to their callbacks: in
the order of sending, one after the other, never from within `publish`. An inbox is as deep as
its subscription, and what was sent before comes to who asks for the past. To the middleware all
publishers and subscriptions are what they always were; it carries what comes from outside and
goes there, because it does not match the endpoints of one participant with each other (see
`transport.py`).
"""

from __future__ import annotations

from collections import deque
import time
from typing import Any

from masmc_ros.nodes.middleware.clock import clock_reader
from masmc_ros.nodes.middleware.publisher import ExchangePublisher
from masmc_ros.nodes.middleware.topic import Inbox, Take, Topic
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock

_LOG_TOPIC = '/rosout'


class Exchange:
    """The topics of one process."""

    def __init__(self) -> None:
        """Start without topics."""
        self._topics: dict[str, Topic] = {}
        self._due: deque[Inbox] = deque()

    def topic(self, name: str) -> Topic:
        """Return the topic of a full name."""
        return self._topics.setdefault(name, Topic(self._due))

    def deliver(self, seconds: float) -> bool:
        """
        Call whom messages wait for, for so long; tell whether more of them wait.

        What is sent meanwhile is delivered as well. Between two calls the executor has its
        turn: timers, services and what comes from outside.
        """
        due, limit = self._due, time.monotonic() + seconds
        while due and time.monotonic() < limit:
            due.popleft().take()
        return bool(due)


class ProcessContext(Context):
    """
    The context of the nodes of a process, who may share an exchange.

    Attributes
    ----------
    exchange
        None where the middleware carries all messages.
    log_node
        what hears of the log messages of this process's nodes; None without a need for it.

    """

    def __init__(self) -> None:
        """Start without an exchange."""
        super().__init__()
        self.exchange: Exchange | None = None
        self.log_node: Node | None = None

    def listener_of_logs(self, namespace: str) -> Node:
        """
        Return the node that subscribes to /rosout for the others.

        rcl publishes log messages itself, past every exchange, and the middleware keeps them
        from subscriptions of the same participant: this node has a participant of its own. It
        can go when rclpy lets a subscription choose whether to ignore its own process.
        """
        if self.log_node is None:
            apart = Context()
            apart.init(args=[], domain_id=self.get_domain_id())
            self.log_node = Node(
                'log_listener',
                context=apart,
                namespace=namespace,
                use_global_arguments=False,
                enable_rosout=False,
                start_parameter_services=False,
            )
        return self.log_node

    def try_shutdown(self) -> None:
        """Let go of the middleware."""
        if self.log_node is not None:
            self.log_node.destroy_node()
            self.log_node.context.try_shutdown()
        super().try_shutdown()


class ExchangeNode(Node):
    """A node whose publishers and subscriptions use the exchange of its process, if it has one."""

    def create_publisher(self, *arguments: Any, **options: Any) -> Any:
        """Create a publisher as `Node` does."""
        publisher: Any = super().create_publisher(
            *arguments, publisher_class=ExchangePublisher, **options
        )
        context = self.context
        if isinstance(context, ProcessContext) and context.exchange is not None:
            publisher.join(context.exchange.topic(publisher.topic_name))
        return publisher

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Take,
        *arguments: Any,
        raw: bool = False,
        **options: Any,
    ) -> Any:
        """Create a subscription as `Node` does; that of its time source reads checked times."""
        if msg_type is Clock and not raw:
            callback, raw = clock_reader(callback, self.get_logger()), True
        context = self.context
        create: Any = super().create_subscription
        if not isinstance(context, ProcessContext) or context.exchange is None:
            return create(msg_type, topic, callback, *arguments, raw=raw, **options)
        if topic == _LOG_TOPIC:
            create = context.listener_of_logs(self.get_namespace()).create_subscription
        subscription = create(msg_type, topic, callback, *arguments, raw=raw, **options)
        take = callback if raw else lambda data: callback(deserialize_message(data, msg_type))
        subscription.leave = context.exchange.topic(subscription.topic_name).listen(
            take, subscription.qos_profile
        )
        return subscription

    def destroy_subscription(self, subscription: Any) -> bool:
        """Destroy a subscription as `Node` does."""
        leave = getattr(subscription, 'leave', None)
        if leave is not None:
            leave()
        return bool(super().destroy_subscription(subscription))


def hears_logs(node: Node) -> bool:
    """Tell whether a node's subscription to /rosout has found the nodes of its own process."""
    context = node.context
    listener = context.log_node if isinstance(context, ProcessContext) else None
    here: int = node.count_publishers(_LOG_TOPIC)
    return listener is None or bool(listener.count_publishers(_LOG_TOPIC) >= here)
