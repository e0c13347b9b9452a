# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The `masmc` command, which starts its subcommands, and completes its words in a shell.

Completion is that of argcomplete, which the `ros2` command uses as well. The entry points of
`ros2 run masmc_ros NODE` call `masmc run NODE`.
"""

from __future__ import annotations

import argparse
import codecs
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
import errno
from functools import partial
from importlib import import_module
from io import TextIOWrapper
import os
import signal
import sys

from masmc_ros import __version__
from masmc_ros.cli.arguments import Parser
from masmc_ros.cli.commands.run import NODES, run_node
from masmc_ros.errors import remedy, UserError
from masmc_ros.files import scenarios
from masmc_ros.nodes.process.ending import Ended, ended_by_signals, final

COMMANDS = {
    'demo': "run the paper's experiment on real nodes and report it",
    'run': 'run a node if the ros2 command is not installed',
    'play': 'run a robot on a page with plots and sliders of its gains',
    'simulate': 'compute a run without ROS',
    'warm': 'compile the code of a robot and its laws in advance',
    'laws': 'list the control laws',
    'compare': 'compare control laws on one scenario',
    'sweep': 'run a scenario at all points of a grid of parameters',
    'monte-carlo': 'run a scenario with random parameters',
    'tune': 'search gains for a small error and small effort',
    'robot': 'print the robot of a parameter file',
    'preview': 'check a path against the limits of the robot',
    'recover': 'complete truncated or damaged logs',
    'param': 'read and set parameters of running nodes',
    'report': "write metrics, an interactive page and the paper's figures of logged runs",
    'excite': 'write a motion that excites the parameters of a robot',
    'identify': 'identify latency, friction and inertial parameters from a logged run',
    'view': 'show a logged run in Foxglove',
    'layout': 'write the layout for Foxglove with the plots of a robot',
    'library': 'write a controller as a C library for programs without Python',
    'page': 'write a page that computes runs in a browser',
    'export': 'write logged runs as tables or arrays',
}
"""Commands and their help; the module `masmc_ros.cli.commands.NAME` contains each, - as _."""

_REJECTED = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
"""Errors of standard output that is a file, a device, or a closed terminal."""

_RAW_BYTES = 'surrogateescape'
"""Error handler of standard output with LC_ALL=C: it writes bytes of file names unmodified."""

_ESCAPED = 'masmc_ros.escaped'
"""Error handler that also escapes characters the encoding lacks."""


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run `masmc`; return its exit status.

    Without `arguments` those of the process are used, which ends with this status.
    """
    is_process = arguments is None
    if is_process and '_ARGCOMPLETE' in os.environ:

        return _complete()
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    name = ' '.join(['masmc', *arguments[:1]])
    if is_process:
        prepare_streams()
    status = 0
    try:
        status = _run(name, arguments, restores_signals=not is_process)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        # The reader of the output has gone, as in `masmc ... | head`.
        _discard_output()
    except OSError as error:
        # Errors of files are reported by the code that writes them.
        if error.filename is not None or error.errno not in _REJECTED:
            raise
        _discard_output()
        status = status or _fail(f'{name}: cannot write to standard output: {error.strerror}')
    return final(status) if is_process else status


def prepare_streams() -> None:
    """Let standard output escape characters that its encoding lacks; open closed streams."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # Otherwise a file of results gets this number, and messages of libraries in it.
            os.open(os.devnull, os.O_RDWR)
    if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors in ('strict', _RAW_BYTES):
        # Greek letters, or file names that are no text, do not fit every encoding.
        codecs.register_error(_ESCAPED, _escaped)
        errors = _ESCAPED if sys.stdout.errors == _RAW_BYTES else 'backslashreplace'
        sys.stdout.reconfigure(errors=errors)


def _escaped(error: UnicodeError) -> tuple[str | bytes, int]:
    """Return the bytes of a file name that is no text, an escape of any other character."""
    try:
        return codecs.lookup_error(_RAW_BYTES)(error)
    except UnicodeError:
        return codecs.backslashreplace_errors(error)


def _run(name: str, arguments: list[str], *, restores_signals: bool) -> int:
    try:
        os.getcwd()
    except OSError as error:
        line = f'{name}: the working folder cannot be found: {error.strerror}; change to another'
        return _fail(line)
    if arguments[:1] == ['run'] and arguments[1:2] not in (['-h'], ['--help'], []):
        # All arguments after NODE are for the node, ROS arguments above all.
        return run_node(arguments[1], arguments[2:])
    try:
        with ended_by_signals(restores=restores_signals):
            parser = parser_for(arguments)
            if not arguments:
                parser.print_help()
                return 0
            options = parser.parse_args(arguments)
            status: int = options.run(options)
            return status
    except ModuleNotFoundError as missing:
        return _fail(f'{name}: {remedy(missing)}')
    except UserError as error:
        return _fail(f'{name}: {error}', error.exit_status)
    except Ended as end:
        reason = 'interrupted' if end.number == signal.SIGINT else f'ended by {end.name}'
        return _fail(f'{name}: {reason}', 128 + end.number)
    except SystemExit as end:  # argparse has printed the reason
        return int(end.code or 0)


def parser_for(arguments: Sequence[str]) -> Parser:
    """Return the parser; of the commands, only the one in `arguments` is imported."""
    parser = Parser(
        prog='masmc', description='Robust adaptive sliding mode control of mobile manipulators.'
    )
    parser.add_argument('--version', action='version', version=f'masmc {__version__}')
    commands = parser.add_subparsers(
        metavar='COMMAND', required=True, parser_class=Parser, title='commands'
    )
    for name, text in COMMANDS.items():
        command = commands.add_parser(name, help=text)
        if arguments[:1] == [name]:
            module = import_module(f'masmc_ros.cli.commands.{name.replace("-", "_")}')
            module.add_arguments(command)
            command.set_defaults(run=module.run)
    return parser


def _fail(line: str, status: int = 2) -> int:
    """Print a line to standard error, if possible, and return the status."""
    with suppress(OSError):
        print(line, file=sys.stderr, flush=True)
    return status


def _discard_output() -> None:
    """Discard output that standard output rejected, also when the interpreter ends."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complete() -> int:
    """
    Print completions of the words in the environment, and end the process.

    Without argcomplete in the environment of `masmc` this returns its exit status.
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


def _run_node(name: str) -> int:
    prepare_streams()
    return final(main(['run', name, *sys.argv[1:]]))


def __getattr__(name: str) -> Callable[[], int]:
    """Return the entry point of a node."""
    if name not in NODES:
        raise AttributeError(name)
    return partial(_run_node, name)


if __name__ == '__main__':
    sys.exit(main())
