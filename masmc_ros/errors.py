# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Errors that the user can correct, each reported in one line."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class UserError(Exception):
    """
    Something that the user can put right: what, where, and what would be right.

    The message is one line: line breaks in what it quotes become spaces. A command that
    meets this error prints the message alone and ends with `exit_status`.
    """

    exit_status = 2

    def __init__(self, message: str) -> None:
        """Make an error of one line from `message`."""
        super().__init__(' '.join(message.splitlines()))


class InputError(UserError):
    """A file, a parameter, an option or a name that cannot be used as it was given."""


def suggestion(word: str, known: Iterable[str]) -> str:
    """
    Return a suggestion for an unknown `word`.

    Parameters
    ----------
    word
        the name that is not known.
    known
        the names that are.

    Returns
    -------
        'did you mean A or B?' with the nearest names, 'known are A, B, C' where none is
        near, 'none is known' where there are no names at all.

    """
    names = list(known)
    if not names:
        return 'none is known'
    near = get_close_matches(word, names, n=3)
    if near:
        return f'did you mean {" or ".join(near)}?'
    return f'known are {", ".join(names)}'
