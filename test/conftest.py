# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Settings of all tests: order of files, time limits, signals, and missing packages.

Options let `.ci/run` execute each test once in two environments, and check the skipped tests.
"""

from __future__ import annotations

from collections.abc import Generator
import gc
from pathlib import Path
import re
import signal
from typing import Any

from hypothesis import HealthCheck, settings
from masmc_ros.errors import PACKAGES
import pytest

settings.register_profile(
    'any machine', deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile('any machine')

# Imported objects are permanent; the garbage collector need not scan them.
gc.disable()

# Background jobs and nohup ignore these signals, and their children would inherit this.
for number, usual in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) == signal.SIG_IGN:
        signal.signal(number, usual)

# websockets of Ubuntu 24.04 has no `websockets.sync` yet, and sybil is not in it.
INSTALLED_BY = {**PACKAGES, 'sybil': 'sybil', 'websockets': "'websockets>=11'"}
MISSING = re.compile(
    r'ModuleNotFoundError: .*\b(?P<module>rclpy|\w+_msgs|std_srvs|(?P<pip>'
    + '|'.join(INSTALLED_BY)
    + r'))\b'
)


LONG = (
    'package/test_documentation_examples.py',
    'native/test_library.py',
    'package/test_wheel.py',
    'nodes/test_law_change_nodes.py',
    'loop/test_latency.py',
    'native/test_device.py',
    'native/test_ros2_control.py',
    'native/test_page.py',
    'loop/test_tree_run.py',
    'campaign/test_cluster.py',
    'loop/test_tree_sizes.py',
    'loop/test_tree_tasks.py',
    'loop/test_hybrid_interface.py',
    'nodes/test_hostile_input.py',
    'loop/test_same_bits.py',
    'nodes/recorder/test_recorder_killed.py',
    'loop/test_lanes.py',
    'log/test_damaged_logs.py',
    'nodes/recorder/test_listeners_killed.py',
    'loop/test_tree_friction.py',
    'nodes/test_drives_nodes.py',
    'nodes/test_random_changes.py',
    'campaign/test_rows.py',
    'control/test_pauses.py',
    'identification/test_identify.py',
    'nodes/test_shipped_files_nodes.py',
    'nodes/test_busy_machine.py',
    'report/test_report_figures.py',
    'loop/test_other_mechanism.py',
    'robot/test_tree_natural_adaptation.py',
    'nodes/test_composed_nodes.py',
    'cli/test_param_command.py',
)
"""Files that take minutes, longest first: those with slow tests, then the others.

If a process started one of them last, all other processes would wait for it.
"""


PAGE = Path(__file__).parents[1] / 'docs' / 'development' / 'testing.md'
"""Page with the table of the reasons for which a test may be skipped."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of `.ci/run`."""
    group = parser.getgroup('masmc_ros')
    group.addoption('--write-passed', metavar='FILE', help='write the names of passed tests')
    group.addoption('--skip-passed', metavar='FILE', help='omit the tests that FILE names')
    text = f'fail if a test is skipped for a reason that is not in {PAGE.name}'
    group.addoption('--check-skipped', action='store_true', help=text)


def pytest_configure(config: pytest.Config) -> None:
    """Collect the results in the process that starts the others."""
    if not hasattr(config, 'workerinput'):
        config.pluginmanager.register(Results(config), 'masmc_ros results')


class Results:
    """Names of passed tests, and reasons of skipped ones."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._passed: list[str] = []
        self._unexplained: dict[str, str] = {}
        self._reasons = reasons()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == 'call' and report.passed and not hasattr(report, 'wasxfail'):
            self._passed.append(report.nodeid)
        self._note(report)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        self._note(report)

    def _note(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        if report.skipped and isinstance(report.longrepr, tuple):
            reason = report.longrepr[2].removeprefix('Skipped: ')
            if not any(known in reason for known in self._reasons):
                self._unexplained[report.nodeid] = reason

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if file := self._config.getoption('--write-passed'):
            Path(file).parent.mkdir(parents=True, exist_ok=True)
            Path(file).write_text('\n'.join(self._passed), encoding='utf-8')
        if self._config.getoption('--check-skipped') and self._unexplained:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self._config.getoption('--check-skipped'):
            for name, reason in self._unexplained.items():
                terminalreporter.write_line(
                    f'{name} was skipped: {reason}; expected a reason in {PAGE.name}'
                )


def reasons() -> list[str]:
    """Return the parts of reasons in the table of the page."""
    text = PAGE.read_text(encoding='utf-8').partition('\n## Skipped tests\n')[2]
    return re.findall(r'^\| `([^`]+)` \|', text.partition('\n## ')[0], re.MULTILINE)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Sort long files first; pytest-xdist distributes files to processes in this order."""
    if file := config.getoption('--skip-passed'):
        passed = set(Path(file).read_text(encoding='utf-8').splitlines())
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in passed])
        items[:] = [item for item in items if item.nodeid not in passed]
    folder = Path(__file__).parent
    ranks = {folder / name: rank for rank, name in enumerate(LONG)}
    items.sort(key=lambda item: ranks.get(item.path, len(LONG)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Share out files whole, but single pages of the documentation: all of them take minutes."""
    from xdist.scheduler import LoadFileScheduling

    class Files(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file: str = super()._split_scope(nodeid)
            return nodeid if file.endswith(LONG[0]) else file

    return Files(config, log)


def pytest_collection_finish() -> None:
    """Enable the garbage collector for objects that are created from now on."""
    gc.freeze()
    gc.enable()


def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Exempt what a file has compiled, up to gigabytes, from the garbage collector."""
    if nextitem is not None and nextitem.path != item.path:
        gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """
    Skip a file whose imports need ROS or a missing pip package.

    Otherwise one such file would stop the whole collection.
    """
    report = yield
    missing = MISSING.search(str(report.longrepr)) if report.failed else None
    if missing is not None:
        remedy = f'pip install {INSTALLED_BY[missing["pip"]]}' if missing['pip'] else 'install ROS'
        reason = f'Skipped: {missing["module"]} is not installed; {remedy}'
        report.outcome = 'skipped'
        report.longrepr = str(collector.path), 1, reason
    return report
