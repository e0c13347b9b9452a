# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Closed loop of a logged run in real time, computed again without a clock.

In real time the controller skips states that arrive late, and a command may act a period late. The
log determines both. As in the controller, a start, a resumption and a reference that steps are
approached, and the law accounts for skipped states. Not logged is the lateness by which a
controller with compensation of latency predicts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from masmc_ros.aliases import Array, Flags, Integers, Records
from masmc_ros.loop.controller_events import RESUMED
from masmc_ros.loop.signals import OF_PLANT
from masmc_ros.loop.simulation import BLOCK, Simulation
from masmc_ros.loop.tick_block import Change, TickBlock
from masmc_ros.params.declaration import Values
from masmc_ros.reference.sampled_trajectory import SampledTrajectory
import numpy as np


class Responses(NamedTuple):
    """Responses of a controller to the states of a run."""

    computed: Flags
    """True for the ticks (n) at which it sent a command."""
    acting: Integers
    """Tick (n) whose command acts after each tick; -1 for none."""


class TimedSimulation(Simulation):
    """Closed loop whose controller responds to some states only, tick by tick."""

    def __init__(
        self,
        values: Mapping[str, Values],
        changes: Sequence[Change],
        samples: SampledTrajectory | None,
        responses: Responses,
    ) -> None:
        """
        Initialise the closed loop.

        Parameters
        ----------
        values, changes, samples
            As for a `Simulation`.
        responses
            Responses of the controller.

        """
        control = {**values['controller'], 'approach_on_start': True}
        super().__init__({**values, 'controller': control}, changes, samples)
        self._responses = responses
        self._last: int | None = None
        self._sent: list[Array | None] = []

    def run(self, block: int = BLOCK) -> Iterator[TickBlock]:
        """Yield the run as `Simulation.run` does."""
        self._last, self._sent = None, []
        return super().run(block)

    def _make(self, change: Change) -> None:
        super()._make(change)
        if change.event == RESUMED:
            self._start_approach()

    def _followed(self, first: int, reference: Array) -> Array:
        return reference

    def _compiled(
        self, first: int, followed: Array, signals: Records, contact: Array, *, final: bool
    ) -> bool:
        return self._interpreted(first, followed, signals, contact, final=final)

    def _interpreted(
        self, first: int, followed: Array, signals: Records, contact: Array, *, final: bool
    ) -> bool:
        plant = self.plant
        for k, row in enumerate(signals):
            tick = first + k
            command = None
            if self._responses.computed[tick]:
                command = self._respond(tick, followed[k], signals[k:k + 1])
            elif k:
                # The torque and the results of the last computed state are held.
                signals[k] = signals[k - 1]
            self._sent.append(command)
            for name in OF_PLANT:
                row[name] = plant.signals[0][name]
            contact[k] = plant.contact
            if not (final and k == len(signals) - 1):
                acting = self._responses.acting[tick]
                plant.advance(self._sent[acting] if acting >= 0 else None)
        return False

    def _respond(self, tick: int, reference: Array, signals: Records) -> Array | None:
        """Compute the signals of a tick, write them into a record (1), and return the command."""
        plant, controller, stamp = self.plant, self.controller, self.timing.stamp(tick)
        if not self._is_active:
            self._last = None
            signals[0] = np.zeros((), signals.dtype)
            commands = self._stop.update(stamp, plant.position, plant.velocity)
            if commands:
                signals['torque'][0, :, 0] = controller.torque
            signals['estimate'][0, :, 0] = controller.estimate
            signals['error'], signals['surface'] = np.nan, np.nan
        else:
            if self._last is not None and tick > self._last + 1:
                controller.skip(tick - self._last - 1)
            self._last, commands = tick, True
            approach = self._approach
            assert approach is not None
            approach.watch(stamp, reference)
            if approach.is_on:
                rates = controller.rates(plant.velocity)
                reference = approach.follow(stamp, plant.position, rates, reference)
            controller.tick(plant.position, plant.velocity, reference)
            signals[0] = controller.signals[0]
        if not commands:
            return None
        rates, torques = signals['rates'][0, :, 0], signals['torque'][0, :, 0]
        command: Array = np.where(plant.by_velocity, rates, torques)
        return command
