# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Simulation of a whole run of the closed loop, without ROS."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from masmc_ros.aliases import Array, Records
from masmc_ros.errors import InputError
from masmc_ros.jit.record import uninitialised
from masmc_ros.law.command_interface import check_agreement
from masmc_ros.loop.closed_loop import closed_loop
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_parameters import ACTIVE_ON_START, APPROACH_SPEED
from masmc_ros.loop.drive import Drive
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.signals import OF_PLANT
from masmc_ros.loop.simulated_robot import diverged, plant_of
from masmc_ros.loop.tick_block import Change, TickBlock
from masmc_ros.loop.timing import Timing
from masmc_ros.reference.approach import Approach
from masmc_ros.reference.sampled_trajectory import SampledTrajectory
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.robot import robot_of
import numpy as np

BLOCK = 20_000
"""Ticks in memory at a time."""


class Simulation:
    """Closed loop of one robot, trajectory and controller."""

    _is_timed = False

    def __init__(
        self,
        scenario: Scenario,
        changes: Sequence[Change] = (),
        samples: SampledTrajectory | None = None,
    ) -> None:
        """
        Initialise the closed loop; `active_on_start` determines if the controller starts active.

        Parameters
        ----------
        scenario
            Checked values of every node.
        changes
            Changes of controller and plant during the run, in the order of their ticks.
        samples
            Reference of the run; None for the trajectory of the scenario.

        Raises
        ------
        InputError
            If the values of the nodes do not match.

        """
        plant, control = scenario.plant, scenario.controller
        self._start, self._start_plant = control, plant
        self._plant_values = plant
        self._changes = tuple(changes)
        check_agreement(plant, control)
        self.timing = Timing.from_values(plant)
        self.plant = plant_of(plant, self.timing.period)
        self.controller = Controller(robot_of(control), self.timing.period, control)
        # The stamp of a simulated state is that of the tick at which it appears.
        self.controller.set_stamp_age(self.plant.delay)
        self._drive = self._new_drive()
        self.trajectory = samples or Trajectory(
            scenario.trajectory, self.timing.period, robot_of(scenario.trajectory)
        )

    def run(self, block: int = BLOCK) -> Iterator[TickBlock]:
        """
        Yield the run from its first to its last tick, `block` ticks at a time.

        Raises InputError for an endless run, a path out of reach and a run that diverges.
        """
        if self.timing.last is None:
            raise InputError('duration = 0.0: expected a length > 0 s for a simulation')
        self._plant_values = self._start_plant
        self.plant.reset()
        self.plant.change(self._plant_values)
        self.controller.change(self._start)
        self.controller.reset()
        self._drive = self._new_drive()
        ticks = self.timing.last + 1
        for first in range(0, ticks, block):
            count = min(block, ticks - first)
            reference = self.trajectory.sample(first, count)
            yield self._tick_block(first, reference, final=first + count == ticks)

    def _tick_block(self, first: int, reference: Array, *, final: bool) -> TickBlock:
        """Compute ticks, and apply the changes at them."""
        end = first + len(reference)
        changes = tuple(change for change in self._changes if first <= change.tick < end)
        pick_up = self.plant.pick_up
        edges = {first, end, *(change.tick for change in changes)}
        edges |= {pick_up} if first < pick_up < end else set()
        # All entries are written. Zeroed memory comes from the system page by page, which is slow.
        signals = uninitialised(len(reference), self.plant.signals)
        active, is_void = np.zeros((2, len(reference)), bool)
        is_finite = True
        contact = np.zeros((len(reference), len(self.plant.contact)))
        for start, stop in pairwise(sorted(edges)):
            if pick_up and start == pick_up:
                self.plant.take_payload()
            for change in changes:
                if change.tick == start:
                    self._make(change)
            rows = slice(start - first, stop - first)
            is_active = self._drive.is_active
            compiles = self.plant.is_compiled and self.controller.is_compiled
            advance = self._compiled if compiles and is_active else self._interpreted
            is_finite &= advance(
                start, reference[rows], signals[rows], contact[rows], final=final and stop == end
            )
            active[rows] = is_active
            is_void[rows] = not (is_active or self._drive.stop.commands)
        rates = self.controller.commands_rates
        tick_block = TickBlock(first, signals, active, is_void, rates, contact, changes)
        if not is_finite:
            self._check_finite(tick_block)
        return tick_block

    def _make(self, change: Change) -> None:
        if change.node == 'plant':
            self._plant_values = {**self._plant_values, **change.values}
            self.plant.change(self._plant_values)
            return
        if change.values:
            self.controller.change(change.values)
            self._drive.stop.change()
        if change.event:
            stamp = self.timing.stamp(change.tick)
            self._drive.apply(change.event, stamp, self.plant.position, self.plant.velocity)

    def _new_drive(self) -> Drive:
        approach = Approach(self.controller.robot, APPROACH_SPEED.of(self._start))
        is_active = ACTIVE_ON_START.of(self._start)
        return Drive(self.controller, approach, is_active=is_active, is_timed=self._is_timed)

    def _followed(self, first: int, reference: Array) -> Array:
        """
        Return the reference (n, 3 axes) that the law follows from tick `first`.

        An approach starts at the robot position and leads to `reference`.
        """
        approach = self._drive.approach
        if not approach.is_on:
            return reference
        followed = reference.copy()
        rates = self.controller.rates(self.plant.velocity)
        for k in range(len(reference)):
            stamp = self.timing.stamp(first + k)
            # An approach reads position and rates at its first tick, which is tick `first`.
            followed[k] = approach.follow(stamp, self.plant.position, rates, reference[k])
            if not approach.is_on:
                break
        return followed

    def _check_finite(self, tick_block: TickBlock) -> None:
        values = (tick_block.torque, tick_block.rates, tick_block.true_position)
        finite = np.isfinite(np.hstack(values)).all(axis=1)
        if not finite.all():
            tick = tick_block.first + int(np.argmin(finite))
            raise diverged(self.timing.time(tick))

    def _compiled(
        self, first: int, reference: Array, signals: Records, _: Array, *, final: bool
    ) -> bool:
        """Compute ticks in one call; return True if all commands and positions are finite."""
        plant, controller = self.plant, self.controller
        self._drive.start_tick(self.timing.stamp(first + len(reference) - 1))
        followed = self._followed(first, reference)
        is_finite: bool = closed_loop(
            plant.settings,
            plant.memory,
            plant.delayed,
            controller.settings,
            controller.memory,
            plant.signals,
            first,
            final,
            followed,
            signals,
        )
        plant.tick = first + len(followed)
        if followed is not reference:
            signals['reference'][:, :, 0] = reference
        return is_finite

    def _interpreted(
        self, first: int, reference: Array, signals: Records, contact: Array, *, final: bool
    ) -> bool:
        """Compute tick by tick, as the nodes do; return False, because nothing was checked."""
        plant = self.plant
        for k, row in enumerate(signals):
            command = self._respond(first + k, reference[k], signals[k:k + 1])
            row['reference'][:, 0] = reference[k]
            for name in OF_PLANT:
                row[name] = plant.signals[0][name]
            contact[k] = plant.contact
            if not (final and k == len(signals) - 1):
                plant.advance(command)
        return False

    def _respond(self, tick: int, reference: Array, signals: Records) -> Array | None:
        """Compute the signals of a tick, write them into a record (1), and return the command."""
        plant, controller, drive = self.plant, self.controller, self._drive
        state = self.timing.stamp(tick), plant.position, plant.velocity
        if drive.is_active:
            drive.skip_to(state[0])
            drive.compute(*state, reference)
            signals[0] = controller.signals[0]
        else:
            signals[0] = np.zeros((), signals.dtype)
            commands = drive.update_stop(*state)
            if commands:
                signals['torque'][0, :, 0] = controller.torque
            signals['estimate'][0, :, 0] = controller.estimate
            signals['error'], signals['surface'] = np.nan, np.nan
            if not commands:
                return None
        rates, torques = signals['rates'][0, :, 0], signals['torque'][0, :, 0]
        command: Array = np.where(plant.by_velocity, rates, torques)
        return command
