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

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from masmc_ros.aliases import Array, Flags, Integers, Records
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.signals import OF_PLANT
from masmc_ros.loop.simulation import BLOCK, Simulation
from masmc_ros.loop.tick_block import Change, TickBlock
from masmc_ros.reference.reference import SampledTrajectory
import numpy as np


class Responses(NamedTuple):
    """Responses of a controller to the states of a run."""

    computed: Flags
    """True for the ticks (n) at which it sent a command."""
    acting: Integers
    """Tick (n) whose command acts after each tick; -1 for none."""


class TimedSimulation(Simulation):
    """Closed loop whose controller responds to some states only, tick by tick."""

    _is_timed = True

    def __init__(
        self,
        scenario: Scenario,
        changes: Sequence[Change],
        samples: SampledTrajectory | None,
        responses: Responses,
    ) -> None:
        """
        Initialise the closed loop.

        Parameters
        ----------
        scenario, changes, samples
            As for a `Simulation`.
        responses
            Responses of the controller.

        """
        super().__init__(scenario, changes, samples)
        self._responses = responses
        self._sent: list[Array | None] = []
        # Signals of the tick before a block.
        self._held: Array = np.zeros((), self.plant.signals.dtype)

    def run(self, block: int = BLOCK) -> Iterator[TickBlock]:
        """Yield the run as `Simulation.run` does."""
        self._sent, self._held = [], np.zeros((), self.plant.signals.dtype)
        return super().run(block)

    def _compiled(
        self, first: int, reference: Array, signals: Records, contact: Array, *, final: bool
    ) -> bool:
        return self._interpreted(first, reference, signals, contact, final=final)

    def _interpreted(
        self, first: int, reference: Array, signals: Records, contact: Array, *, final: bool
    ) -> bool:
        plant = self.plant
        for k, row in enumerate(signals):
            tick = first + k
            command = None
            if self._responses.computed[tick]:
                command = self._respond(tick, reference[k], signals[k:k + 1])
            else:
                # The torque and the results of the last computed state are held.
                signals[k] = self._held if k == 0 else signals[k - 1]
            if not self._drive.is_active:
                row['reference'][:, 0] = reference[k]
            self._sent.append(command)
            for name in OF_PLANT:
                row[name] = plant.signals[0][name]
            contact[k] = plant.contact
            if not (final and k == len(signals) - 1):
                acting = self._responses.acting[tick]
                plant.advance(self._sent[acting] if acting >= 0 else None)
        self._held = signals[-1].copy()
        return False
