# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Checks of a log: it is complete, and every torque in it is finite and within its limits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Set
from pathlib import Path

from helpers.log_contents import LogContents, read_log
from masmc_ros.messages.commands import ArmVelocityCdr, EffortCdr, LabelledCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import text_of
from mcap.reader import make_reader
import numpy as np
from numpy.typing import NDArray

LIMIT = np.array([6.0, 6.0, 20.0, 10.0])
"""Limits in N·m of commanded and applied torques."""


def load_finite(command: LabelledCdr, raw: bytes) -> bool:
    """Read a command; False for another layout, AssertionError for numbers that are not finite."""
    if command.load(raw):
        return True
    layout = command.kind.layout_of(raw)
    if layout is not None and len(raw) == layout.size:
        (is_ours,), (record,) = layout.read([raw])
        assert not is_ours or np.isfinite(record['data']).all(), raw
    return False


def check_log(
    log: Path,
    *,
    states: list[str] | None = None,
    in_order: bool = True,
    limit: NDArray[np.float64] = LIMIT,
    injected: Set[bytes] = frozenset(),
) -> LogContents:
    """
    Check a complete log message by message, and return its contents.

    Every command must be finite and at most `limit` (4); every applied torque must be at most
    LIMIT. Messages that the test published are ignored: those in `injected`, and those whose
    layout differs from the nodes' own. The log must contain all `states` of the controller.
    They are `in_order` if one controller published them.
    """
    contents = read_log(log)
    statistics = contents.summary.statistics
    assert statistics is not None
    with log.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert sum(1 for _ in reader.iter_messages()) == statistics.message_count
    assert statistics.message_count == sum(map(len, contents.messages.values()))
    command, state = EffortCdr(), JointStateCdr()
    command_count = state_count = 0
    for raw in contents.messages['effort_commands']:
        if raw not in injected and load_finite(command, raw):
            command_count += 1
            assert np.all(np.abs(command.data) <= limit), (command.stamp_ns, command.data)
    rates = ArmVelocityCdr()
    for raw in contents.messages.get('arm_velocity_commands', ()):
        if raw not in injected and load_finite(rates, raw):
            command_count += 1
    for raw in contents.messages['joint_states']:
        if raw not in injected and state.load(raw):
            state_count += 1
            assert np.all(np.abs(state.effort[3:]) <= LIMIT), (state.stamp_ns, state.effort)
            assert np.all(np.isfinite(state.effort)), state.stamp_ns
    assert command_count, 'no commands in the log'
    assert state_count, 'no states in the log'
    if states is not None:
        recorded = [
            text_of(raw) for raw in contents.messages['controller/state'] if raw not in injected
        ]
        if in_order:
            assert recorded[: len(states)] == states
        else:
            assert Counter(recorded) >= Counter(states)
    return contents
