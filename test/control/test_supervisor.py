# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""State machine that permits torque: random sequences of events, and the order of stamps."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.control.supervisor import Cause, Mode, Supervisor, would_follow
from masmc_ros.messages.stamps import in_time, Order, StampOrder, state_timeout
import numpy as np
import pytest

MS = 1_000_000
EVENTS = {
    'enable': lambda s: s.enable(),
    'disable': lambda s: s.disable(),
    'stop': lambda s: s.stop(),
    'clear': lambda s: s.clear(),
    'fail states': lambda s: s.fail(Cause.STATES, 'no states'),
    'fail reference': lambda s: s.fail(Cause.REFERENCE, f'{Cause.REFERENCE.value} for 1 s'),
    'fail law': lambda s: s.fail(Cause.LAW, 'not finite', is_latched=True),
    'recover states': lambda s: s.recover(Cause.STATES, is_restart=False),
    'recover reference': lambda s: s.recover(Cause.REFERENCE, is_restart=True),
    'configure': lambda s: s.configure(),
    'clean up': lambda s: s.clean_up(),
    'shut down': lambda s: s.shut_down(),
}


@given(st.booleans(), st.lists(st.sampled_from(sorted(EVENTS)), max_size=30))
def test_supervisor_text_shows_if_reference_is_followed(
    active: bool, events: list[str]
) -> None:
    supervisor = Supervisor(active=active)
    for event in events:
        EVENTS[event](supervisor)
        is_following = would_follow(supervisor.text)
        supervisor.recover(Cause.REFERENCE, is_restart=True)
        assert is_following == supervisor.is_active


@given(st.booleans(), st.lists(st.sampled_from(sorted(EVENTS)), max_size=30))
def test_supervisor_random_events_active_only_after_enable(
    active: bool, events: list[str]
) -> None:
    supervisor = Supervisor(active=active)
    is_blocked, is_released, is_over = not active, False, False
    for event in events:
        was_active, cause = supervisor.is_active, supervisor.cause
        activations = supervisor.activations
        EVENTS[event](supervisor)
        is_over |= event == 'shut down'
        is_released |= is_over or event == 'clean up'
        is_released &= is_over or event != 'configure'
        assert supervisor.is_configured != is_released
        # A stopped, disabled or never enabled controller becomes active only by `enable`.
        is_blocked |= event in ('stop', 'disable', 'fail law') or is_released
        is_blocked &= event != 'enable' or is_released
        if is_blocked:
            assert not supervisor.is_active
        if is_released:
            assert not supervisor.is_active
            assert not supervisor.is_fault
        elif event in ('enable', 'stop'):
            assert supervisor.mode is {'enable': Mode.ACTIVE, 'stop': Mode.FAULT}[event]
        if supervisor.is_active and not was_active:
            causes = {'recover states': Cause.STATES, 'recover reference': Cause.REFERENCE}
            assert event == 'enable' or causes[event] is cause
            assert (supervisor.activations > activations) == (event != 'recover states')
        else:
            assert supervisor.activations == activations
        assert supervisor.is_active == (supervisor.mode is Mode.ACTIVE)
        assert bool(supervisor.reason) == supervisor.is_fault
        assert (supervisor.cause is not None) == supervisor.is_fault


def test_supervisor_text_has_reason() -> None:
    supervisor = Supervisor(active=False)
    assert supervisor.text == 'inactive: not enabled yet'
    supervisor.enable()
    assert supervisor.text == 'active'
    supervisor.fail(Cause.STATES, 'no states for 0.1 s')
    assert supervisor.text == 'fault: no states for 0.1 s'
    supervisor.stop()
    assert supervisor.text == 'fault: emergency stop'
    assert not supervisor.fail(Cause.LAW, 'not finite', is_latched=True)
    assert supervisor.text == 'fault: emergency stop'
    assert supervisor.clear()
    assert supervisor.mode is Mode.CLEARED
    assert not supervisor.clear()


def judged(stamps: list[int], gap: int | None = 100) -> list[Order]:
    order = StampOrder()
    order.gap_ns = None if gap is None else gap * MS
    return [order.judge(stamp * MS) for stamp in stamps]


N, R, L, A, B = Order.NEXT, Order.REPEATED, Order.LATE, Order.AHEAD, Order.BACK


@pytest.mark.parametrize(
    ('stamps', 'expected'),
    [
        ([5, 6, 6, 7], [N, N, R, N]),
        ([5, 7, 6, 8], [N, N, L, N]),
        ([5, 7, 6, 6, 6, 6], [N, N, L, L, L, L]),
        ([50, 0, 1, 2, 3], [N, L, L, B, N]),
        ([500, 0, 1], [N, B, N]),
        ([0, 100, 201, 202], [N, N, A, N]),
        ([0, 10**6, 1, 2], [N, A, B, N]),
    ],
)
def test_stamp_order_real_time_judged(stamps: list[int], expected: list[Order]) -> None:
    assert judged(stamps) == expected


def test_in_time_drops_late_states_of_log() -> None:
    stamps = np.array([5, 7, 6, 8, 500, 20, 21]) * MS
    assert in_time(stamps, 100 * MS).tolist() == [0, 1, 3, 4, 5, 6]
    assert in_time(stamps, None).tolist() == list(range(7))


@pytest.mark.parametrize(('seconds', 'expected'), [(0.1, 0.1), (0.01, 0.05), (0.0, 0.05)])
def test_state_timeout_at_least_five_periods(seconds: float, expected: float) -> None:
    assert state_timeout({'state_timeout': seconds, 'control_period': 0.01}) == expected


def test_stamp_order_lockstep_older_stamp_is_reset() -> None:
    """Every state waits for its answer; therefore an older stamp means a reset of the robot."""
    assert judged([5, 6, 6, 5, 1000, 0], None) == [N, N, R, B, N, B]


@given(st.lists(st.integers(0, 10**7), min_size=1, max_size=40))
def test_stamp_order_answered_stamps_ascend_between_resets(stamps: list[int]) -> None:
    order = StampOrder()
    order.gap_ns = 100 * MS
    last = None
    for stamp in stamps:
        verdict = order.judge(stamp * MS)
        if verdict in (N, A):
            assert last is None or stamp > last
        elif verdict is B:
            assert stamp < last
        if verdict in (N, A, B):
            last = stamp
        assert order.last == last * MS
