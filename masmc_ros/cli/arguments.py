# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parser of the command line, and arguments that several commands share.

`print_choices` prints the choices for a robot whose URDF alone is known.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
import math
import sys
from textwrap import fill
from typing import Any, NoReturn, TYPE_CHECKING

from masmc_ros.errors import suggestion
from masmc_ros.params.text import yaml_text

if TYPE_CHECKING:
    from masmc_ros.robot.tree.urdf_defaults import Defaults
    from masmc_ros.scenario.scenario import Source


class Parser(argparse.ArgumentParser):
    """Parser that reports an error of the command line in one line, with a suggestion."""

    def error(self, message: str) -> NoReturn:
        """End the process with one line."""
        see = ' See' if message.endswith('?') else '; see'
        self.exit(2, f'{self.prog}: {message}{see} {self.prog} --help\n')

    def parse_known_args(  # type: ignore[override]  # the library has an overload per namespace
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse; report the first unknown argument."""
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            known = [option for action in self._actions for option in action.option_strings]
            hint = suggestion(unknown[0].partition('=')[0], known)
            self.error(f"unknown argument '{unknown[0]}'; {hint}")
        return options, unknown

    def _check_value(self, action: argparse.Action, value: object) -> None:
        if action.choices is not None and value not in action.choices:
            hint = suggestion(str(value), map(str, action.choices))
            raise argparse.ArgumentError(action, f"'{value}' is unknown; {hint}")

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print; unlike the library, raise the error if that fails."""
        print(message, end='', file=file or sys.stderr)


def add_file(parser: argparse.ArgumentParser, alternative: str = '') -> None:
    """Add the parameter file, or an `alternative` to it."""
    text = 'ROS 2 parameter file, or the name of an installed one (masmc simulate --list)'
    parser.add_argument('file', help=text + alternative)


class _Path(argparse.Action):
    """Option that adds the settings of a path from a file."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        settings = 'trajectory.type=file', f'trajectory.file.path={yaml_text(values)}'
        namespace.set = [*namespace.set, *settings]


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add `--set`."""
    text = 'value of a parameter: NODE.parameter, or a shared one for all nodes; repeatable'
    parser.add_argument('--set', action='append', default=[], metavar='NAME=VALUE', help=text)


def add_path(parser: argparse.ArgumentParser) -> None:
    """Add `--path`, after `--set`."""
    text = 'file of the path to follow: CSV, Parquet or YAML'
    parser.add_argument('--path', action=_Path, metavar='FILE', help=text)


def add_logs(parser: argparse.ArgumentParser) -> None:
    """Add one or more logged runs."""
    parser.add_argument('logs', nargs='+', metavar='RUN.mcap', help='logged run')


def add_output(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add the output `folder`."""
    parser.add_argument('--output', default=folder, help='output folder (%(default)s)')


def add_overwrite(parser: argparse.ArgumentParser) -> None:
    """Add `--overwrite`."""
    parser.add_argument('--overwrite', action='store_true', help='replace existing files')


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add `--json`."""
    parser.add_argument('--json', action='store_true', help='print as JSON')


def add_seed(parser: argparse.ArgumentParser, subject: str) -> None:
    """Add `--seed` of the random numbers of a subject."""
    text = f'seed of {subject} (%(default)s)'
    parser.add_argument('--seed', type=whole, default=0, metavar='N', help=text)


def add_threads(parser: argparse.ArgumentParser) -> None:
    """Add `--threads`."""
    text = 'number of threads (one for each processor)'
    parser.add_argument('--threads', type=count, default=0, metavar='N', help=text)


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add `--threads` and `--scheduler`."""
    add_threads(parser)
    parser.add_argument(
        '--scheduler', default='', metavar='ADDRESS',
        help='address of a Dask scheduler whose workers compute, such as tcp://host:8786',
    )  # fmt: skip


def add_device(parser: argparse.ArgumentParser) -> None:
    """Add `--device`."""
    parser.add_argument(
        '--device', default='cpu', metavar='NAME',
        help='cuda: compute on a GPU, here or of each worker; experimental (%(default)s)',
    )  # fmt: skip


def count(text: str) -> int:
    """Return a whole number, at least 1."""
    number = whole(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"'{text}': expected a whole number >= 1")
    return number


def whole(text: str) -> int:
    """Return a whole number, at least 0."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}': expected a whole number >= 0")
    return int(text)


def positive(text: str) -> float:
    """Return a finite number > 0."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}': expected a number > 0")
    return number


_HEAD = 'chosen for the URDF; --set NAME=VALUE changes a value, masmc robot --write stores all:'


def choices_of(defaults: Defaults | None) -> list[dict[str, Any]]:
    """Return the choices as in `masmc robot --json`; none for a parameter file."""
    return [
        {'parameter': c.parameter, 'value': yaml_text(c.value), 'reason': c.reason}
        for c in (defaults.choices if defaults else ())
    ]


def choice_lines(choices: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a line for each choice: parameter, value, and reason."""
    from masmc_ros.result_text import WIDTH

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
