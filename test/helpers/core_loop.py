# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Closed loop of the controller's core and a simulated plant in virtual time, without ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from masmc_ros.control.actions import (
    Actions,
    Command,
    Failure,
    Finish,
    Halt,
    HaltCommand,
    State,
    StopCommand,
    Void,
)
from masmc_ros.control.controller_core import ControllerCore
from masmc_ros.control.layer_watch import LayerWatch
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.params.declaration import check_all
from masmc_ros.reference.approach import Approach
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.node_parameters import declared
import numpy as np


def node_values(
    shared: Mapping[str, Any] | None = None, **nodes: Mapping[str, Any]
) -> Scenario:
    """Return a scenario of plant, trajectory and controller; real time by default."""
    values = {'pacing': 'realtime', **(shared or {})}
    mechanism = mechanism_from(values)
    checked = {
        name: check_all(declared(name, mechanism), {**values, **nodes.get(name, {})})
        for name in ('plant', 'trajectory', 'controller')
    }
    return Scenario(**checked)


class CoreLoop:
    """
    Plant, trajectory and controller core of a scenario.

    Attributes
    ----------
    torque
        Torque in effect; None for a void command.
    state
        Text on `controller/state`.
    reports
        Every text of `controller/state` so far, with its time in s.
    drives
        Function from a command to the drives' torque (joints); the identity by default.

    """

    def __init__(self, scenario: Scenario, *, ahead: float = 1.0) -> None:
        """Initialise the loop of a scenario; `ahead` s of reference are sent."""
        control = scenario.controller
        self.timing = Timing.from_values(control)
        self.period = self.timing.period
        self.controller = Controller(robot_of(control), self.period, control)
        approach = Approach(self.controller.robot, control['approach_speed'])
        layer = LayerWatch(self.controller)
        self.core = ControllerCore(self.controller, approach, layer, self.timing, control)
        self.plant = plant_of(scenario.plant, self.period)
        self.controller.set_stamp_age(self.plant.delay)
        self.trajectory = Trajectory(
            scenario.trajectory, self.period, robot_of(scenario.trajectory)
        )
        self._ahead = max(1, round(ahead / self.period))
        self._sent = 0
        self.tick = 0
        self.torque: np.ndarray | None = None
        self.state, self.reports = '', []
        self.is_over = False
        self.drives: Callable[[np.ndarray], np.ndarray] = lambda torque: torque
        self.perform(self.core.start())

    @property
    def now(self) -> float:
        """Time in s."""
        return self.tick * self.period

    def perform(self, actions: Actions) -> None:
        """Apply the commands of an event."""
        for action in actions:
            kind = type(action)
            if kind in (Command, StopCommand, HaltCommand):
                self.torque = self.controller.torque.copy()
            elif kind in (Void, Halt):
                self.torque = None
            elif kind is State:
                self.state = action.text
                self.reports.append((self.now, action.text))
            elif kind in (Failure, Finish):
                self.is_over = True

    def send_reference(self) -> None:
        """Send the reference up to `ahead` s from now."""
        if self._sent < self.tick:
            self._sent = self.tick
        if self._sent < self.tick + self._ahead // 2:
            count = self.tick + self._ahead - self._sent
            samples = self.trajectory.sample(self._sent, count).reshape(count, 3, -1)
            stamp = self.timing.stamp(self._sent)
            self.perform(
                self.core.on_reference(ReferenceWindow(stamp, self.period, samples), self.now)
            )
            self._sent += count

    def step(self, *, has_state: bool = True, has_reference: bool = True) -> None:
        """Advance by one control period, with or without a state and a reference."""
        if has_reference:
            self.send_reference()
        if has_state:
            plant = self.plant
            stamp = self.timing.stamp(self.tick)
            self.perform(self.core.on_state(stamp, plant.position, plant.velocity, self.now))
        if self.core.deadline <= self.now:
            self.perform(self.core.on_timer(self.now))
        self.plant.advance(None if self.torque is None else self.drives(self.torque))
        self.tick += 1

    def run(self, seconds: float, **options: bool) -> dict[str, np.ndarray]:
        """Advance by a duration in s; return position, velocity and torque (n, …) by period."""
        signals: dict[str, list[np.ndarray]] = {'position': [], 'velocity': [], 'torque': []}
        joints = len(self.controller.torque)
        for _ in range(round(seconds / self.period)):
            self.step(**options)
            signals['position'].append(self.plant.true_position.copy())
            signals['velocity'].append(self.plant.true_velocity.copy())
            torque = np.full(joints, np.nan) if self.torque is None else self.torque
            signals['torque'].append(torque)
        return {name: np.array(rows) for name, rows in signals.items()}
