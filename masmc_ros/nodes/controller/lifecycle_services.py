# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Services and topic of a managed node, for `ros2 lifecycle` and lifecycle managers.

The controller's core decides; `rclpy.lifecycle` is not used. Faults and services change the state
as well, which its state machine does not permit. In rclpy 7.1 an unavailable transition also
raises an exception that ends the node (ros2/rclpy issue 1209).
"""

from __future__ import annotations

from collections.abc import Callable

from lifecycle_msgs.msg import State, Transition, TransitionDescription, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from masmc_ros.control import supervisor
from masmc_ros.control.supervisor import LifecycleState, STATES, TRANSITIONS, transitions_from
from rclpy.node import Node
from rclpy.publisher import Publisher


class LifecycleServices:
    """Translation between the messages of lifecycle_msgs and the controller's core."""

    def __init__(
        self,
        node: Node,
        events: Publisher,
        current: Callable[[], LifecycleState],
        change: Callable[[int, str], bool],
    ) -> None:
        """
        Create the services.

        Parameters
        ----------
        node
            Node of the services.
        events
            Publisher of changes.
        current
            Function that returns the current state.
        change
            Function that performs a transition, identified by its number or its label. It
            returns False if the transition is not available.

        """
        self._node, self._events = node, events
        self._current, self._change = current, change
        self._published: LifecycleState | None = None
        node.create_service(ChangeState, '~/change_state', self._on_change)
        node.create_service(GetState, '~/get_state', self._on_state)
        node.create_service(GetAvailableStates, '~/get_available_states', self._on_states)
        node.create_service(
            GetAvailableTransitions, '~/get_available_transitions', self._on_transitions
        )
        node.create_service(GetAvailableTransitions, '~/get_transition_graph', self._on_graph)

    def publish(self, state: LifecycleState) -> None:
        """Publish a change of the state, if it is one."""
        start, self._published = self._published, state
        if start is None or start == state:
            return
        transition = next(t for t in TRANSITIONS if (t.start, t.goal) == (start, state))
        self._events.publish(
            TransitionEvent(
                timestamp=self._node.get_clock().now().nanoseconds,
                transition=Transition(id=transition.number, label=transition.label),
                start_state=_state(start),
                goal_state=_state(state),
            )
        )

    def _on_change(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        response.success = self._change(request.transition.id, request.transition.label)
        return response

    def _on_state(self, _: object, response: GetState.Response) -> GetState.Response:
        response.current_state = _state(self._current())
        return response

    def _on_states(
        self, _: object, response: GetAvailableStates.Response
    ) -> GetAvailableStates.Response:
        response.available_states = list(map(_state, STATES))
        return response

    def _on_transitions(
        self, _: object, response: GetAvailableTransitions.Response
    ) -> GetAvailableTransitions.Response:
        transitions = transitions_from(self._current())
        response.available_transitions = list(map(_description, transitions))
        return response

    def _on_graph(
        self, _: object, response: GetAvailableTransitions.Response
    ) -> GetAvailableTransitions.Response:
        response.available_transitions = list(map(_description, TRANSITIONS))
        return response


def _state(state: LifecycleState) -> State:
    return State(id=state.number, label=state.label)


def _description(transition: supervisor.Transition) -> TransitionDescription:
    return TransitionDescription(
        transition=Transition(id=transition.number, label=transition.label),
        start_state=_state(transition.start),
        goal_state=_state(transition.goal),
    )
