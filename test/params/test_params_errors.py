# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Errors for users: one line with similar names."""

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError, suggestion, UserError
import pytest


@given(st.text())
def test_input_error_any_message_is_one_line(message: str) -> None:
    assert len(str(InputError(message)).splitlines()) <= 1


def test_input_error_is_user_error_with_exit_status_2() -> None:
    assert isinstance(InputError('x'), UserError)
    assert InputError.exit_status == 2


@pytest.mark.parametrize(
    ('word', 'known', 'expected'),
    [
        ('k_s', ['k_s1', 'k_s2', 'law'], 'did you mean k_s2 or k_s1?'),
        (
            'robot.wheel_radus',
            ['robot.wheel_radius', 'duration'],
            'did you mean robot.wheel_radius?',
        ),
        ('zzz', ['law', 'gamma'], 'known are law, gamma'),
        ('zzz', [], 'none is known'),
    ],
)
def test_suggestion_unknown_word_names_similar_words(
    word: str, known: list[str], expected: str
) -> None:
    assert suggestion(word, known) == expected
