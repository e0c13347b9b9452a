# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Supervision of libraries: the commands of the controller core, after every kind of event."""

from __future__ import annotations

from typing import Any

from helpers.core_loop import CoreLoop, node_values
from masmc_ros.control.gates import SECOND_LOOK
from masmc_ros.jit.compiled import interpreted
from masmc_ros.jit.record import fill
from masmc_ros.loop import supervision
from masmc_ros.loop.closed_loop import control_tick, NOT_FINITE
from masmc_ros.loop.controller import Controller
from masmc_ros.messages.stamps import state_timeout
import numpy as np
import pytest

REQUESTS = {
    150: supervision.DISABLE, 170: supervision.ENABLE, 200: supervision.STOP,
    220: supervision.CLEAR, 240: supervision.ENABLE, 355: supervision.ENABLE,
}  # fmt: skip
WITHOUT_STATE = {30, 31, 32, 64, *range(90, 130)}
WITHOUT_REFERENCE = range(260, 300)
WITH_NAN = 340
MODES = {'inactive': supervision.INACTIVE, 'active': supervision.ACTIVE,
         'fault': supervision.FAULT}  # fmt: skip


class Supervised:
    """Controller with the supervision of libraries."""

    def __init__(self, controller: Controller) -> None:
        """Initialise at the start of a run."""
        controller.reset()
        self.controller, self.initial = controller, controller.memory.copy()
        # The core looks twice for missing states, because its node may have been late.
        self.record = supervision.supervision_record(
            controller, state_timeout(controller.values) + SECOND_LOOK
        )

    def tick(self, stamp: int, now: int, *arrays: Any, has_reference: bool) -> int:
        controller, record = self.controller, self.record
        memory, signals = controller.memory, controller.signals
        with interpreted():
            computes = supervision.supervision_start(
                record, self.initial, controller.settings, memory, stamp, now, *arrays,
                has_reference,
            )  # fmt: skip
        status = 0
        if computes:
            followed = record['followed'][0, :, 0].copy()
            status = control_tick(controller.settings, memory, signals, *arrays[:2], followed)
        with interpreted():
            return supervision.supervision_end(
                record, controller.settings, memory, signals, status
            )

    @property
    def mode(self) -> int:
        return int(self.record['mode'][0, 0])

    @property
    def torque(self) -> np.ndarray:
        is_commanded = self.record['commands'][0, 0]
        return self.controller.torque if is_commanded else np.full(4, np.nan)


def request(loop: CoreLoop, number: int) -> None:
    """Call the service of a request, which the core processes without a new state."""
    core, now = loop.core, loop.now
    if number == supervision.STOP:
        loop.perform(core.on_stop(now))
    elif number == supervision.CLEAR:
        loop.perform(core.on_clear(now))
    else:
        loop.perform(core.on_enable(now, enabled=number == supervision.ENABLE))


@pytest.mark.parametrize(
    'control',
    [
        {},
        {'latency': 0.004, 'motor_lag': 0.001, 'velocity_source': 'estimated'},
        {'fault_action': 'gravity', 'torque_rate_limit': 500.0},
    ],
)
def test_supervision_commands_as_controller_core(control: dict[str, Any]) -> None:
    limits = {'reference_timeout': 0.105, 'state_timeout': 0.105, 'torque_limit': 40.0}
    values = node_values(controller={**limits, **control})
    loop, supervised = CoreLoop(values, ahead=0.02), Supervised(CoreLoop(values).controller)
    stamp, modes, statuses = -1, set(), 0
    nothing = np.zeros(len(loop.plant.position))
    for tick in range(400):
        if tick in REQUESTS:
            request(loop, REQUESTS[tick])
            supervised.record['request'] = REQUESTS[tick]
            supervised.tick(stamp, stamp, nothing, nothing, np.zeros(12), has_reference=False)
        for controller in (loop.controller, supervised.controller):
            gain = np.nan if tick == WITH_NAN else 100.0
            fill(controller.settings, 'k_s1', gain)
        now, state = loop.timing.stamp(tick), (loop.plant.position, loop.plant.velocity)
        position, velocity = (values.copy() for values in state)
        has_state = tick not in WITHOUT_STATE
        loop.step(has_state=has_state, has_reference=tick not in WITHOUT_REFERENCE)
        stamp = now if has_state else stamp
        statuses |= supervised.tick(
            stamp, now, position, velocity, loop.trajectory.sample(tick, 1)[0],
            has_reference=loop.core.reference.windows.at(now) is not None,
        )  # fmt: skip
        expected = np.full(4, np.nan) if loop.torque is None else loop.torque
        assert supervised.torque.tobytes() == expected.tobytes(), (tick, loop.state)
        assert supervised.mode == MODES[loop.state.partition(':')[0]], (tick, loop.state)
        modes.add(loop.state)
    assert statuses & NOT_FINITE
    assert len(modes) == 7, modes


def test_supervision_leaves_stretched_arm_as_core() -> None:
    plant = {'initial_joints': (0.0, 0.0, 0.7, 0.1)}
    values = node_values(plant=plant)
    loop, supervised = CoreLoop(values), Supervised(CoreLoop(values).controller)
    for tick in range(150):
        now = loop.timing.stamp(tick)
        position, velocity = loop.plant.position.copy(), loop.plant.velocity.copy()
        loop.step()
        supervised.tick(
            now, now, position, velocity, loop.trajectory.sample(tick, 1)[0], has_reference=True
        )
        assert supervised.torque.tobytes() == loop.torque.tobytes(), tick
    assert supervised.record['unfolded_by'] == 0
    assert abs(position[-1]) > 0.4


def test_supervision_state_of_nan_counts_as_missing() -> None:
    values = node_values()
    loop, supervised = CoreLoop(values), Supervised(CoreLoop(values).controller)
    state, reference = [loop.plant.position, loop.plant.velocity], loop.trajectory.sample(0, 1)[0]
    supervised.tick(0, 0, *state, reference, has_reference=True)
    torque = supervised.torque.copy()
    state[1] = np.full_like(state[1], np.nan)
    supervised.tick(10**7, 10**7, *state, reference, has_reference=True)
    assert (supervised.mode, supervised.torque.tobytes()) == (supervision.ACTIVE, torque.tobytes())
    supervised.tick(2 * 10**8, 2 * 10**8, *state, reference, has_reference=True)
    assert (supervised.mode, supervised.record['cause']) == (supervision.FAULT, supervision.STATES)
    supervised.tick(4 * 10**8, 4 * 10**8, *state, reference, has_reference=True)
    assert not supervised.controller.torque.any()
    assert not supervised.record['commands']
