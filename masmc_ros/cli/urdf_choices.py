# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Output of the choices for a robot whose URDF alone is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import sys
from textwrap import fill
from typing import Any, TYPE_CHECKING

from masmc_ros.params.text import yaml_text
from masmc_ros.result_text import WIDTH
from masmc_ros.scenario.scenario import Source

if TYPE_CHECKING:
    from masmc_ros.robot.tree.urdf_defaults import Defaults

_HEAD = 'chosen for the URDF; --set NAME=VALUE changes a value, masmc robot --write stores all:'


def choices_of(defaults: Defaults | None) -> list[dict[str, Any]]:
    """Return the choices as in `masmc robot --json`; none for a parameter file."""
    return [
        {'parameter': c.parameter, 'value': yaml_text(c.value), 'reason': c.reason}
        for c in (defaults.choices if defaults else ())
    ]


def choice_lines(choices: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a line for each choice: parameter, value, and reason."""
    lines = [
        f'{choice["parameter"]} = {choice["value"]}: {choice["reason"]}' for choice in choices
    ]
    return [_HEAD, *(
        fill(line, WIDTH, initial_indent='  ', subsequent_indent='    ', break_on_hyphens=False)
        for line in lines
    )] if lines else []  # fmt: skip


def print_choices(source: Source) -> None:
    """Print the choices for a URDF on standard error; nothing for a parameter file."""
    defaults = source.defaults
    if defaults is None:
        return
    for line in choice_lines(choices_of(defaults)):
        print(line, file=sys.stderr)
    for note in defaults.notes:
        print(f'warning: {note}', file=sys.stderr)
