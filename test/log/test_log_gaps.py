# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Gaps of a log, counted by the stamps."""

from __future__ import annotations

from pathlib import Path
import random

from helpers.logged_runs import STATE
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.log.read.gaps import Gaps, gaps_in, state_gaps
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.joint_state import JointStateCdr
import numpy as np
import pytest

MS = 10**6


def test_gaps_steady_topic_has_none() -> None:
    assert gaps_in(range(0, 5000 * MS, MS)).missing == 0
    assert gaps_in(range(0, 100 * 20 * MS, 20 * MS)).count == 0


def test_gaps_every_missing_message_is_counted() -> None:
    rng = random.Random(3)
    stamps = list(range(0, 20_000 * MS, MS))
    holes = [(1, 13), (4000, 200), (4300, 1), (9990, 20), (19_000, 50)]
    missing = {stamps[first + n] for first, count in holes for n in range(count)}
    gaps = gaps_in([stamp for stamp in stamps if stamp not in missing])
    assert (gaps.count, gaps.missing) == (5, 284)
    assert (gaps.longest, gaps.at) == (201 * MS, 3999 * MS)
    assert gaps.text() == '284 missing in 5 gaps, the longest of 0.201 s from t = 3.999 s'
    few = rng.sample(range(1, 19_999), 40)
    thinned = gaps_in([stamp for n, stamp in enumerate(stamps) if n not in few])
    assert thinned.missing == 40


@pytest.mark.parametrize('pieces', [1, 7, 250, 5000])
def test_gaps_result_is_independent_of_evaluation_times(pieces: int) -> None:
    stamps = [n * MS for n in range(10_000) if not 3000 <= n < 3100]
    gaps = Gaps()
    for n, stamp in enumerate(stamps):
        gaps.add(stamp)
        if n % pieces == 0:
            gaps.look()
    gaps.look()
    assert (gaps.count, gaps.missing) == (1, 100)


def test_gaps_jitter_alternation_and_reset_are_none() -> None:
    in_turns = np.sort(np.concatenate([np.arange(0, 5000, 10), np.arange(1, 5000, 10)])) * MS
    assert gaps_in(in_turns).count == 0
    rng = np.random.default_rng(1)
    jittering = np.arange(0, 10_000, 2) * MS + rng.integers(-MS // 3, MS // 3, 5000)
    assert gaps_in(jittering).count == 0
    twice = [*range(0, 500 * MS, MS), *range(0, 500 * MS, MS)]
    assert gaps_in(twice).count == 0
    slower = [*range(0, 2000 * MS, MS), *range(2000 * MS, 60_000 * MS, 20 * MS)]
    assert gaps_in(slower).missing <= 1000


@given(st.sets(st.integers(1, 2900), max_size=30), st.integers(1, 4), st.booleans())
def test_gaps_overtaken_messages_are_not_missing(
    late: set[int], by: int, is_set_back: bool
) -> None:
    # The late stamps lie apart; otherwise they would look like a reset of the robot.
    places = {n for n in late if not any(n < other <= n + 10 for other in late)}
    key = [n + (by + 0.5) * (n in places) for n in range(3000)]
    once = [stamp * MS for stamp in sorted(range(3000), key=key.__getitem__)]
    stamps = once * 2 if is_set_back else once
    assert gaps_in(stamps).count == 0
    without = [stamp for stamp in stamps if stamp != 1500 * MS]
    assert gaps_in(without).missing == 1 + is_set_back


def test_gaps_too_few_messages_have_none() -> None:
    assert gaps_in([]).count == gaps_in([0]).count == gaps_in([0, MS, 900 * MS]).count == 0


def test_state_gaps_times_of_arrival_do_not_count(tmp_path: Path) -> None:
    """As in a log of `ros2 bag record`."""
    path, state = tmp_path / 'bag.mcap', JointStateCdr()
    arrival = 10**18
    with LogWriter(path) as log:
        states = log.channel('/joint_states', STATE)
        for tick in range(2000):
            if not 500 <= tick < 510:
                state.set_stamp(tick * MS)
                log.write(states, arrival, state.to_bytes())
            arrival += 3 * MS if tick % 20 == 0 else MS // 2
    [(topic, gaps)] = state_gaps(path).items()
    assert topic == '/joint_states'
    assert (gaps.count, gaps.missing, gaps.at) == (1, 10, 499 * MS)
