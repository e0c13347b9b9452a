# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Errors that the user can correct, each reported in one line."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class UserError(Exception):
    """
    Error that the user can correct, with the value, its place and the remedy.

    The message is one line: line breaks in quoted values become spaces. A command prints only
    the message and ends with `exit_status`.
    """

    exit_status = 2

    def __init__(self, message: str) -> None:
        """Initialise the error with one line from `message`."""
        super().__init__(' '.join(message.splitlines()))


class InputError(UserError):
    """Invalid file, parameter, option or name."""


def suggestion(word: str, known: Iterable[str]) -> str:
    """
    Return a suggestion for an unknown `word`.

    Parameters
    ----------
    word
        unknown name.
    known
        known names.

    Returns
    -------
        'did you mean A or B?' with the nearest names, 'known are A, B, C' if none is near,
        'none is known' without known names.

    """
    names = list(known)
    if not names:
        return 'none is known'
    near = get_close_matches(word, names, n=3)
    if near:
        return f'did you mean {" or ".join(near)}?'
    return f'known are {", ".join(names)}'
