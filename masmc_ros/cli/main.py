# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The `masmc` command and its subcommands."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import suppress
import errno
import os
import signal
import sys
from typing import Any, NoReturn

from masmc_ros import __version__
from masmc_ros.cli.endings import Ended, ended_by_signals, final
from masmc_ros.cli.param import add_arguments as add_param_arguments
from masmc_ros.errors import suggestion, UserError
from masmc_ros.optional import explained
from masmc_ros.share import scenarios

_NOT_TAKEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
"""Errors of standard output that is a file, a device, or a closed terminal."""


class _Parser(argparse.ArgumentParser):
    """Prints one line about an error of the command line, with a suggestion."""

    def error(self, message: str) -> NoReturn:
        see = ' See' if message.endswith('?') else '; see'
        self.exit(2, f'{self.prog}: {message}{see} {self.prog} --help\n')

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            options = [option for action in self._actions for option in action.option_strings]
            hint = suggestion(unknown[0].partition('=')[0], options)
            self.error(f"unknown argument '{unknown[0]}'; {hint}")
        return found, unknown

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            hint = suggestion(str(value), map(str, action.choices))
            raise argparse.ArgumentError(action, f"'{value}' is unknown; {hint}")

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print; unlike the library, do not keep quiet where that fails."""
        print(message, end='', file=file or sys.stderr)


def _add_settings(parser: argparse.ArgumentParser, what: str = 'as in masmc simulate') -> None:
    parser.add_argument('--set', action='append', default=[], metavar='NAME=VALUE', help=what)


def _add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--json', action='store_true', help='print as JSON')


def _count(text: str) -> int:
    """Return a number of things, at least one."""
    number = int(text) if text.isdecimal() else 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"'{text}': expected a whole number from 1 on")
    return number


class _ListScenarios(argparse.Action):
    """Lists the installed parameter files, and is done."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        for name, path in scenarios().items():
            print(f'{name}  {path}')
        parser.exit()


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run `masmc`; return its exit status.

    Without `arguments` those of the process are used, which ends with this status.
    """
    is_process = arguments is None
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    name = ' '.join(['masmc', *arguments[:1]])
    status = 0
    try:
        status = _run(name, arguments, restores_signals=not is_process)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        # The reader of our output has gone, as in `masmc ... | head`.
        _let_go_of_output()
    except OSError as error:
        # Errors of files are reported by the code that writes them.
        if error.filename is not None or error.errno not in _NOT_TAKEN:
            raise
        _let_go_of_output()
        status = status or _tell(f'{name}: cannot write to standard output: {error.strerror}')
    return final(status) if is_process else status


def _run(name: str, arguments: list[str], *, restores_signals: bool) -> int:
    if arguments[:1] == ['run'] and arguments[1:2] not in (['-h'], ['--help'], []):
        # All that follows NODE is for the node, ROS arguments above all.
        from masmc_ros.cli.run import run_node

        return run_node(arguments[1], arguments[2:])
    try:
        with ended_by_signals(restores=restores_signals):
            options = _parser().parse_args(arguments)
            name = f'masmc {options.command}'
            return _dispatch(options)
    except ModuleNotFoundError as missing:
        return _tell(f'{name}: {explained(missing)}')
    except UserError as error:
        return _tell(f'{name}: {error}', error.exit_status)
    except Ended as end:
        how = 'interrupted' if end.number == signal.SIGINT else f'ended by {end.name}'
        return _tell(f'{name}: {how}', 128 + end.number)
    except SystemExit as end:  # argparse has printed the reason
        return int(end.code or 0)


def _tell(line: str, status: int = 2) -> int:
    """Print a line where errors go, if that can be, and return the status."""
    with suppress(OSError):
        print(line, file=sys.stderr, flush=True)
    return status


def _let_go_of_output() -> None:
    """Let what standard output does not take go nowhere, when the interpreter ends too."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _dispatch(options: argparse.Namespace) -> int:
    """Import and run one subcommand: each pays for its own imports only."""
    if options.command == 'simulate':
        from masmc_ros.cli.simulate import simulate

        return simulate(options.file, options.set, options.output, overwrite=options.overwrite)
    if options.command == 'compare':
        from masmc_ros.cli.compare import compare

        return compare(
            options.file,
            laws=options.laws,
            trials=options.trials,
            seeds=options.seeds,
            settings=options.set,
            output=options.output,
            as_data=options.json,
        )
    if options.command == 'laws':
        from masmc_ros.cli.show.laws import laws

        return laws(costs=options.cost, as_data=options.json)
    if options.command == 'robot':
        from masmc_ros.cli.show.robot import robot

        return robot(options.file, options.set, as_data=options.json)
    if options.command == 'report':
        from masmc_ros.cli.report import report

        report(options.logs, options.output)
        return 0
    if options.command == 'recover':
        from masmc_ros.cli.recover import recover

        return recover(options.logs)
    if options.command == 'view':
        from masmc_ros.cli.show.view import view

        return view(options.log, options.port)
    if options.command == 'layout':
        from masmc_ros.cli.show.layout import layout

        return layout(options.source, options.output)
    if options.command == 'param':
        from masmc_ros.cli.param import param

        return param(options)
    if options.command == 'export':
        from masmc_ros.cli.export import export

        return export(
            options.logs, options.output, options.format, overwrite=options.overwrite
        )
    from masmc_ros.cli.demo import demo

    return demo(options.output, robot=options.robot, composed=options.composed)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog='masmc',
        description='Robust adaptive sliding mode control of mobile manipulators.',
    )
    parser.add_argument('--version', action='version', version=f'masmc {__version__}')
    commands = parser.add_subparsers(dest='command', required=True, parser_class=_Parser)

    demo = commands.add_parser(
        'demo',
        help="run the paper's experiment on real nodes and report it",
        description="Run the paper's experiment: four ROS 2 nodes in lock-step on a private "
        'domain of this machine, with smc, rasmc, and rasmc with the implicit switching term and '
        'a disturbance estimate; log the runs and report them. With --robot those of another '
        'experiment.',
    )
    demo.add_argument('--output', default='demo', help='folder for logs and report (%(default)s)')
    demo.add_argument(
        '--robot',
        default='paper',
        metavar='NAME',
        help='whose experiment: an installed parameter file (masmc simulate --list), such as '
        'tiago (%(default)s)',
    )
    demo.add_argument(
        '--composed', action='store_true', help='all nodes of a run in one process'
    )

    run = commands.add_parser(
        'run',
        help='run a node where the ros2 command is not installed',
        description='Run a node as `ros2 run masmc_ros NODE` would.',
    )
    run.add_argument('node', help='plant, trajectory, controller, recorder, live or composed')
    run.add_argument('arguments', nargs=argparse.REMAINDER, help='--ros-args ...')

    simulate = commands.add_parser(
        'simulate',
        help='compute a run without ROS',
        description='Compute the closed loop of a parameter file: the same bits as the nodes. '
        'Or compute the run of a log again, and compare.',
    )
    simulate.add_argument(
        'file', help='ROS 2 parameter file, the name of an installed one, or the log of a run'
    )
    simulate.add_argument(
        '--list', action=_ListScenarios, nargs=0, help='list the installed parameter files'
    )
    _add_settings(
        simulate, 'set a parameter: NODE.parameter, or a shared one for every node; repeatable'
    )
    simulate.add_argument('--output', metavar='RUN.mcap', help='log the run into this file')
    simulate.add_argument(
        '--overwrite', action='store_true', help='replace the output file if it is there'
    )

    laws = commands.add_parser(
        'laws',
        help='list the control laws',
        description='List the control laws that `law` chooses among, with their sources.',
    )
    laws.add_argument(
        '--cost', action='store_true', help='measure what a tick of each costs here'
    )
    _add_json(laws)

    compare = commands.add_parser(
        'compare',
        help='control laws side by side on one scenario',
        description='Run laws on the same scenario and seeds: ranked by error, with effort and '
        'chattering, and what breaks which: noise, delay, 100 Hz, a wrong model, limits.',
    )
    compare.add_argument('file', help='ROS 2 parameter file, or the name of an installed one')
    compare.add_argument(
        '--laws',
        default='all',
        metavar='LAW,...',
        help='LAW or LAW:SWITCHING, separated by commas; or all (%(default)s)',
    )
    compare.add_argument(
        '--trials',
        default='all',
        metavar='TRIAL,...',
        help='trials in addition to the unmodified scenario (%(default)s)',
    )
    compare.add_argument(
        '--seeds',
        type=_count,
        default=1,
        metavar='N',
        help='runs of each: seed 0 is the scenario, others draw robot, disturbance and noise '
        '(%(default)s)',
    )
    _add_settings(compare)
    compare.add_argument(
        '--output', default='compare', help='folder for the report (%(default)s)'
    )
    _add_json(compare)

    robot = commands.add_parser(
        'robot',
        help='what a parameter file makes of a robot',
        description='Print joints, limits and masses of the robot of a parameter file, what its '
        'task is, and where that is at the start.',
    )
    robot.add_argument('file', help='ROS 2 parameter file, or the name of an installed one')
    _add_settings(robot)
    _add_json(robot)

    recover = commands.add_parser(
        'recover',
        help='complete logs that were cut off or damaged',
        description='Complete, in their places, logs that were cut off or damaged. What is whole '
        'stays as it is; a log that is complete is not touched.',
    )
    recover.add_argument('logs', nargs='+', metavar='RUN.mcap', help='log to complete')

    param = commands.add_parser(
        'param',
        help='parameters of running nodes where the ros2 command is not installed',
        description='Read and set parameters of running nodes, as `ros2 param` does.',
    )
    add_param_arguments(param)

    report = commands.add_parser(
        'report',
        help="metrics, an interactive page and the paper's figures from logged runs",
        description="Metrics, an interactive page and the paper's Figures 3-8 from logged runs.",
    )
    report.add_argument('logs', nargs='+', metavar='RUN.mcap', help='logged run')
    report.add_argument('--output', default='report', help='folder for the report (%(default)s)')

    view = commands.add_parser(
        'view',
        help='see a logged run in Foxglove',
        description='Open a logged run in Foxglove where it is installed; otherwise serve it '
        'to the Foxglove app on this machine, and print its address.',
    )
    view.add_argument('log', metavar='RUN.mcap', help='logged run')
    view.add_argument(
        '--port', type=int, default=0, help='port to serve it at; 0 is any free one (%(default)s)'
    )

    layout = commands.add_parser(
        'layout',
        help='what Foxglove shows of a robot',
        description='Write the layout for Foxglove with the plots of a robot: its task axes, '
        'joints and parameters.',
    )
    layout.add_argument(
        'source', help='ROS 2 parameter file, the name of an installed one, or a logged run'
    )
    layout.add_argument(
        '--output', default='layout.json', metavar='FILE', help='where to (%(default)s)'
    )

    export = commands.add_parser(
        'export',
        help='logged runs as tables or arrays',
        description='Logged runs as tables with a row a state, or as arrays: number for number.',
    )
    export.add_argument('logs', nargs='+', metavar='RUN.mcap', help='logged run')
    export.add_argument('--output', default='export', help='folder for the files (%(default)s)')
    export.add_argument(
        '--format',
        default='csv',
        choices=('csv', 'parquet', 'npz'),
        help='csv, parquet (with pyarrow) or npz (NumPy) (%(default)s)',
    )
    export.add_argument('--overwrite', action='store_true', help='replace files that are there')
    return parser


if __name__ == '__main__':
    sys.exit(main())
