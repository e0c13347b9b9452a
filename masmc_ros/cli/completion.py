# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Completion of `masmc` in a shell by argcomplete, which the `ros2` command uses as well."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
import os

from masmc_ros.cli.commands.run import NODES
from masmc_ros.share import scenarios


def complete(parser_for: Callable[[Sequence[str]], argparse.ArgumentParser]) -> int:
    """
    Print completions of the words in the environment, and end the process.

    Parameters
    ----------
    parser_for
        Function that returns the parser for the words after `masmc`.

    Returns
    -------
        Exit status without argcomplete in the environment of `masmc`.

    """
    try:
        import argcomplete
    except ModuleNotFoundError:
        return 1
    parser = parser_for(os.environ.get('COMP_LINE', '').split()[1:])
    files = argcomplete.FilesCompleter()

    def files_and_names(prefix: str, **arguments: object) -> Iterable[str]:
        return [*scenarios(), *files(prefix, **arguments)]

    # argparse does not declare the attribute that argcomplete reads.
    for action in _actions(parser):
        if action.dest == 'file':
            action.completer = files_and_names  # type: ignore[attr-defined]
        elif action.dest == 'node':
            action.completer = argcomplete.ChoicesCompleter(NODES)  # type: ignore[attr-defined]
    argcomplete.autocomplete(parser)
    return 1


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
